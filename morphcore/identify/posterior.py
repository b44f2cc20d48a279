"""Draws of the parameters from their posterior, by flights of the batch kernel.

In turn: the most likely point near the estimate; a quadratic model of the scores, fitted to flights around it
and then to flights at its own draws (`surrogate`); and chains whose proposals are moves in the posterior of
that model, accepted or not by a flight, so that what the model gets wrong costs effort and not truth (the
surrogate transition of Liu 2001; delayed acceptance, Christen & Fox 2005). Chains are SIMD lanes.
"""

from __future__ import annotations

import io
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from morphcore.identify.chains import effective_samples, r_hat
from morphcore.identify.likelihood import Likelihood
from morphcore.identify.parameters import SearchSpace
from morphcore.identify.surrogate import Surrogate, surrogate, wander
from morphcore.shown import Shown
from morphcore.stopping import check_stop, say
from morphdata.uncertainty import PosteriorSettings

Array = NDArray[np.float64]
Residuals = Callable[[Array], Array]  # search points (p, d) -> residuals (p, m)

CHAINS = 64
FIRST_FLIGHTS = 3  # design points for each coefficient of the quadratic model
FIRST_RADIUS = (0.1, 0.7)  # of the design in standard deviations of the linear model
REFITS = 8  # of the quadratic model to flights at its own draws
REFIT_DRAWS = 512
DESCENT = 12  # steps towards the most likely point
STEP_SHARES = np.geomspace(1.0, 1e-3, 16)  # of each, flown as one block of lanes
WARMING = 30  # transitions of the model's chains before its draws are flown
TRANSITIONS = 2  # of the model's chains between two flights
LEAPS = 64  # of each transition
SHORT_LEAPS = 6  # of the single transition of a short move
SHORT_EVERY = 3  # of the moves, one is short
ROUND = 1e-8  # variance in search coordinates that is none
FIRST_STEP = 0.05  # of a leap, in standard deviations of the linear model
WANTED_ACCEPTANCE = 0.8  # of the transitions in the model
CHECKED = 20  # steps of the chains between two looks at their effective size
BURNT = 0.1  # share of each chain that is left out
MAX_R_HAT = 1.01  # chains that differ more go on


@dataclass(frozen=True, repr=False)
class Posterior(Shown):
    """Draws from the posterior of the parameters.

    Attributes
    ----------
    names : tuple of str
        Search coordinates (d,).
    parameter_names : tuple of str
        Named parameters (m,) that are searched.
    points : ndarray, shape (n, c, d)
        Chains c of search points.
    values : ndarray, shape (n * c, m)
        The parameters of all draws, SI units.
    log_density : ndarray, shape (n, c)
    acceptance : float
        Share of accepted proposals.
    flights : int
        Parameter sets flown.
    wall_s : float
    """

    names: tuple[str, ...]
    parameter_names: tuple[str, ...]
    points: Array
    values: Array
    log_density: Array
    acceptance: float
    flights: int
    wall_s: float

    @property
    def draws(self) -> Array:
        """(n * c, d) search points of all draws."""
        return self.points.reshape(-1, self.points.shape[-1])

    @property
    def effective_samples(self) -> Array:
        """(m,) effective sample size of each named parameter."""
        return effective_samples(self._chains)

    @property
    def r_hat(self) -> Array:
        """(m,) split R-hat of each named parameter."""
        return r_hat(self._chains)

    @property
    def _chains(self) -> Array:
        return self.values.reshape(*self.points.shape[:2], -1)

    def to_document(self) -> dict[str, Any]:
        """JSON form with the names that the API fixes."""
        low, middle, high = np.quantile(self.values, [0.025, 0.5, 0.975], axis=0)
        size, ratio = self.effective_samples, self.r_hat
        return {
            "draws": int(self.values.shape[0]),
            "chains": int(self.points.shape[1]),
            "effective_samples": float(size.min()),
            "r_hat": _finite(float(ratio.max())),
            "acceptance": self.acceptance,
            "flights": self.flights,
            "wall_s": self.wall_s,
            "parameters": {
                name: {
                    "mean": float(self.values[:, k].mean()),
                    "standard_deviation": float(self.values[:, k].std()),
                    "quantile_025": float(low[k]),
                    "quantile_50": float(middle[k]),
                    "quantile_975": float(high[k]),
                    "effective_samples": float(size[k]),
                    "r_hat": _finite(float(ratio[k])),
                }
                for k, name in enumerate(self.parameter_names)
            },
        }

    def to_file(self) -> bytes:
        """All draws as a NumPy archive: ``points`` and ``values`` with their names, ``log_density``."""
        stream = io.BytesIO()
        np.savez_compressed(
            stream,
            points=self.points,
            coordinates=np.array(self.names),
            values=self.values,
            parameters=np.array(self.parameter_names),
            log_density=self.log_density,
        )
        return stream.getvalue()


