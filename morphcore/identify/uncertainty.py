"""How well the samples determine the parameters, and the directions that they cannot see.

Where the rows of the samples are known, for noise that is correlated in time (`coloured`). Else, of
independent residuals, by Bard (1974), section 7-5: with residuals r and Jacobian A at the optimum, cov(x) =
s^2 (A^T A)^-1, s^2 = r^T r / (m - d). Intervals are Student's in the coordinate in which a parameter is
searched, and so of its own shape in its own unit: of factors for what is positive (stiffness, damping,
circulation lag), of log-odds for a share of the span, even to both sides for the rest.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from morphcore.identify.coloured import ColouredNoise
from morphcore.identify.parameters import Interval, SearchSpace
from morphcore.shown import Shown
from morphdata.renamed import both_spellings, under_both_spellings

Array = NDArray[np.float64]

# standard deviation along a direction, in search coordinates (factor e for a stiffness), beyond which
UNSEEN_SPREAD = 1.0
# the samples say nothing about it
NEGLIGIBLE_PART = 0.1  # components of a direction smaller than this are left out of the report
BLIND_SPREAD = 1e6  # stands for no bound at all: of a direction in which no residual changes
PROBABILITY = 0.95  # of an interval
WHITE = "white"  # the residuals are taken for independent and of one variance
COLOURED = "coloured"  # for correlated in time, by sample and angle


@dataclass(frozen=True, repr=False)
class Uncertainty(Shown):
    """Uncertainty of an identified model (d search coordinates, m named parameters).

    names : (d,) search coordinates. covariance : (d, d) in search coordinates. singular_values : (d,) of the
    Jacobian.
    directions : (d, d) rows: right singular vectors. parameter_names : (m,). standard_error : (m,) in SI
    units. intervals : of each searched parameter, SI units; None on a side where the samples do not bound it
    within the range that was searched. undetermined : parameters that may differ by a factor e, or by as much
    in their own way, or that are bounded on neither side. at_bound : those that ended at a bound.
    """

    names: tuple[str, ...]
    covariance: Array
    singular_values: Array
    directions: Array
    noise_rad: float
    parameter_names: tuple[str, ...]
    standard_error: Array
    intervals: dict[str, Interval]
    undetermined: tuple[str, ...]
    at_bound: tuple[str, ...]
    method: str
    spreads: Array

    def to_document(self) -> dict[str, Any]:
        """JSON form with the names that the API fixes."""
        spread = np.sqrt(np.maximum(np.diag(self.covariance), 0.0))
        correlation = self.covariance / np.maximum(np.outer(spread, spread), 1e-300)
        return {
            "method": self.method,
            "standard_error": under_both_spellings(
                {n: _finite(v) for n, v in zip(self.parameter_names, self.standard_error, strict=True)}
            ),
            "interval_95": under_both_spellings(
                {name: list(interval) for name, interval in self.intervals.items()}
            ),
            "undetermined": both_spellings(self.undetermined),
            "at_bound": both_spellings(self.at_bound),
            "coordinates": list(self.names),
            "correlation": np.clip(correlation, -1.0, 1.0).round(6).tolist(),
            "singular_values": self.singular_values.tolist(),
            "residual_rms_rad": self.noise_rad,
            "unidentifiable": [
                {
                    "spread": _finite(spread),
                    "direction": under_both_spellings(
                        {
                            name: round(float(part), 3)
                            for name, part in zip(self.names, direction, strict=True)
                            if abs(part) >= NEGLIGIBLE_PART
                        }
                    ),
                }
                for spread, direction in zip(self.spreads, self.directions, strict=True)
                if not spread <= UNSEEN_SPREAD
            ],
        }


def no_uncertainty(at_bound: tuple[str, ...]) -> dict[str, Any]:
    """JSON form where nothing was searched, or nobody has looked at the errors yet."""
    return {
        "standard_error": {},
        "interval_95": {},
        "undetermined": [],
        "at_bound": both_spellings(at_bound),
        "correlation": [],
        "unidentifiable": [],
    }


def uncertainty(
    space: SearchSpace, x: Array, residual: Array, jacobian: Array, noise: ColouredNoise | None = None
) -> Uncertainty:
    """Uncertainty at search point x (d,) from residuals (m,) and Jacobian (m, d) there.

    Parameters
    ----------
    space : SearchSpace
    x : ndarray, shape (d,)
    residual : ndarray, shape (m,)
        Weighted errors, rad.
    jacobian : ndarray, shape (m, d)
    noise : ColouredNoise, optional
        The same residuals by sample, with the prior of the fit. None: they are independent.
    """
    d = x.size
    freedom = max(residual.size - d, 1)
    noise_rad = float(np.sqrt(residual @ residual / freedom))
    _, singular, directions = np.linalg.svd(jacobian, full_matrices=False)
    floor = np.finfo(float).eps * max(jacobian.shape) * max(singular.max(initial=0.0), 1e-300)
    inverse = 1.0 / np.maximum(singular, floor)
    seen = noise_rad**2 * (directions.T * inverse**2) @ directions
    spreads = noise_rad * inverse
    covariance = seen
    if noise is not None:
        freedom = noise.freedom
        pseudo = (directions.T * inverse**2) @ directions
        seen = pseudo @ noise.middle @ pseudo
        spreads = np.sqrt(np.einsum("id,de,ie->i", directions, noise.middle, directions)) * inverse**2
        covariance = noise.covariance
    blind = singular <= floor
    if blind.any():  # noise of no size over a slope of none
        spreads = np.where(blind, np.inf, spreads)
        seen = seen + BLIND_SPREAD**2 * directions[blind].T @ directions[blind]
    probe = 1e-6
    named = space.flatten(space.decode(np.concatenate([x[None, :], x + probe * np.eye(d)])))
    slope = (named[1:] - named[0]).T / probe

    def error(covariance: Array) -> Array:
        return np.asarray(np.sqrt(np.maximum(np.einsum("md,de,me->m", slope, covariance, slope), 0.0)))

    standard_error = error(covariance)
    at_bound = space.at_bound(x)
    rates = space.interval_rates(named[0])
    wide = ~(error(seen) * rates <= UNSEEN_SPREAD)
    half = float(stdtrit(freedom, 0.5 + 0.5 * PROBABILITY)) * standard_error * rates
    # what only the prior holds has no interval
    half = np.where(wide & (rates > 0.0), np.inf, half) if noise is not None else half
    intervals = space.intervals(named[0], half, at_bound)
    unseen = {name for name, too_wide in zip(space.parameter_names, wide, strict=True) if too_wide}
    return Uncertainty(
        names=space.names,
        covariance=covariance,
        singular_values=singular,
        directions=directions,
        noise_rad=noise_rad,
        parameter_names=space.parameter_names,
        standard_error=standard_error,
        intervals=intervals,
        undetermined=tuple(
            name for name, ends in intervals.items() if ends == (None, None) or name in unseen
        ),
        at_bound=tuple(at_bound),
        method=WHITE if noise is None else COLOURED,
        spreads=spreads,
    )


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
