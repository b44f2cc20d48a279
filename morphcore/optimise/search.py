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
from morphcore.optimise.ease import EaseState, next_ease
from morphcore.optimise.flights import MorphFlights
from morphcore.optimise.limits import HELD, MorphSpace
from morphcore.optimise.settings import ScheduleSearch
from morphcore.optimise.torque_limit import TorqueLimit, Trials
from morphcore.stopping import Stop
from morphcore.swarm import SwarmState, first_swarm, next_swarm
from morphdata.optimize import Weights

Array = NDArray[np.float64]
Phase = Literal["baseline", "ease", "screen", "swarm", "polish", "done"]

# the field of starts narrows as the descent goes on: iteration -> starts kept (as a share of the first field)
NARROWING = ((5, 1.0), (10, 0.5))
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
    ease: EaseState | None = field(default=None, repr=False)

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
        if good.any():
            return self._started(state, points[good], trials.select(good))
        more = self.space.drawn_back(self.space.waiting())
        flown = self._fly(more, stop)
        peaks = np.append(trials.peak, flown.peak)
        lowest = int(np.argmin(np.where(np.isfinite(peaks), peaks, np.inf)))
        point = np.concatenate([points, more])[lowest]
        cost = float(np.append(trials.cost, flown.cost)[lowest])
        eased = EaseState(point, float(peaks[lowest]))
        return self._eased(replace(state, phase="ease", ease=eased, anchor_cost=cost), eased, stop)

    def _ease(self, state: SearchState, stop: Stop | None) -> SearchState:
        """One step of lowering the torque; done, without a schedule, if it falls no further."""
        assert state.ease is not None  # noqa: S101 - the phase says so
        after = next_ease(state.ease, self.space, lambda points: self._fly(points, stop))
        return self._eased(state, after, stop)

    def _eased(self, state: SearchState, after: EaseState, stop: Stop | None) -> SearchState:
        """The search begins where the torque keeps its limit."""
        if bool(self.limit.keeps(np.array([after.peak]))[0]):
            points = after.point[None, :]
            return self._started(replace(state, ease=None), points, self._fly(points, stop))
        phase: Phase = "done" if after.over else "ease"
        return replace(state, phase=phase, ease=after, anchor_torque=after.peak)

    def _started(self, state: SearchState, points: Array, trials: Trials) -> SearchState:
        """After flights that keep all limits: what comes next, and from where."""
        best = int(np.argmin(trials.cost))
        phase: Phase = "swarm" if self.settings.method == "pso" else "screen"
        return replace(
            state,
            phase=phase,
            best=points[best],
            best_cost=float(trials.cost[best]),
            best_torque=float(trials.peak[best]),
            anchor=points[0],
            anchor_cost=float(trials.cost[0]),
            anchor_torque=float(trials.peak[0]),
            descent=first_descent(points, trials),
        )

    def _screen(self, state: SearchState, stop: Stop | None) -> SearchState:
        """Fly schedules that wait and go, and random ones; choose the descent's starts among them."""
        rng = np.random.default_rng(self.settings.seed)
        space = self.space
        points = rng.uniform(space.lower, space.upper, (self.settings.screen, space.dimension))
        points[:, : space.inner].sort(axis=1)
        points[:, space.inner :].sort(axis=1)
        points = self._gentle(state).drawn_back(np.concatenate([space.waiting(), points]))
        points, trials = self._kept(state, points, stop)
        order = np.argsort(trials.cost, kind="stable")[: self.settings.starts - 1]
        first = state.descent
        assert first is not None  # noqa: S101 - the phase says so
        starts = np.concatenate([first.point, points[order]])
        flown = Trials.known(
            np.append(first.cost, trials.cost[order]), np.append(first.torque, trials.peak[order])
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

    def _gentle(self, state: SearchState) -> MorphSpace:
        """The space with the acceleration that the torque limit allows a wing, going by the anchor's flight.

        What is drawn back to it hardly ever exceeds the torque, and need not give up its shape in flights.
        """
        space, limits = self.space, self.space.limits
        if self.limit.most_nm is None:
            return space
        share = self.limit.most_nm / state.anchor_torque
        most = share * float(space.peak_acceleration(state.anchor[None, :])[0])
        if limits.max_accel_rad_s2 is not None:
            most = min(most, limits.max_accel_rad_s2)
        gentle = replace(space, limits=limits.model_copy(update={"max_accel_rad_s2": most}))
        return gentle if gentle.room >= HELD else space

    def _kept(self, state: SearchState, points: Array, stop: Stop | None) -> tuple[Array, Trials]:
        """Fly points, drawn back to the anchor where their torque is too much."""
        count = points.shape[0]
        held = Trials.known(np.full(count, state.anchor_cost), np.full(count, state.anchor_torque))
        anchors = np.tile(state.anchor, (count, 1))
        return self.limit.kept(self.space, points, anchors, held, lambda x: self._fly(x, stop))

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
