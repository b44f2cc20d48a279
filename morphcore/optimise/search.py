"""One search: the schedule of least variation for one model and one duration, step by step.

baseline : fly the centre of the limits and what neighbouring searches found. ease : where even these exceed
the hinge torque, lower it until one does not. Then "hybrid": screen (random schedules, drawn back to the
limits) and polish (descent from the best); or "pso": the swarm.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from morphcore.optimise.descent import DescentState, first_descent, next_descent
from morphcore.optimise.flights import MorphFlights
from morphcore.optimise.limits import MorphSpace
from morphcore.optimise.settings import ScheduleSearch, Weights
from morphcore.optimise.torque_limit import TorqueLimit, Trials
from morphcore.simulate.batch import Stop
from morphcore.swarm import SwarmState, first_swarm, next_swarm

Array = NDArray[np.float64]
Phase = Literal["baseline", "ease", "screen", "swarm", "polish", "done"]

# the field of starts narrows as the descent goes on: iteration -> starts kept (as a share of the first field)
NARROWING = ((5, 1.0), (10, 0.5))
EASE_TARGET = 0.95  # of the torque limit: what lies above is lowered
EASE_ITERATIONS = 12
USUAL_ITERATIONS = 8  # of a descent: for the progress that is shown


@dataclass(frozen=True)
class SearchState:
    """A search between two steps.

    phase : what comes next. best : (d,) the point of least cost so far; its cost (rad^2) and peak torque
    (N m). anchor : (d,) the point that torques are drawn back to, likewise. warm : (w, d) points of other
    searches to begin with. feasible : whether any schedule kept the torque limit.
    """

    phase: Phase
    warm: Array
    best: Array
    best_cost: float = np.inf
    best_torque: float = np.inf
    anchor: Array = field(default_factory=lambda: np.zeros(0), repr=False)
    anchor_cost: float = np.inf
    anchor_torque: float = np.inf
    generation: int = 0
    flights: int = 0
    wall_s: float = 0.0
    budget_s: float | None = None
    swarm: SwarmState | None = field(default=None, repr=False)
    descent: DescentState | None = field(default=None, repr=False)

    @property
    def feasible(self) -> bool:
        """Whether a schedule was found that keeps all limits."""
        return bool(np.isfinite(self.best_cost))


class SearchRun:
    """What one search flies with."""

    def __init__(
        self, space: MorphSpace, flights: MorphFlights, settings: ScheduleSearch, weights: Weights
    ) -> None:
        self.space, self.flights, self.settings, self.weights = space, flights, settings, weights
        self.limit = TorqueLimit(space.limits.max_hinge_torque_nm)
        self._flown = 0

    def begin(self, warm: Array, budget_s: float | None = None) -> SearchState:
        """The state before the first step."""
        return SearchState("baseline", warm, self.space.centre, budget_s=budget_s)

    def advance(self, state: SearchState, stop: Stop | None) -> tuple[SearchState, dict[str, Any]]:
        """One step, and its row of the history."""
        self._flown = 0
        step = {
            "baseline": self._baseline,
            "ease": self._ease,
            "screen": self._screen,
            "swarm": self._generation,
            "polish": self._polish,
        }[state.phase]
        after = step(state, stop)
        after = replace(after, flights=state.flights + self._flown, generation=state.generation + 1)
        row = {"phase": state.phase, "particles": self._flown}
        return after, row

    # one step each

    def _baseline(self, state: SearchState, stop: Stop | None) -> SearchState:
        """Fly the centre and the warm starts: from here on there is a best so far."""
        points = np.concatenate([self.space.centre[None, :], self.space.drawn_back(state.warm)])
        trials = self._fly(points, stop)
        good = self.limit.keeps(trials.peak)
        if not good.any():
            rows = np.argsort(np.nan_to_num(trials.peak, nan=np.inf), kind="stable")[:1]
            eased = self._excess(trials)
            return replace(
                state,
                phase="ease",
                anchor_cost=float(trials.cost[rows[0]]),
                anchor_torque=float(trials.peak[rows[0]]),
                descent=first_descent(points[rows], eased.select(rows)),
            )
        return self._started(state, points[good], trials.select(good))

    def _ease(self, state: SearchState, stop: Stop | None) -> SearchState:
        """One step of descent on the torque above its limit; done, without a schedule, if it ends there."""
        before = state.descent
        assert before is not None  # noqa: S101 - the phase says so
        after = next_descent(
            before, self.space, TorqueLimit(None), lambda points: self._excess(self._fly(points, stop)), 1
        )
        if bool(self.limit.keeps(after.torque)[0]):
            return self._started(state, after.point, self._fly(after.point, stop))
        over = not after.active.any() or after.iteration >= EASE_ITERATIONS
        return replace(
            state, phase="done" if over else "ease", descent=after, anchor_torque=float(after.torque[0])
        )

    def _started(self, state: SearchState, points: Array, trials: Trials) -> SearchState:
        """After flights that keep all limits: what comes next, and from where."""
        best = int(np.argmin(trials.cost))
        phase: Phase = "swarm" if self.settings.method == "pso" else "screen"
        warm_starts = phase == "screen" and points.shape[0] > 1
        started = replace(
            state,
            phase="polish" if warm_starts else phase,
            best=points[best],
            best_cost=float(trials.cost[best]),
            best_torque=float(trials.peak[best]),
            anchor=points[0],
            anchor_cost=float(trials.cost[0]),
            anchor_torque=float(trials.peak[0]),
            descent=first_descent(points, trials) if warm_starts else None,
        )
        return started if self.space.dimension else replace(started, phase="done")

    def _screen(self, state: SearchState, stop: Stop | None) -> SearchState:
        """Fly schedules that wait and go, and random ones; choose the descent's starts among them."""
        rng = np.random.default_rng(self.settings.seed)
        space = self.space
        points = rng.uniform(space.lower, space.upper, (self.settings.screen, space.dimension))
        points[:, : space.inner].sort(axis=1)
        points[:, space.inner :].sort(axis=1)
        points = np.concatenate([space.waiting(), points])
        points, trials = self._kept(state, space.drawn_back(points), stop)
        order = np.argsort(trials.cost, kind="stable")[: self.settings.starts - 1]
        starts = np.concatenate([state.anchor[None, :], points[order]])
        flown = Trials.known(
            np.append(state.anchor_cost, trials.cost[order]),
            np.append(state.anchor_torque, trials.peak[order]),
        )
        found = self._bettered(state, points, trials)
        return replace(found, phase="polish", descent=first_descent(starts, flown))

    def _polish(self, state: SearchState, stop: Stop | None) -> SearchState:
        """One iteration of all starts still in the field."""
        before = state.descent
        assert before is not None  # noqa: S101 - the phase says so
        share = next((share for end, share in NARROWING if before.iteration < end), 0.0)
        keep = max(1, round(share * before.cost.size))
        after = next_descent(before, self.space, self.limit, lambda points: self._fly(points, stop), keep)
        over = after is before or after.iteration >= self.settings.iterations
        found = self._bettered(state, after.point, Trials.known(after.cost, after.torque))
        return replace(found, phase="done" if over else "polish", descent=after)

    def _generation(self, state: SearchState, stop: Stop | None) -> SearchState:
        """Fly one generation of the swarm and move it.

        A particle costs what its schedule costs once it is drawn back to the limits; it stays where it is.
        """
        space, settings = self.space, self.settings.swarm
        width = space.upper - space.lower
        swarm = state.swarm
        if swarm is None:
            swarm = first_swarm(settings, (state.anchor - space.lower) / width, self.settings.seed)
            # knots in order: else nearly all begin beside the centre, where their rays meet the limits
            for part in (slice(None, space.inner), slice(space.inner, None)):
                swarm.position[1:, part].sort(axis=1)
            swarm = replace(swarm, best_position=swarm.position.copy())
        points = space.drawn_back(space.lower + width * swarm.position)
        points, trials = self._kept(state, points, stop)
        moved = next_swarm(swarm, settings, trials.cost)
        found = self._bettered(state, points, trials)
        over = moved.generation >= settings.generations
        return replace(found, phase="done" if over else "swarm", swarm=moved)

    # flights

    def _fly(self, points: Array, stop: Stop | None) -> Trials:
        self._flown += points.shape[0]
        schedules = [self.space.schedule(point) for point in points]
        flown = self.flights.fly(schedules, torque=self.limit.most_nm is not None, stop=stop)
        errors = flown.errors(self.weights)
        peak = np.where(flown.diverged & (self.limit.most_nm is not None), np.nan, flown.peak_torque)
        return Trials(errors, flown.cost(self.weights), flown.torque, peak)

    def _kept(self, state: SearchState, points: Array, stop: Stop | None) -> tuple[Array, Trials]:
        """Fly points, drawn back to the anchor where their torque is too much."""
        count = points.shape[0]
        held = Trials.known(np.full(count, state.anchor_cost), np.full(count, state.anchor_torque))
        anchors = np.tile(state.anchor, (count, 1))
        return self.limit.kept(self.space, points, anchors, held, lambda x: self._fly(x, stop))

    def _excess(self, trials: Trials) -> Trials:
        """The same flights, with the torque above the target as errors."""
        most = self.limit.most_nm or 1.0
        errors = np.maximum(np.abs(trials.torque) / most - EASE_TARGET, 0.0)
        errors = np.where(np.isfinite(errors), errors, 1e3)
        cost = np.einsum("pm,pm->p", errors, errors)
        return Trials(errors, cost, np.zeros((cost.size, 0)), trials.peak)

    def _bettered(self, state: SearchState, points: Array, trials: Trials) -> SearchState:
        best = int(np.argmin(trials.cost))
        if not trials.cost[best] < state.best_cost:
            return state
        return replace(
            state,
            best=points[best],
            best_cost=float(trials.cost[best]),
            best_torque=float(trials.peak[best]),
        )


def search_share(state: SearchState, settings: ScheduleSearch) -> float:
    """How far a search has come, 0..1, as far as one can know."""
    if state.phase == "done":
        return 1.0
    if settings.method == "pso":
        return 0.0 if state.swarm is None else state.swarm.generation / settings.swarm.generations
    if state.phase == "polish" and state.descent is not None:
        return 0.2 + 0.75 * min(state.descent.iteration / min(USUAL_ITERATIONS, settings.iterations), 1.0)
    return 0.1 if state.phase == "screen" else 0.0