@dataclass
class _Flights:
    """Flights with their scores and densities, as many as have been flown."""

    likelihood: Likelihood
    residuals: Residuals
    count: int = 0
    points: list[Array] = field(default_factory=list)
    scores: list[Array] = field(default_factory=list)
    log_density: list[Array] = field(default_factory=list)

    def fly(self, points: Array, *, keep: bool = False) -> Array:
        """Logarithms (p,) of the density at points (p, d); those outside the box do not fly."""
        check_stop()
        found = np.full(points.shape[0], -np.inf)
        inside = self.likelihood.inside(points)
        if not inside.any():
            return found
        residual = self.residuals(points[inside])
        self.count += int(inside.sum())
        found[inside] = self.likelihood.log_density(points[inside], residual)
        if keep:
            self.points.append(points[inside])
            self.scores.append(self.likelihood.scores(residual))
            self.log_density.append(found[inside])
        return found

    def model(self, centre: Array, root: Array) -> Surrogate:
        """Fit the quadratic model to all flights that were kept."""
        z = np.asarray(np.linalg.solve(root, (np.concatenate(self.points) - centre).T).T, dtype=np.float64)
        scores, density = np.concatenate(self.scores), np.concatenate(self.log_density)
        return surrogate(self.likelihood, centre, root, z, scores, density)


def posterior(
    space: SearchSpace,
    estimate: Array,
    likelihood: Likelihood,
    residuals: Residuals,
    settings: PosteriorSettings,
    clock: Callable[[], float] = time.perf_counter,
) -> Posterior:
    """Draw from the posterior around an estimate.

    Parameters
    ----------
    space : SearchSpace
    estimate : ndarray, shape (d,)
    likelihood : Likelihood
    residuals : callable
        Flies search points (p, d); gives their residuals (p, m), which are those of ``likelihood``.
    settings : PosteriorSettings
    clock : callable
        Wall time, s.

    Returns
    -------
    Posterior
    """
    begin = clock()
    rng = np.random.default_rng(settings.seed)
    flights = _Flights(likelihood, residuals)
    say("posterior: looking for the most likely parameters")
    centre = _most_likely(flights, estimate)
    root = np.asarray(np.linalg.cholesky(likelihood.covariance), dtype=np.float64)
    model, z, step = _trained(flights, centre, root, rng)
    points, density, acceptance = _chains(flights, model, z, step, settings, rng)
    searched = space.searched
    drawn = points.reshape(-1, points.shape[-1])
    return Posterior(
        names=space.names,
        parameter_names=tuple(np.array(space.parameter_names)[searched]),
        points=points,
        values=space.flatten(space.decode(drawn))[:, searched],
        log_density=density,
        acceptance=acceptance,
        flights=flights.count,
        wall_s=clock() - begin,
    )


def _most_likely(flights: _Flights, estimate: Array) -> Array:
    """Search point of the largest density near an estimate: Newton steps with the slope there."""
    likelihood = flights.likelihood
    best, point = -np.inf, np.clip(estimate, likelihood.lower, likelihood.upper)
    tried = point[None, :]
    for _ in range(DESCENT):
        density = flights.fly(tried, keep=True)
        leader = int(np.argmax(density))
        if not density[leader] > best:
            break
        best, point = float(density[leader]), tried[leader]
        score = flights.scores[-1][leader]
        gradient = likelihood.slope.T @ score + (point - likelihood.guess) / likelihood.spread**2
        change = -likelihood.covariance @ gradient
        tried = np.clip(point + STEP_SHARES[:, None] * change, likelihood.lower, likelihood.upper)
    return point


