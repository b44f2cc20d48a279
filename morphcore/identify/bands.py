"""Predictive bands: where the attitude of a flight lies, by what is known about parameters and noise.

With draws from the posterior, these are flown and a row's band holds the middle 95 per cent of them. Without,
the covariance of the search coordinates is carried to the rows by their Jacobian on the flight itself. A
measurement of the row adds the noise of the training flights' residuals.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from morphcore.frames import wrap_angle
from morphcore.identify.belief import Belief
from morphcore.identify.cost import SampleCase, fly_attitudes, sample_cases, shared_trims
from morphcore.models.equivalent import ChainModel, ParameterBatch
from morphcore.search.least_squares import PROBE
from morphcore.shown import Shown
from morphcore.simulate.trajectory import Trajectory
from morphcore.simulate.trim import StartMode, Trim
from morphcore.stopping import check_stop, say
from morphcore.threads import one_blas_thread
from morphdata.measurement import ANGLES

if TYPE_CHECKING:
    from morphcore.identify.result import IdentifyResult

Array = NDArray[np.float64]

DRAWS = 256  # parameter sets of the posterior that are flown
PROBABILITY = 0.95
MIN_FLOWN = 20  # of the draws, to make a band of
HEADING = 2  # the angle that a flight takes from its first row, noise and all


@dataclass(frozen=True, repr=False)
class Band(Shown):
    """Predictive band of one flight.

    Attributes
    ----------
    sample : str
    time_s : ndarray, shape (k,)
    lower, upper : ndarray, shape (k, 3)
        Where phi, theta, psi of the model lie with 95 per cent probability, rad.
    measured_lower, measured_upper : ndarray, shape (k, 3)
        The same of measured angles.
    """

    sample: str
    time_s: Array
    lower: Array
    upper: Array
    measured_lower: Array
    measured_upper: Array

    def holds(self, euler: Array) -> NDArray[np.bool_]:
        """(k, 3) whether measured angles (k, 3) lie in the band."""
        middle = 0.5 * (self.measured_lower + self.measured_upper)
        half = 0.5 * (self.measured_upper - self.measured_lower)
        return np.asarray(np.abs(wrap_angle(euler - middle)) <= half)

    def to_document(self) -> dict[str, Any]:
        """JSON form: of each side, the angles by their names."""

        def columns(values: Array) -> dict[str, list[float]]:
            return {f"{name}_rad": each.tolist() for name, each in zip(ANGLES, values.T, strict=True)}

        return {
            "lower": columns(self.lower),
            "upper": columns(self.upper),
            "measured_lower": columns(self.measured_lower),
            "measured_upper": columns(self.measured_upper),
        }

    def to_curves(self) -> dict[str, dict[str, list[float]]]:
        """Band of measured angles as a picture takes it: the low and high ends by angle."""
        ends = zip(ANGLES, self.measured_lower.T, self.measured_upper.T, strict=True)
        return {f"{name}_rad": {"low": low.tolist(), "high": high.tolist()} for name, low, high in ends}


def predict_bands(
    result: IdentifyResult, samples: Sequence[Trajectory], *, draws: int = DRAWS, seed: int = 1
) -> tuple[Band, ...]:
    """Predictive bands of an identified model on any flights.

    Parameters
    ----------
    result : IdentifyResult
        With its uncertainty; its posterior is used where it has one.
    samples : sequence of Trajectory
        Flights with the drives' angles; of their attitude only the first heading is used.
    draws : int
        Parameter sets of the posterior that are flown.
    seed : int
        Of the choice among the posterior's draws.

    Returns
    -------
    tuple of Band
        One for each flight that the models fly to its end; none where nothing was searched.
    """
    belief, settings = result.belief, result.settings
    if belief.space is None:
        return ()
    step_s = () if settings.step_s is None else (settings.step_s,)
    cases = sample_cases(
        result.model, samples, *step_s, separate_wings=settings.separate_wings, start=settings.start
    )
    return bands_of_cases(result.model, belief, cases, settings.start, draws=draws, seed=seed)


def bands_of_cases(
    model: ChainModel,
    belief: Belief,
    cases: Sequence[SampleCase],
    start: StartMode,
    *,
    draws: int = DRAWS,
    seed: int = 1,
) -> tuple[Band, ...]:
    """Predictive bands on planned flights; arguments as of `predict_bands`."""
    space = belief.space
    if space is None or not cases:
        return ()
    say("flying predictive bands")
    if belief.posterior is None:
        inward = np.where(belief.estimate + PROBE > space.upper, -PROBE, PROBE)
        points = belief.estimate + np.concatenate([np.zeros((1, inward.size)), np.diag(inward)])
    else:
        inward = np.zeros(0)
        chosen = belief.posterior.draws
        points = chosen[np.random.default_rng(seed).choice(chosen.shape[0], size=draws)]
    batch = space.decode(points)
    bands = []
    with one_blas_thread():
        for case, found in shared_trims(model, batch, cases, start):
            check_stop()
            spread = _spread(model, belief, batch, case, found, inward)
            if spread is not None:
                bands.append(_band(case, belief, *spread))
    return tuple(bands)


def _spread(
    model: ChainModel,
    belief: Belief,
    batch: ParameterBatch,
    case: SampleCase,
    found: Trim,
    inward: Array,
) -> tuple[Array, Array, Array] | None:
    """Middle (k, 3) of a flight, and how far its band reaches down and up; None where it does not fly."""
    flown = fly_attitudes(model, batch, case, found)
    ended = np.all(np.isfinite(flown), axis=(1, 2))
    if inward.size:
        if not ended.all():
            return None
        slope = wrap_angle(flown[1:] - flown[0]) / inward[:, None, None]
        deviation = np.sqrt(np.einsum("dka,de,eka->ka", slope, belief.covariance, slope))
        half = float(ndtri(0.5 + 0.5 * PROBABILITY)) * deviation
        return flown[0], half, half
    if int(ended.sum()) < MIN_FLOWN:
        return None
    flown = flown[ended]
    middle = flown[0] + np.median(wrap_angle(flown - flown[0]), axis=0)
    tail = 0.5 * (1.0 - PROBABILITY)
    low, high = np.quantile(wrap_angle(flown - middle), [tail, 1.0 - tail], axis=0)
    return middle, -low, high


def _band(case: SampleCase, belief: Belief, middle: Array, down: Array, up: Array) -> Band:
    """A band with what a measurement adds: independent errors, whose squares add."""
    variance = (belief.noise_rad / case.weight) ** 2
    variance[HEADING] *= 2.0  # of the row, and of the first one
    noise = float(ndtri(0.5 + 0.5 * PROBABILITY)) * np.sqrt(variance)
    return Band(
        case.sample.name,
        case.sample.time_s,
        middle - down,
        middle + up,
        middle - np.sqrt(down**2 + noise**2),
        middle + np.sqrt(up**2 + noise**2),
    )
