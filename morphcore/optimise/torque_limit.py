"""The limit of the hinge torque, which can only be checked by a flight.

A schedule whose flight exceeds it is drawn back, along the ray to one whose flight does not, until its own
flight satisfies it. So the limit holds for every accepted schedule, at every step of its flight in the
searched model; between the steps the torque is smooth and varies with the square of the step.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from morphcore.optimise.limits import Map, MorphSpace
from morphcore.search.checkpoint import stored
from morphcore.search.solver import Batch, Outcome

Array = NDArray[np.float64]

ROUNDS = 4  # rounds of drawing back; a schedule that still exceeds the limit is replaced by its anchor
AIM = 0.99  # target as a share of the limit when drawing back: the torque is not linear along the ray
NEAR = 0.9  # share of the limit at which drawing back stops
LINEAR_MARGIN = 1e-3  # share of the limit, in linear models
WATCHED = 0.5  # share of the limit above which torques enter the linear models
MAX_WATCHED = 200


@stored
@dataclass(frozen=True)
class Trials(Outcome):
    """Flown schedules; residuals are the departures times the square roots of their weights.

    Attributes
    ----------
    torque : (p, n) of all hinges at all steps, N m; only with residuals.
    peak : (p,) the largest of them; NaN for a diverged flight.
    """

    torque: Array | None = None
    peak: Array = field(default_factory=lambda: np.zeros(0))

    @staticmethod
    def known(points: Array, cost: Array, peak: Array, evaluations: int = 0) -> Trials:
        """Return earlier schedules, of which only cost and peak torque were kept."""
        return Trials(points, cost, None, evaluations, None, peak)

    def select(self, index: NDArray[np.int64] | NDArray[np.bool_] | slice) -> Trials:
        """Return a subset, without residuals and torques."""
        return Trials.known(self.points[index], self.cost[index], self.peak[index])


@dataclass(frozen=True)
class Anchored(Batch):
    """Schedules that are drawn back toward anchors, one each, until their torque satisfies the limit.

    ``anchors`` : (p, d) points that satisfy all limits, with their costs and peaks.
    """

    anchors: Trials = field(default_factory=lambda: Trials(np.zeros((0, 0)), np.zeros(0)))


@dataclass(frozen=True)
class TorqueLimit:
    """The largest allowed torque of any hinge, N m; None means no limit."""

    max_nm: float | None

    def keeps(self, peak: Array) -> NDArray[np.bool_]:
        """Return whether peak torques satisfy the limit."""
        if self.max_nm is None:
            return np.ones(peak.shape, dtype=np.bool_)
        return peak <= self.max_nm  # false for the NaN of a diverged flight

    def kept(self, space: MorphSpace, batch: Anchored, fly: Callable[[Array], Trials]) -> Trials:
        """Fly points (p, d), each drawn back toward its anchor until it satisfies the limit.

        The points satisfy the limits of the space, and so do all that are flown here. A point that a few
        rounds of false position cannot bring within the limit ends at its anchor.
        """
        flown, anchors = fly(batch.points), batch.anchors
        count = flown.evaluations
        points, cost, peak = batch.points.copy(), flown.cost.copy(), flown.peak.copy()
        open_ = np.flatnonzero(~self.keeps(peak))
        if self.max_nm is None or open_.size == 0:
            return Trials.known(points, cost, peak, count)
        targets = points.copy()
        points[open_], cost[open_] = anchors.points[open_], anchors.cost[open_]
        peak[open_] = anchors.peak[open_]
        low, low_peak = np.zeros(points.shape[0]), anchors.peak.copy()
        high, high_peak = np.ones(points.shape[0]), np.where(np.isfinite(flown.peak), flown.peak, np.inf)
        for _ in range(ROUNDS):
            rise = np.maximum(high_peak[open_] - low_peak[open_], 1e-12)
            share = np.clip((AIM * self.max_nm - low_peak[open_]) / rise, 0.1, 0.9)
            middle = low[open_] + share * (high[open_] - low[open_])
            held = anchors.points[open_]
            between = held + middle[:, None] * (targets[open_] - held)
            tried = np.stack([space.put_back(*pair) for pair in zip(between, held, strict=True)])
            again = fly(tried)
            count += again.evaluations
            good = self.keeps(again.peak)
            inside, outside = open_[good], open_[~good]
            points[inside], cost[inside], peak[inside] = tried[good], again.cost[good], again.peak[good]
            low[inside], low_peak[inside] = middle[good], again.peak[good]
            high[outside], high_peak[outside] = middle[~good], np.nan_to_num(again.peak[~good], nan=np.inf)
            open_ = open_[~(good & (again.peak > NEAR * self.max_nm))]
            if open_.size == 0:
                break
        return Trials.known(points, cost, peak, count)

    def linear(self, base: Array, torque: Array, gradient: Array) -> tuple[Map, Map] | None:
        """Slacks of the limit and their gradients, from torques (n,) and gradients (n, d) at a base (d,)."""
        if self.max_nm is None:
            return None
        watched = np.flatnonzero(np.abs(torque) > WATCHED * self.max_nm)
        if watched.size == 0:
            return None
        watched = watched[:: -(-watched.size // MAX_WATCHED)]
        side = np.sign(torque[watched])
        rows = -side[:, None] * gradient[watched] / self.max_nm
        room = 1.0 - LINEAR_MARGIN - np.abs(torque[watched]) / self.max_nm
        return (lambda z: room + rows @ (z - base)), (lambda _: rows)
