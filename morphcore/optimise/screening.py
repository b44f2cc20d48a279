"""The default search for schedules: random candidates, then descents from the best of them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from morphcore.optimise.descent import DescentState, ScheduleDescent
from morphcore.optimise.limits import HELD, MorphSpace
from morphcore.optimise.problem import MorphProblem
from morphcore.optimise.settings import ScheduleSettings
from morphcore.optimise.torque_limit import Trials
from morphcore.search.checkpoint import stored
from morphcore.search.solver import Batch, Solver

Array = NDArray[np.float64]


@stored
@dataclass(frozen=True)
class ScreenedState:
    """The schedules known beforehand, and the descents once they have started."""

    known: Trials
    descent: DescentState | None = None


class ScreenedDescent(Solver[ScreenedState, Trials]):
    """Descents from the known schedules and from the best of ``settings.screen`` random ones."""

    def __init__(self, problem: MorphProblem, settings: ScheduleSettings) -> None:
        self._problem, self._settings = problem, settings
        self._descent = ScheduleDescent(problem.space, problem.limit, settings.iterations)

    def init(self, known: Trials) -> ScreenedState:
        """Start with the candidates."""
        return ScreenedState(known)

    def ask(self, state: ScreenedState) -> Batch:
        """Return wait-then-move and random schedules first, then the batches of the descents."""
        if state.descent is not None:
            return self._descent.ask(state.descent)
        rng, space = np.random.default_rng(self._settings.seed), self._problem.space
        drawn = rng.uniform(space.lower, space.upper, (self._settings.screen, space.dimension))
        points = np.concatenate([space.waiting(), self._problem.arranged(drawn)])
        return self._problem.anchored(self._gentle(state.known).drawn_back(points), state.known)

    def tell(self, state: ScreenedState, outcome: Trials) -> ScreenedState:
        """Choose the starts of the descents, or continue the descents."""
        if state.descent is not None:
            return replace(state, descent=self._descent.tell(state.descent, outcome))
        chosen = np.argsort(outcome.cost, kind="stable")[: self._settings.starts - 1]
        starts = Trials.known(
            np.concatenate([state.known.points, outcome.points[chosen]]),
            np.append(state.known.cost, outcome.cost[chosen]),
            np.append(state.known.peak, outcome.peak[chosen]),
        )
        return replace(state, descent=self._descent.init(starts))

    def done(self, state: ScreenedState) -> bool:
        """Return whether the descents are over."""
        return state.descent is not None and self._descent.done(state.descent)

    def best(self, state: ScreenedState, outcome: Trials) -> tuple[Array, float]:
        """Return the best schedule of the screening, or of the descents."""
        descent = state.descent
        if descent is None or (descent.iteration == 0 and descent.tried is None):
            return super().best(state, outcome)
        return self._descent.best(descent, outcome)

    def between_steps(self, state: ScreenedState) -> bool:
        """Return whether the screening, or an iteration of the descents, has ended."""
        return state.descent is None or self._descent.between_steps(state.descent)

    def phase(self, state: ScreenedState) -> str:
        """Return the name of the candidate screening or of the descents, as in the history of a result."""
        return "screen" if state.descent is None else self._descent.phase(state.descent)

    def share(self, state: ScreenedState) -> float:
        """Return a tenth before the candidates are flown, a fifth before the descents start."""
        return 0.1 if state.descent is None else 0.2 + 0.75 * self._descent.share(state.descent)

    def _gentle(self, known: Trials) -> MorphSpace:
        """The space with the acceleration that the torque limit allows a wing, judged by the anchor's flight.

        Schedules drawn back into it hardly ever exceed the torque limit and so rarely lose their shape later.
        """
        space, limits = self._problem.space, self._problem.space.limits
        if limits.max_hinge_torque_nm is None:
            return space
        share = limits.max_hinge_torque_nm / known.peak[0]
        maximum = share * float(space.peak_acceleration(known.points[:1])[0])
        if limits.max_accel_rad_s2 is not None:
            maximum = min(maximum, limits.max_accel_rad_s2)
        gentle = replace(space, limits=limits.model_copy(update={"max_accel_rad_s2": maximum}))
        return gentle if gentle.room >= HELD else space
