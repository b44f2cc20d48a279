"""The search problem: schedules of one duration, flown with one model."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from morphcore.optimise.flights import MorphFlights
from morphcore.optimise.limits import MorphSpace
from morphcore.optimise.torque_limit import Anchored, TorqueLimit, Trials
from morphcore.search.solver import Batch, Box
from morphcore.stopping import Deadline, Stop
from morphdata.optimize import Weights

Array = NDArray[np.float64]


class MorphProblem:
    """Schedules of one space, flown with one model.

    Parameters
    ----------
    space, flights, weights : the unknowns with their limits, the flights, and the weights of the cost.
    warm : (w, d) schedules of other searches to start from.
    """

    flights_each = 1

    def __init__(self, space: MorphSpace, flights: MorphFlights, weights: Weights, warm: Array) -> None:
        self.space, self.flights, self.weights, self.warm = space, flights, weights, warm
        self.limit = TorqueLimit(space.limits.max_hinge_torque_nm)

    @property
    def box(self) -> Box:
        """The bounds of the unknowns."""
        return Box(self.space.lower, self.space.upper)

    def arranged(self, points: Array) -> Array:
        """Return random points (p, d) with their knots in order.

        Unordered knots would put nearly all schedules near the centre, where their rays meet the limits.
        """
        inner = self.space.inner
        return np.concatenate(
            [np.sort(points[:, :inner], axis=1), np.sort(points[:, inner:], axis=1)], axis=1
        )

    def prepare(self, deadline: Deadline) -> None:
        """Do nothing: the optimisation has already chosen the time step."""

    def first(self) -> Batch:
        """Return the centre of the limits and the warm starts."""
        return Batch(np.concatenate([self.space.centre[None, :], self.space.drawn_back(self.warm)]))

    def anchored(self, points: Array, known: Trials) -> Anchored:
        """Return a batch of schedules that are all drawn back toward the first of the known ones."""
        count = points.shape[0]
        return Anchored(points, anchors=known.select(np.zeros(count, dtype=np.int64)))

    def evaluate(self, batch: Batch, stop: Stop | None) -> Trials:
        """Fly schedules as they are, or drawn back toward their anchors if their torque is too high."""
        if isinstance(batch, Anchored):
            return self.limit.kept(self.space, batch, lambda points: self._fly(points, stop))
        return self._fly(batch.points, stop)

    def _fly(self, points: Array, stop: Stop | None) -> Trials:
        if points.shape[0] == 0:  # no start moves, or the limits leave no room for probes
            nothing = np.zeros((0, 0))
            return Trials(points, np.zeros(0), nothing, 0, nothing)
        schedules = [self.space.schedule(point) for point in points]
        limited = self.limit.max_nm is not None
        flown = self.flights.fly(schedules, torque=limited, stop=stop)
        peak = np.where(flown.diverged & limited, np.nan, flown.peak_torque)
        errors = flown.errors(self.weights)
        return Trials(points, flown.cost(self.weights), errors, points.shape[0], flown.torque, peak)
