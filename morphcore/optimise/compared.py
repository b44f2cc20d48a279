"""The compared schedules, and the results kept from their flights."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from morphcore.optimise.case import MorphCase
from morphcore.optimise.goals import Found, chosen
from morphcore.optimise.search import found_by
from morphcore.optimise.state import OptimisationState
from morphcore.shown import Shown
from morphcore.simulate.schedule import Schedule

Array = NDArray[np.float64]


@dataclass(frozen=True, repr=False)
class ComparedFlight(Shown):
    """One schedule flown in one model.

    departure : (k, 3) of phi, theta, psi from the start, rad. variation : its sum of squares, rad^2; None if
    the flight diverged. torque : largest torque of any hinge, N m; None where it was not computed.
    """

    departure: Array
    variation: float | None
    torque: float | None


def best_found(case: MorphCase, state: OptimisationState) -> Found:
    """Return the search whose schedule is the result, or its best so far."""
    found, task = state.found, state.task
    if task is not None and task.model == "equivalent" and state.search is not None:
        found = (*found, found_by(task, case.space(task.duration_s), state.search))
    return chosen(case.morph, found)


def compared_schedules(case: MorphCase, state: OptimisationState) -> dict[str, Schedule | None]:
    """Return the compared schedules in order, with None for those not found yet."""
    best = best_found(case, state)
    space = case.space(best.duration_s)
    rigid = next((item for item in state.found if item.model == "rigid"), None)
    return {
        "constant": case.constant(best.duration_s),
        "rigid_optimum": None if rigid is None or not rigid.feasible else space.schedule(rigid.point),
        "optimum": space.schedule(best.point),
    }