def _trained(
    flights: _Flights, centre: Array, root: Array, rng: np.random.Generator
) -> tuple[Surrogate, Array, float]:
    """The quadratic model, chains (c, d) in its posterior, and a step that suits them."""
    d = centre.size
    coefficients = 1 + d + d * (d + 1) // 2
    radius = rng.uniform(*FIRST_RADIUS, size=(FIRST_FLIGHTS * coefficients, 1))
    say("posterior: flights around the most likely parameters")
    flights.fly(centre + radius * rng.normal(size=(radius.size, d)) @ root.T, keep=True)
    points, step = _likeliest(flights, rng), FIRST_STEP
    for refit in range(REFITS):
        say(f"posterior: model {refit + 1} of {REFITS}")
        model, z, step, kept = _refitted(flights, centre, root, points, step, rng)
        points = model.points(z[kept])
        # leaps are long where the coordinates have the spread of the posterior, bends and all
        spread = np.cov(points.T).reshape(d, d) + ROUND * np.eye(d)
        centre, root = points.mean(axis=0), np.asarray(np.linalg.cholesky(spread), dtype=np.float64)
    model, z, step, kept = _refitted(flights, centre, root, points, step, rng)
    return model, z[kept][:CHAINS], step


def _refitted(
    flights: _Flights, centre: Array, root: Array, points: Array, step: float, rng: np.random.Generator
) -> tuple[Surrogate, Array, float, NDArray[np.int64]]:
    """The model of all flights so far, flown draws z (n, d) of it, their step, and which draws to keep."""
    model = flights.model(centre, root)
    z = np.asarray(np.linalg.solve(root, (points - centre).T).T, dtype=np.float64)
    for _ in range(WARMING):
        check_stop()
        z, taken = wander(model, z, rng, transitions=1, leaps=LEAPS, step=step)
        step *= float(np.exp(taken - WANTED_ACCEPTANCE))
    gain = flights.fly(model.points(z), keep=True) - model.log_density(z)
    return model, z, step, _resampled(gain, rng)


def _resampled(gain: Array, rng: np.random.Generator) -> NDArray[np.int64]:
    """Draws of the model, again as often as the flights take them for more likely, none above the median.

    A quadratic model may have a second valley where there is none; the flights see that. Above the median
    they would only pick the few draws at which the model is off most.
    """
    weight = np.exp(np.minimum(gain - np.median(gain), 0.0))
    return np.asarray(rng.choice(gain.size, size=gain.size, p=weight / weight.sum()), dtype=np.int64)


def _likeliest(flights: _Flights, rng: np.random.Generator) -> Array:
    """Search points (n, d) to begin from, drawn from the likeliest quarter of what has been flown."""
    density, points = np.concatenate(flights.log_density), np.concatenate(flights.points)
    order = np.argsort(-density)[: max(density.size // 4, 1)]
    return np.asarray(points[rng.choice(order, size=REFIT_DRAWS)])


def _chains(
    flights: _Flights,
    model: Surrogate,
    z: Array,
    step: float,
    settings: PosteriorSettings,
    rng: np.random.Generator,
) -> tuple[Array, Array, float]:
    """Chains (n, c, d) of search points, their log densities (n, c), and the share that was accepted."""
    density, forecast = flights.fly(model.points(z)), model.log_density(z)
    kept: list[Array] = []
    densities: list[Array] = []
    accepted: list[float] = []
    while True:
        # where the model thinks too little of a point, no draw from far away takes its place: a near one does
        near = len(kept) % SHORT_EVERY == SHORT_EVERY - 1
        transitions, leaps = (1, SHORT_LEAPS) if near else (TRANSITIONS, LEAPS)
        moved, _ = wander(model, z, rng, transitions=transitions, leaps=leaps, step=step)
        found, expected = flights.fly(model.points(moved)), model.log_density(moved)
        with np.errstate(invalid="ignore"):
            gain = (found - density) - (expected - forecast)
        taken = np.log(rng.random(z.shape[0])) < np.nan_to_num(gain, nan=-np.inf)
        z = np.where(taken[:, None], moved, z)
        density, forecast = np.where(taken, found, density), np.where(taken, expected, forecast)
        kept.append(model.points(z))
        densities.append(density)
        accepted.append(float(np.mean(taken)))
        if len(kept) % CHECKED == 0 or flights.count >= settings.max_flights:
            first = int(BURNT * len(kept))
            points = np.stack(kept[first:])
            size = float(effective_samples(points).min())
            say(f"posterior: {size:.0f} of {settings.samples} effective samples")
            enough = size >= settings.samples and float(r_hat(points).max()) <= MAX_R_HAT
            if enough or flights.count >= settings.max_flights:
                return points, np.stack(densities[first:]), float(np.mean(accepted))


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None
