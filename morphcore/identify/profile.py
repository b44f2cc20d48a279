"""Profile likelihoods: how much worse the best fit becomes when one parameter is held elsewhere.

For a grid of values of the parameter all others are fitted anew, all values at once as one batch, by
Gauss-Newton steps on the whitened scores and the prior (`likelihood`). Where a parameter is not a search
coordinate itself (a share of the span), the step keeps its value by a Lagrange multiplier.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from morphcore.errors import InvalidInput
from morphcore.identify.likelihood import Likelihood
from morphcore.identify.parameters import Interval, SearchSpace
from morphcore.search.least_squares import differences
from morphcore.stopping import check_stop, say
from morphdata.renamed import current_name

Array = NDArray[np.float64]
Residuals = Callable[[Array], Array]  # search points (p, d) -> residuals (p, m)

WIDTH = 3.0  # of the grid, standard deviations to either side
MAX_WIDTH = 2.0  # to either side in the parameter's coordinate, where flights say little: factors e^2
ITERATIONS = 6  # of the fits
STEP_SHARES = np.array([1.0, 0.5, 0.2, 0.05])  # of each step, flown together
ENOUGH = 0.02  # decrease of -2 log L that is none
CRITICAL = float(chdtri(1, 0.05))  # rise at the ends of a 95 per cent interval
PROBE = 1e-6  # in search coordinates, for the slope of a named parameter


@dataclass(frozen=True)
class Profile:
    """Profile likelihood of one parameter.

    Attributes
    ----------
    name : str
    value : ndarray, shape (g,)
        Where it was held, SI units, rising.
    J : ndarray, shape (g,)
        Smallest sum of squared errors there, rad^2; NaN where nothing flew.
    rise : ndarray, shape (g,)
        -2 log of the likelihood over the best one's, prior included.
    interval : (float or None, float or None)
        Where the rise crosses `CRITICAL`; None on a side where it does not.
    """

    name: str
    value: Array
    J: Array
    rise: Array
    interval: Interval

    def to_document(self) -> dict[str, Any]:
        """JSON form with the names that the API fixes."""
        return {
            "value": self.value.tolist(),
            "J": [float(each) if np.isfinite(each) else None for each in self.J],
            "rise": [float(each) if np.isfinite(each) else None for each in self.rise],
            "interval_95": list(self.interval),
        }


def require_names(space: SearchSpace, names: list[str]) -> list[str]:
    """Names of searched parameters as they are called today.

    Raises
    ------
    InvalidInput : one is unknown, or not searched.
    """
    searched = [name for name, free in zip(space.parameter_names, space.searched, strict=True) if free]
    for number, name in enumerate(names):
        if current_name(name) not in searched:
            raise InvalidInput(
                f"{name!r} is not a parameter that is searched",
                pointer=f"/uncertainty/profile/{number}",
                hint=f"the searched ones are {', '.join(searched)}",
            )
    return [current_name(name) for name in names]


def profile(
    space: SearchSpace,
    name: str,
    estimate: Array,
    likelihood: Likelihood,
    residuals: Residuals,
    points: int,
) -> Profile:
    """Profile likelihood of a parameter around an estimate.

    Parameters
    ----------
    space : SearchSpace
    name : str
        Of a searched parameter.
    estimate : ndarray, shape (d,)
    likelihood : Likelihood
    residuals : callable
        Flies search points (p, d); gives their residuals (p, m).
    points : int
        Number of values, the estimate's among them if it is odd.
    """
    say(f"profile likelihood of {name}")
    row = space.parameter_names.index(name)
    slope = _slopes(space, row, estimate[None, :])[0]
    direction = likelihood.covariance @ slope
    variance = float(slope @ direction)
    width = min(WIDTH * np.sqrt(variance), MAX_WIDTH)
    offsets = width * np.linspace(-1.0, 1.0, points)
    # as a linear model would have it
    start = estimate + offsets[:, None] * direction / variance
    start = np.clip(start, likelihood.lower, likelihood.upper)
    found, J, misfit = _descended(space, row, likelihood, residuals, start)
    value = space.flatten(space.decode(found))[:, row]
    order = np.argsort(value, kind="stable")
    value, J, misfit = value[order], J[order], misfit[order]
    rise = misfit - np.nanmin(misfit)
    return Profile(name, value, J, rise, _crossings(value, rise))


def _descended(
    space: SearchSpace, row: int, likelihood: Likelihood, residuals: Residuals, x: Array
) -> tuple[Array, Array, Array]:
    """Best points (g, d) with the named parameter where it is in x (g, d), their J and -2 log L."""
    count, d = x.shape
    flown = residuals(x)
    misfit = -2.0 * likelihood.log_density(x, flown)
    for _ in range(ITERATIONS):
        check_stop()
        error, jacobian = differences(x, likelihood.upper, residuals)
        scores = likelihood.scores(error)
        slope = np.einsum("gmd,ms->gsd", jacobian, likelihood.jacobian @ likelihood.whitening)
        step = np.stack(
            [
                _constrained(likelihood, x[g], scores[g], slope[g], constraint)
                for g, constraint in enumerate(_slopes(space, row, x))
            ]
        )
        tried = x[:, None, :] + STEP_SHARES[:, None] * step[:, None, :]
        tried = np.clip(tried, likelihood.lower, likelihood.upper).reshape(-1, d)
        errors = residuals(tried)
        misfits = (-2.0 * likelihood.log_density(tried, errors)).reshape(count, -1)
        leader = np.argmin(misfits, axis=1)
        gained = misfit - misfits[np.arange(count), leader]
        better = gained > 0.0
        at = np.arange(count) * STEP_SHARES.size + leader
        x = np.where(better[:, None], tried[at], x)
        flown = np.where(better[:, None], errors[at], flown)
        misfit = np.where(better, misfits[np.arange(count), leader], misfit)
        if not np.any(gained > ENOUGH):
            break
    return x, np.sum(flown**2, axis=1), misfit


def _constrained(likelihood: Likelihood, x: Array, score: Array, slope: Array, constraint: Array) -> Array:
    """Gauss-Newton step (d,) that does not move along a constraint's normal (d,), nor out of the box."""
    weight = 1.0 / likelihood.spread**2
    normal = slope.T @ slope + weight * np.eye(x.size)
    gradient = slope.T @ score + weight * (x - likelihood.guess)
    free = ~(((x <= likelihood.lower) & (gradient > 0)) | ((x >= likelihood.upper) & (gradient < 0)))
    inverse = np.zeros_like(normal)
    inverse[np.ix_(free, free)] = np.linalg.inv(normal[np.ix_(free, free)])
    across = inverse @ constraint
    size = float(constraint @ across)
    held = (constraint @ inverse @ gradient) / size if size > 0.0 else 0.0
    return np.asarray(-inverse @ gradient + across * held)


