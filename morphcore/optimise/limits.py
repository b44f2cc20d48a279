"""Exact limits of rate, acceleration, sign and range on schedules, checked without a flight.

A point holds the unknowns of one schedule: the times of the knots between both ends as shares of the
duration, then, where the values are free, the angles there as shares of the change. Every limit is a *slack*
that must not be negative; all are extrema of cubic pieces in closed form (see shapes.py), made relative so
that a slack of 0.1 means a tenth of the limit.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from morphcore.optimise.shapes import Shapes, clamped_shapes
from morphcore.simulate.schedule import Spline
from morphdata.optimize import Limits, Morph

Array = NDArray[np.float64]
Map = Callable[[Array], Array]

# a schedule satisfies a limit if it leaves this relative slack: above the round-off of any program that
# evaluates the spline again, and of numbers printed with ten digits
HELD = 1e-9
SHORTEST_PIECE = (
    0.01  # of the duration, between knots: closer ones make a jolt that a flight's step would miss
)
BESIDE = 1e-7  # relative margin of points that are put back
PROBE = 1e-7  # step of the slacks' finite differences; their arguments are of order one
RAY_POINTS = 32  # checked on a ray before the last interval is bisected
HALVINGS = 40
RAMPS = (0.02, 0.1, 0.3, 0.5)  # of the duration: ramps of the constant rates that are tried first
WAITS = (0.0, 0.2, 0.4, 0.6)  # of the duration: waiting time before them
MAX_ITERATIONS = 60  # of the quadratic programs; further ones only chase round-off at corners of the limits
TOLERANCE = 1e-11  # tolerance of their cost
NARROW = 0.02  # if the slack is smaller, the search for the centre also starts from the quickest morph


@dataclass(frozen=True)
class MorphSpace:
    """The unknowns of a morph of one duration, and the limits on them.

    low, high : smallest and largest angle that the hinges (and the lattice's table) allow, as shares of the
    change; only needed by a schedule that may reverse.
    """

    morph: Morph
    limits: Limits
    duration_s: float
    low: float = 0.0
    high: float = 1.0

    @property
    def inner(self) -> int:
        """Number of knots between both ends."""
        return self.morph.knots - 2

    @property
    def dimension(self) -> int:
        """Number of unknowns."""
        return self.inner * (2 if self.morph.free_values else 1)

    @property
    def lower(self) -> Array:
        """(d,) smallest value of each unknown."""
        values = np.full(self.dimension - self.inner, 0.0 if self.limits.monotonic else self.low)
        return np.concatenate([np.zeros(self.inner), values])

    @property
    def upper(self) -> Array:
        """(d,) largest value of each unknown."""
        values = np.full(self.dimension - self.inner, 1.0 if self.limits.monotonic else self.high)
        return np.concatenate([np.ones(self.inner), values])

    def knots(self, points: Array) -> tuple[Array, Array]:
        """Times and values (p, k) of all knots of points (p, d), as shares of duration and change."""
        zero, one = np.zeros((points.shape[0], 1)), np.ones((points.shape[0], 1))
        time = np.concatenate([zero, points[:, : self.inner], one], axis=1)
        if self.morph.free_values:
            return time, np.concatenate([zero, points[:, self.inner :], one], axis=1)
        return time, np.tile(np.linspace(0.0, 1.0, self.morph.knots), (points.shape[0], 1))

    def shapes(self, points: Array) -> Shapes:
        """The shapes of points (p, d)."""
        return clamped_shapes(*self.knots(points))

    def schedule(self, point: Array) -> Spline:
        """The schedule of one point (d,)."""
        time, value = self.knots(point[None, :])
        angle = self.morph.begin + self.morph.change * value[0]
        angle[-1] = self.morph.end
        return Spline(self.duration_s * time[0], angle)

    def slack(self, points: Array) -> Array:
        """(p, m) slack that points (p, d) leave in each limit; none may be negative.

        Rate: its value at the knots and at its extrema. Acceleration: at the knots, where it is largest
        because the pieces are linear. Sign: the minimum rate of every piece; in the first it is ``s (b + c
        s)``, which is never negative if the acceleration at the start and the rate at the piece's end are
        not; likewise in the last.
        """
        shapes = self.shapes(points)
        steepness = abs(self.morph.change) / self.duration_s  # mean rate, rad/s
        turning, inner = shapes.turning_rate(), shapes.rate[:, 1:-1]
        rates = np.concatenate([turning, inner], axis=1)
        kept = [self.inner * (np.diff(shapes.time, axis=1) - SHORTEST_PIECE)]
        if self.limits.max_rate_rad_s is not None:
            share = rates * (steepness / self.limits.max_rate_rad_s)
            kept += [1.0 - share] if self.limits.monotonic else [1.0 - share, 1.0 + share]
        if self.limits.max_accel_rad_s2 is not None:
            accelerations = np.concatenate([shapes.first, shapes.last[:, -1:]], axis=1)
            share = accelerations * (steepness / self.duration_s / self.limits.max_accel_rad_s2)
            kept += [1.0 - share, 1.0 + share]
        if self.limits.monotonic:
            start = shapes.first[:, :1] * shapes.length[:, :1]
            end = -shapes.last[:, -1:] * shapes.length[:, -1:]
            kept += [start, inner, turning[:, 1:-1], end]
        else:
            values = np.concatenate([shapes.turning_values(), shapes.value[:, 1:-1]], axis=1)
            kept += [self.high - values, values - self.low]
        return np.concatenate(kept, axis=1)

    def peak_acceleration(self, points: Array) -> Array:
        """(p,) largest acceleration of points (p, d), rad/s^2."""
        shapes = self.shapes(points)
        peak = np.abs(np.concatenate([shapes.first, shapes.last[:, -1:]], axis=1)).max(axis=1)
        return np.asarray(peak * abs(self.morph.change) / self.duration_s**2)

    def min_slack(self, points: Array) -> Array:
        """(p,) slack of the tightest limit."""
        return np.asarray(self.slack(points).min(axis=1))

    def keeps(self, points: Array) -> NDArray[np.bool_]:
        """(p,) whether points (p, d) satisfy all limits."""
        return self.min_slack(points) >= HELD

    # a place to draw back to

    @cached_property
    def centre(self) -> Array:
        """(d,) the point whose minimum slack is largest, as far as a local search finds it.

        Sequential quadratic programming on max t, slack(x) >= t, from the best constant rate with ramps and,
        if that leaves little slack, also from the quickest morph.
        """
        tried = np.concatenate([self.waiting((0.0,)), self._even])
        best = tried[int(np.argmax(self.min_slack(tried)))]
        centre = self._with_more_room(best)
        if self.min_slack(centre[None, :])[0] < NARROW:
            quick = self.quickest[1]
            pair = np.stack([centre, quick, self._with_more_room(quick)])
            centre = pair[int(np.argmax(self.min_slack(pair)))]
        centre.setflags(write=False)
        return centre

    @property
    def room(self) -> float:
        """Minimum slack of the centre: the room that limits leave; negative if no schedule is feasible."""
        return float(self.min_slack(self.centre[None, :])[0])

    @cached_property
    def quickest(self) -> tuple[float, Array]:
        """The shortest duration, s, in which schedules of these knots satisfy the limits, and its point (d,).

        Found by a local search: min T, slack_T(x) >= 0. Zero if neither rate nor acceleration is limited. The
        hinge torque is not considered, because it takes flights.
        """
        tried = np.concatenate([self.waiting((0.0,)), self._even])
        needed = [self._needed(point) for point in tried]
        best = int(np.argmin(needed))
        if needed[best] == 0.0:
            return 0.0, tried[best]
        scale = needed[best]

        def slack(x: Array) -> Array:
            return np.asarray(replace(self, duration_s=scale * x[-1]).slack(x[None, :-1])[0] - 10.0 * HELD)

        def rows(x: Array) -> Array:
            here = replace(self, duration_s=scale * x[-1])
            later = replace(self, duration_s=scale * (x[-1] + PROBE)).slack(x[None, :-1])[0]
            with_time = (later - here.slack(x[None, :-1])[0]) / PROBE
            return np.concatenate([here.slack_gradient(x[:-1]), with_time[:, None]], axis=1)

        rising = np.append(np.zeros(self.dimension), 1.0)
        found = _minimised(
            lambda x: float(x[-1]), lambda _: rising, np.append(tried[best], 1.0), [(slack, rows)]
        )
        point = np.clip(found[:-1], self.lower, self.upper)
        duration = self._needed(point)
        return (duration, point) if duration < scale else (scale, tried[best])

    @property
    def _even(self) -> Array:
        """(1, d) knots at equal times and angles."""
        return np.tile(np.linspace(0.0, 1.0, self.morph.knots)[1:-1], self.dimension // self.inner)[None, :]

    def _needed(self, point: Array) -> float:
        """Return the shortest duration, s, at which a point keeps the limits; infinite if it never does."""
        ends = replace(self, duration_s=1e9)
        if not ends.keeps(point[None, :])[0]:
            return np.inf
        shapes, change = self.shapes(point[None, :]), abs(self.morph.change)
        needed = 0.0
        if self.limits.max_rate_rad_s is not None:
            rates = np.concatenate([shapes.turning_rate(), shapes.rate], axis=1)
            needed = change * float(np.abs(rates).max()) / self.limits.max_rate_rad_s
        if self.limits.max_accel_rad_s2 is not None:
            accelerations = np.concatenate([shapes.first, shapes.last], axis=1)
            squared = change * float(np.abs(accelerations).max()) / self.limits.max_accel_rad_s2
            needed = max(needed, float(np.sqrt(squared)))
        return needed * (1.0 + 2.0 * HELD)

    def _with_more_room(self, start: Array) -> Array:
        """Return the point (d,) with the largest minimum slack near another, or that other point."""

        def rows(x: Array) -> Array:
            gradient = self.slack_gradient(x[:-1])
            return np.concatenate([gradient, -np.ones((gradient.shape[0], 1))], axis=1)

        def slack(x: Array) -> Array:
            return np.asarray(self.slack(x[None, :-1])[0] - x[-1])

        raising = np.append(np.zeros(self.dimension), -1.0)
        first = np.append(start, self.min_slack(start[None, :])[0])
        found = _minimised(lambda x: -float(x[-1]), lambda _: raising, first, [(slack, rows)])[:-1]
        pair = np.stack([start, np.clip(found, self.lower, self.upper)])
        return np.asarray(pair[int(np.argmax(self.min_slack(pair)))])

    def waiting(self, waits: Sequence[float] = WAITS) -> Array:
        """(p, d) points of schedules that wait, then move at constant rate between ramps to the end.

        As well as a few knots can represent them; they need not satisfy the limits. With fixed values the
        knots lie at equal angles; free knots lie at the corners of the ramps, where the spline has to bend.
        """
        points = []
        even = np.linspace(0.0, 1.0, self.morph.knots)[1:-1]
        for wait, ramp in product(waits, RAMPS):
            share = ramp / (1.0 - wait)
            if share > 0.5:
                continue
            time, value = even, even
            if self.morph.free_values:
                rest = np.linspace(wait + ramp, 1.0 - ramp, max(self.inner - 1, 1))
                time = np.concatenate([[wait], rest])[-self.inner :]
                points.append(np.concatenate([time, _trapezoid((time - wait) / (1.0 - wait), share)]))
            time = wait + (1.0 - wait) * _trapezoid_time(value, share)
            points.append(np.concatenate([time, value]) if self.morph.free_values else time)
        return np.stack(points)

    # maps onto the feasible set

    def drawn_back(self, points: Array) -> Array:
        """Return points (p, d) on the rays from the centre to the given ones, as far out as the limits allow.

        A feasible point stays where it is. For the others the ray is walked outward to the last point before
        a limit is first broken, found among RAY_POINTS and then by bisection; every returned point has itself
        been checked.
        """
        held = self.centre
        out = points.copy()
        broken = np.flatnonzero(~self.keeps(points))
        if broken.size == 0:
            return out
        move = points[broken] - held
        share = np.linspace(0.0, 1.0, RAY_POINTS + 1)[1:]
        along = held + share[None, :, None] * move[:, None, :]
        kept = self.keeps(along.reshape(-1, self.dimension)).reshape(broken.size, -1)
        first_bad = np.argmin(kept, axis=1)  # the last point breaks a limit, so there is one
        low = np.where(first_bad > 0, share[first_bad - 1], 0.0)
        high = share[first_bad]
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            good = self.keeps(held + middle[:, None] * move)
            low, high = np.where(good, middle, low), np.where(good, high, middle)
        out[broken] = np.where(low[:, None] > 0.0, held + low[:, None] * move, held)
        return out

    def nearest(self, point: Array, margin: float) -> Array | None:
        """Return the nearest point (d,) that leaves a margin in all limits; None if none was found."""
        slack = self.min_slack(point[None, :])[0]
        if slack >= margin:
            return point
        found = self.constrained(
            lambda x: float((x - point) @ (x - point)), lambda x: 2.0 * (x - point), point, 1.2 * margin
        )
        if self.min_slack(found[None, :])[0] >= margin:
            return found
        # the first point along the ray to the centre that leaves the margin
        share = np.linspace(0.0, 1.0, 4 * RAY_POINTS)[:, None]
        along = point + share * (self.centre - point)
        good = np.flatnonzero(self.min_slack(along) >= margin)
        return along[good[0]] if good.size else None

    def put_back(self, point: Array, other: Array) -> Array:
        """Return a point (d,) if it is feasible, else the nearest feasible point, else a known feasible one.

        Meant for steps between points at the limits: limits are curved, and the ray between two such points
        may run just outside them.
        """
        if self.keeps(point[None, :])[0]:
            return point
        near = self.nearest(point, BESIDE)
        return other if near is None else near

    def constrained(
        self,
        cost: Callable[[Array], float],
        gradient: Callable[[Array], Array],
        start: Array,
        margin: float,
        more: tuple[Map, Map] | None = None,
    ) -> Array:
        """Return a local minimum (d,) of a smooth cost under the limits, by sequential quadratic programming.

        It satisfies the limits only to the solver's tolerance: check it or draw it back. ``more`` : further
        slacks and their gradients.
        """
        limits: list[tuple[Map, Map]] = [(lambda x: self.slack(x[None, :])[0] - margin, self.slack_gradient)]
        found = _minimised(cost, gradient, start, limits + ([] if more is None else [more]))
        return np.clip(found, self.lower, self.upper)

    def slack_gradient(self, point: Array) -> Array:
        """Return (m, d) forward differences of the slacks at one point."""
        probes = point + np.concatenate([np.zeros((1, self.dimension)), PROBE * np.eye(self.dimension)])
        slack = self.slack(probes)
        return np.asarray(((slack[1:] - slack[0]) / PROBE).T)


def _minimised(
    cost: Callable[[Array], float], gradient: Map, start: Array, slacks: Sequence[tuple[Map, Map]]
) -> Array:
    """Return a local minimum under slacks that must not be negative, or the start if the solver fails."""
    constraints = [{"type": "ineq", "fun": slack, "jac": rows} for slack, rows in slacks]
    found = minimize(  # type: ignore[call-overload]
        cost,
        start,
        jac=gradient,
        constraints=constraints,
        method="SLSQP",
        options={"maxiter": MAX_ITERATIONS, "ftol": TOLERANCE},
    ).x
    return found if np.all(np.isfinite(found)) else start


def _trapezoid(time: Array, ramp: float) -> Array:
    """Completed share of a morph at shares of its time (k,), at constant rate between ramps."""
    t = np.clip(time, 0.0, 1.0)
    rate = 1.0 / (1.0 - ramp)
    rising, falling = 0.5 * rate / ramp * t**2, 1.0 - 0.5 * rate / ramp * (1.0 - t) ** 2
    return np.where(t < ramp, rising, np.where(t > 1.0 - ramp, falling, rate * (t - 0.5 * ramp)))


def _trapezoid_time(value: Array, ramp: float) -> Array:
    """The inverse of ``_trapezoid``."""
    rate = 1.0 / (1.0 - ramp)
    corner = 0.5 * rate * ramp  # share completed at the end of the first ramp
    rising = np.sqrt(2.0 * ramp / rate * np.minimum(value, corner))
    falling = 1.0 - np.sqrt(2.0 * ramp / rate * np.minimum(1.0 - value, corner))
    even = 0.5 * ramp + value / rate
    return np.where(value < corner, rising, np.where(1.0 - value < corner, falling, even))
