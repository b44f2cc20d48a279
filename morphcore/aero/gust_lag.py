"""How lift follows a gust that a section flies into: Küssner's function.

Lift does not jump when the leading edge enters a sharp-edged gust: it builds up while the gust travels over
the chord and the wake forms. Küssner's function contains all of this, the apparent mass of the air too, and
acts at the quarter chord at all times (Bisplinghoff, Ashley & Halfman 1955, section 5-7).

A gust is known along the path before the flight, and a section crosses it at the flight's airspeed. So the
lag is computed once for every chord, as a function of the place: `kuessner` for models whose strips take a
gust beside their own lagged motion. In a model that lags every circulation by Wagner's function, the gust is
first led through the inverse of that: `before_wagner`; what leaves Wagner's lag is then Küssner's.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from morphcore.aero.kernels.loads import JONES_A1, JONES_A2, JONES_B1, JONES_B2

Array = NDArray[np.float64]

# Küssner's function by R. T. Jones (1940): 1 - sum a exp(-b s), s in semichords from the leading edge. Three
# terms: the response to 1 - cos gusts of 2 to 10 chords is within 1.6 per cent of the exact function's; two
# terms, 0.5 exp(-0.13 s) and 0.5 exp(-s), are 4.7 per cent off.
KUESSNER_A = (0.236, 0.513, 0.171)
KUESSNER_B = (0.058, 0.364, 2.42)


@dataclass(frozen=True)
class Lag:
    """A linear lag over the path: ``direct`` times the input, plus gains times first-order lags of it.

    gains, rates : (n,) weights, and 1 / length of each first-order lag, per semichord. They and ``direct``
    sum to one.
    """

    direct: float
    gains: tuple[float, ...]
    rates: tuple[float, ...]

    def of(self, values: Array, spacing: float) -> Array:
        """The lagged values (k,) of values (k,), straight between places a ``spacing`` in semichords apart.

        Before the first place there was nothing. Each first-order lag is solved exactly.
        """
        from scipy.signal import lfilter  # late: few flights meet a gust

        out = self.direct * values
        for gain, rate in zip(self.gains, self.rates, strict=True):
            z = spacing * rate
            decay, mean = np.exp(-z), -np.expm1(-z) / z
            # x[k] = decay x[k - 1] + (mean - decay) u[k - 1] + (1 - mean) u[k], from x[0] = 0
            begin = np.array([-(1.0 - mean) * values[0]])
            out += gain * lfilter([1.0 - mean, mean - decay], [1.0, -decay], values, zi=begin)[0]
        return out

    @property
    def longest(self) -> float:
        """The longest of the first-order lags, semichords."""
        return 1.0 / min(self.rates)


KUESSNER = Lag(1.0 - sum(KUESSNER_A), KUESSNER_A, KUESSNER_B)


@cache
def before_wagner() -> Lag:
    """Return the lag that Jones' form of Wagner's function turns into Küssner's.

    The ratio of both transfer functions in partial fractions: its poles are Küssner's and the zeros of
    Wagner's.
    """
    wagner = Lag(1.0 - JONES_A1 - JONES_A2, (JONES_A1, JONES_A2), (JONES_B1, JONES_B2))
    top, bottom = _polynomials(KUESSNER), _polynomials(wagner)
    numerator, denominator = np.polymul(top[0], bottom[1]), np.polymul(top[1], bottom[0])
    poles = np.roots(denominator).real
    slope = np.polyval(np.polyder(denominator), poles)
    gains = np.polyval(numerator, poles) / slope / -poles
    return Lag(KUESSNER.direct / wagner.direct, tuple(gains.tolist()), tuple((-poles).tolist()))


def _polynomials(lag: Lag) -> tuple[Array, Array]:
    """Numerator and denominator of a lag's transfer function, in the Laplace variable per semichord."""
    denominator = np.poly([-rate for rate in lag.rates])
    numerator = lag.direct * denominator
    for number, (gain, rate) in enumerate(zip(lag.gains, lag.rates, strict=True)):
        others = [-other for k, other in enumerate(lag.rates) if k != number]
        numerator = np.polyadd(numerator, gain * rate * np.poly(others))
    return np.asarray(numerator), np.asarray(denominator)