def _slopes(space: SearchSpace, row: int, x: Array) -> Array:
    """(g, d) derivative of a named parameter's own coordinate by the search coordinates at x (g, d)."""
    count, d = x.shape
    probed = np.concatenate([x[:, None, :], x[:, None, :] + PROBE * np.eye(d)], axis=1).reshape(-1, d)
    named = space.flatten(space.decode(probed)).reshape(count, d + 1, -1)
    rates = np.stack([space.interval_rates(each[0])[row] for each in named])
    return np.asarray((named[:, 1:, row] - named[:, :1, row]) / PROBE * rates[:, None])


def _crossings(value: Array, rise: Array) -> Interval:
    """Where a profile crosses the critical rise on either side of its lowest point, by interpolation."""
    known = np.isfinite(rise)
    value, height = value[known], rise[known]
    best = int(np.argmin(height))
    sides: list[float | None] = []
    for order in (np.arange(best, -1, -1), np.arange(best, height.size)):
        above = np.flatnonzero(height[order] > CRITICAL)
        if not above.size:
            sides.append(None)
            continue
        outer, inner = order[above[0]], order[above[0] - 1]
        # the root of the rise is nearly straight
        low, high = np.sqrt(height[inner]), np.sqrt(height[outer])
        share = (np.sqrt(CRITICAL) - low) / (high - low)
        sides.append(float(value[inner] + share * (value[outer] - value[inner])))
    return sides[0], sides[1]
