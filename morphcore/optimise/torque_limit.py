"""The limit of the hinge torque, which is known only after a flight.

A schedule whose flight exceeds it is drawn back, along the ray to one whose flight does not, until its own
flight keeps it. So the limit holds for every schedule that is taken, at every step of its flight in the model
that is searched with; between the steps the torque is smooth and moves by a square of the step.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from morphcore.optimise.limits import Map, MorphSpace

Array = NDArray[np.float64]

ROUNDS = 4  # of drawing back; what is still too much then stays at its anchor
AIM = 0.99  # of the limit, when a schedule is drawn back: the torque is not linear along the ray
NEAR = 0.9  # of the limit: drawn back this far is far enough
LINEAR_MARGIN = 1e-3  # of the limit, in linear models
WATCHED = 0.5  # of the limit: torques above are watched in linear models
MOST_WATCHED = 200


@dataclass(frozen=True)
class Trials:
    """Flown schedules: errors (p, m) with weights, costs (p,), torques (p, n) and their peaks (p,), N m."""

    errors: Array
    cost: Array
    torque: Array
    peak: Array

    @staticmethod
    def known(cost: Array, peak: Array) -> Trials:
        """Schedules flown before, of which only cost and peak torque were kept."""
        none = np.zeros((cost.size, 0))
        return Trials(none, cost, none, peak)

    def select(self, index: NDArray[np.int64] | NDArray[np.bool_] | slice) -> Trials:
        """Some of them."""
        return Trials(self.errors[index], self.cost[index], self.torque[index], self.peak[index])


@dataclass(frozen=True)
class TorqueLimit:
    """The largest torque of any hinge, N m; None is no limit."""

    most_nm: float | None

    def keeps(self, peak: Array) -> NDArray[np.bool_]:
        """Whether peak torques keep the limit."""
        if self.most_nm is None:
            return np.ones(peak.shape, dtype=np.bool_)
        return peak <= self.most_nm  # false for the NaN of a diverged flight

    def kept(
        self,
        space: MorphSpace,
        points: Array,
        anchors: Array,
        held: Trials,
        fly: Callable[[Array], Trials],
    ) -> tuple[Array, Trials]:
        """Fly points (p, d), each drawn back to its anchor until it keeps the limit.

        anchors : (p, d) that keep all limits, as flown (``held``: costs and peaks). Points keep the limits of
        the space, and so do all that are flown here. What cannot be brought back in a few rounds of false
        position ends at its anchor.
        """
        flown = fly(points)
        points, cost, peak = points.copy(), flown.cost.copy(), flown.peak.copy()
        open_ = np.flatnonzero(~self.keeps(peak))
        if self.most_nm is None or open_.size == 0:
            return points, Trials.known(cost, peak)
        targets = points.copy()
        points[open_], cost[open_], peak[open_] = anchors[open_], held.cost[open_], held.peak[open_]
        low, low_peak = np.zeros(points.shape[0]), held.peak.copy()
        high, high_peak = np.ones(points.shape[0]), np.where(np.isfinite(flown.peak), flown.peak, np.inf)
        for _ in range(ROUNDS):
            rise = np.maximum(high_peak[open_] - low_peak[open_], 1e-12)
            share = np.clip((AIM * self.most_nm - low_peak[open_]) / rise, 0.1, 0.9)
            middle = low[open_] + share * (high[open_] - low[open_])
            between = anchors[open_] + middle[:, None] * (targets[open_] - anchors[open_])
            tried = np.stack([space.put_back(*pair) for pair in zip(between, anchors[open_], strict=True)])
            again = fly(tried)
            good = self.keeps(again.peak)
            inside, outside = open_[good], open_[~good]
            points[inside], cost[inside], peak[inside] = tried[good], again.cost[good], again.peak[good]
            low[inside], low_peak[inside] = middle[good], again.peak[good]
            high[outside], high_peak[outside] = middle[~good], np.nan_to_num(again.peak[~good], nan=np.inf)
            open_ = open_[~(good & (again.peak > NEAR * self.most_nm))]
            if open_.size == 0:
                break
        return points, Trials.known(cost, peak)

    def linear(self, base: Array, torque: Array, gradient: Array) -> tuple[Map, Map] | None:
        """Slacks of the limit and their gradients, from torques (n,) and gradients (n, d) at a base (d,)."""
        if self.most_nm is None:
            return None
        watched = np.flatnonzero(np.abs(torque) > WATCHED * self.most_nm)
        if watched.size == 0:
            return None
        watched = watched[:: -(-watched.size // MOST_WATCHED)]
        side = np.sign(torque[watched])
        rows = -side[:, None] * gradient[watched] / self.most_nm
        room = 1.0 - LINEAR_MARGIN - np.abs(torque[watched]) / self.most_nm
        return (lambda z: room + rows @ (z - base)), (lambda _: rows)
