"""Warnings about an optimised morph: failed flights, and results outside the method's validity."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from morphcore.optimise.case import MorphCase
from morphcore.optimise.compared import ComparedFlight
from morphcore.optimise.state import OptimisationState
from morphcore.simulate.common_path import path_angles, path_controls
from morphcore.simulate.schedule import Schedule
from morphcore.validity import (
    ResultWarning,
    air_warnings,
    bending_warnings,
    deflection_warnings,
    documents,
    light_wing_warnings,
    overlap_warnings,
    wake_warnings,
)

SHAPES = 9  # angles between the path's ends at which overlaps are checked
Flights = Mapping[str, Mapping[str, ComparedFlight | None]]


def schedule_warnings(
    case: MorphCase,
    state: OptimisationState,
    schedules: Mapping[str, Schedule | None],
    flights: Flights,
) -> tuple[dict[str, Any], ...]:
    """Return the warnings of the compared schedules as documents, including those of flexible flights."""
    found = _lost(case, flights)
    optimum = schedules["optimum"]
    flown = flights["equivalent"]["optimum"]
    if optimum is not None and flown is not None and flown.variation is not None:
        bench = case.flights("equivalent")
        motion = bench.motion(optimum)
        found += bending_warnings(
            bench.model.aircraft, bench.bending, "the trim", "/model", case.lattice.shape
        )
        first = path_angles(case.aircraft, case.drives, np.array([case.morph.begin]))[0]
        found += wake_warnings(
            case.aircraft, first, bench.alpha_rad, "/aircraft/surfaces", case.flight.sideslip_rad
        )
        found += air_warnings(case.flight, [("the optimum in the equivalent model", "/morph", motion)])
    found += light_wing_warnings(case.aircraft, case.flight)
    path = np.linspace(case.path.low_rad, case.path.high_rad, SHAPES)
    angles = path_angles(case.aircraft, case.drives, path)
    found += overlap_warnings(case.aircraft, angles)
    controls = path_controls(case.aircraft, case.drives, path)
    found += deflection_warnings(case.aircraft, np.concatenate([angles, controls], axis=1))
    verified: list[dict[str, Any]] = []
    for item in state.verified:
        name = item.schedule.replace("_", " ")
        if item.failure:
            found.append(
                ResultWarning(
                    "verification_failed",
                    f"the {name} was not flown in the flexible model: {item.failure}",
                    "the figures of the rigid and the equivalent model are not verified",
                    "/flexible",
                )
            )
        if item.schedule == "optimum":
            verified += [
                {**warning, "message": f"in the flexible model, {warning['message']}"}
                for warning in item.warnings
                if warning["code"] in ("large_alpha", "steep_pitch")
            ]
    return (*documents(found), *verified)


def _lost(case: MorphCase, flights: Flights) -> list[ResultWarning]:
    """Flights that left their model's domain; if the optimum is one of them, there is no answer."""
    found = []
    for model, compared in flights.items():
        for name, flight in compared.items():
            if flight is None or flight.variation is not None:
                continue
            if (model, name) == ("equivalent", "optimum"):
                error = case.not_flyable()
                found.append(ResultWarning(error.code, error.message, error.hint, error.pointer))
            else:
                found.append(
                    ResultWarning(
                        "diverged",
                        f"the {name.replace('_', ' ')} diverged in the {model} model: no variation there",
                        "compare with the other models, or choose a slower morph",
                        "/morph",
                    )
                )
    return found
