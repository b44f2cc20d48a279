"""The stages of the optimised morph (Table 3, figures 10 and 11), and those that go beyond the paper.

"morph" is our search and is verified by the optimisation itself; "swarm_morph" is the paper's swarm of 50;
"free_morph" also searches the angles; "unsettled_morph" omits the settling window, as the paper does;
"fastest_morph" is the quickest that moves the attitude no more than the constant rate does; "front" trades
duration against variation. "flown_morphs" flies the results of these in the flexible model. Whenever
durations differ, attitudes are compared over the same `WINDOW_S`: a window that ended sooner for a quicker
morph would make every quick morph look calm.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from morphcore.frames import wrap_angle
from morphcore.models.parameters_document import parameters_from_document
from morphcore.optimise import ScheduleOptimisation
from morphcore.optimise.settings import PAPER_PARTICLES, ScheduleSettings
from morphcore.paper.identification import searched
from morphcore.paper.scenario import (
    FINAL_RAD,
    KNOTS,
    MORPH_S,
    RATE_LIMIT_RAD_S,
    SETTLE_S,
    PaperFlight,
    aircraft,
    flight,
)
from morphcore.paper.settings import PaperSettings
from morphcore.paper.stages import Progress, Results, Work, part
from morphcore.paper.truth import Resolution, flown_flexible
from morphcore.search.swarm import SwarmSettings
from morphcore.simulate.schedule import Spline
from morphdata.measurement import ANGLES
from morphdata.optimize import Limits, Morph, VerifyingModel

Array = NDArray[np.float64]
Document = dict[str, Any]

MORPH = Morph(final_rad=FINAL_RAD, duration_s=MORPH_S, knots=KNOTS, settle_s=SETTLE_S)
FREE_MORPH = MORPH.model_copy(update={"free_values": True})
UNSETTLED_MORPH = MORPH.model_copy(update={"settle_s": 0.0})
FASTEST_MORPH = MORPH.model_copy(update={"goal": "minimum_time"})  # under a limit found on the way
LIMITS = Limits(max_rate_rad_s=RATE_LIMIT_RAD_S)
WINDOW_S = MORPH_S + SETTLE_S  # s from the start of a morph over which attitudes count
OTHER_SEARCHES = ("swarm_morph", "free_morph", "unsettled_morph", "fastest_morph")
CHECK_POINTS = 20_001  # points at which an optimised schedule's rate is checked
SAMPLE_S = 0.01  # s between the rows whose squares make up the variation

Search = Callable[[PaperSettings], ScheduleSettings]


def our_search(settings: PaperSettings) -> ScheduleSettings:
    """Descent from several schedules."""
    return ScheduleSettings(seed=settings.seed)


def paper_search(settings: PaperSettings) -> ScheduleSettings:
    """The paper's swarm, for as many generations as time allows."""
    swarm = SwarmSettings(particles=PAPER_PARTICLES, generations=settings.effort.schedule_generations)
    return ScheduleSettings(method="pso", seed=settings.seed, swarm=swarm)


def optimise_morph(settings: PaperSettings, results: Results, checkpoint: bytes | None) -> Work:
    """Our search, its optimum, the rigid model's and the constant rate all flown in the flexible model."""
    run = _optimisation(settings, results, MORPH, our_search(settings), verify=True)
    last = yield from searched(run, checkpoint)
    found = run.result(last)
    document = found.to_document()
    return document | {
        "curves": found.curves(),
        "checked": {**_checked(found.schedule), "found_s": document["search"]["search_s"]},
    }


def search_morph(
    morph: Morph, search: Search, settings: PaperSettings, results: Results, checkpoint: bytes | None
) -> Work:
    """A search only; "flown_morphs" flies its result."""
    run = _optimisation(settings, results, morph, search(settings), verify=False)
    last = yield from searched(run, checkpoint)
    return run.result(last).to_document()


def search_fastest(settings: PaperSettings, results: Results, checkpoint: bytes | None) -> Work:
    """The shortest morph whose variation does not exceed that of the constant rate in two seconds."""
    maximum = results["morph"]["variation"]["constant"]["equivalent"]
    morph = FASTEST_MORPH.model_copy(update={"max_variation_rad2": maximum})
    return (yield from search_morph(morph, our_search, settings, results, checkpoint))


def search_front(settings: PaperSettings, results: Results, checkpoint: bytes | None) -> Work:
    """The minimum variation over the same window for morphs of several durations, each then settling."""
    points: list[Document] = [] if checkpoint is None else json.loads(checkpoint)
    durations = settings.effort.front_durations_s
    for duration_s in durations[len(points) :]:
        times = {"duration_s": duration_s, "settle_s": WINDOW_S - duration_s}
        morph = MORPH.model_copy(update=times)
        search = search_morph(morph, our_search, settings, results, None)
        found = yield from part(search, len(points) / len(durations), 1.0 / len(durations))
        points.append(
            {
                "duration_s": duration_s,
                "schedule": found["schedules"]["optimum"],
                "optimum_rad2": found["variation"]["optimum"]["equivalent"],
                "constant_rad2": found["variation"]["constant"]["equivalent"],
            }
        )
        yield Progress(len(points) / len(durations), "", json.dumps(points).encode())
    return {"window_s": WINDOW_S, "points": points}


def fly_morphs(settings: PaperSettings, results: Results, _checkpoint: bytes | None) -> Work:
    """Fly the schedules of the other searches in the flexible model over the window."""
    waiting = _found_schedules(results)
    used = Resolution("flexible", settings.elements, settings.effort.flexible_step_s, settings.lattice)
    rows: list[Document] = []
    for number, (name, duration_s, schedule) in enumerate(waiting):
        each = PaperFlight(name, name.replace("_", " "), "held_out", schedule, WINDOW_S)
        simulation = yield from flown_flexible(each, used, number / len(waiting), 1.0 / len(waiting))
        euler = simulation.trajectory.euler
        departure = wrap_angle(euler - euler[:1])
        rows.append(
            {
                "name": name,
                "duration_s": duration_s,
                "schedule": schedule,
                "variation_rad2": variation_until(departure, WINDOW_S),
                "variation_of_morph_rad2": variation_until(departure, duration_s),
            }
        )
    return {"window_s": WINDOW_S, "flown": rows}


def variation_until(departure: Array, end_s: float) -> float:
    """Sum of squares (rad^2) of departures (k, 3), SAMPLE_S apart, up to a time."""
    return float(np.sum(departure[: round(end_s / SAMPLE_S) + 1] ** 2))


def departures(curves: Document, model: str, schedule: str) -> Array:
    """(k, 3) departures of one flight in an optimisation's curves, rad."""
    flown = curves["flights"][model][schedule]
    return np.stack([np.array(flown[f"{angle}_rad"]) for angle in ANGLES], axis=1)


def _optimisation(
    settings: PaperSettings, results: Results, morph: Morph, search: ScheduleSettings, *, verify: bool
) -> ScheduleOptimisation:
    return ScheduleOptimisation(
        aircraft(),
        flight(),
        parameters_from_document(results["identification"]["model"]),
        morph=morph,
        limits=LIMITS,
        search=search,
        verify="flexible" if verify else "none",
        flexible=VerifyingModel(elements=settings.elements),
        lattice=settings.lattice,
    )


def _checked(schedule: Spline) -> Document:
    """Rates of the schedule as a drive would see them: sampled, not from the search's own formulas."""
    times = np.linspace(schedule.knot_time_s[0], schedule.knot_time_s[-1], CHECK_POINTS)
    rate = schedule.motion(times).rate
    return {"max_rate_rad_s": float(rate.max()), "min_rate_rad_s": float(rate.min())}


def _found_schedules(results: Results) -> list[tuple[str, float, Document]]:
    """Name, duration and schedule of the other searches' results."""
    found = [
        (name, float(results[name]["duration_s"]), results[name]["schedules"]["optimum"])
        for name in OTHER_SEARCHES
        if name in results
    ]
    points = results["front"]["points"]
    return found + [
        (f"front_{point['duration_s']:.2f}_s", point["duration_s"], point["schedule"]) for point in points
    ]


swarm_morph = partial(search_morph, MORPH, paper_search)
free_morph = partial(search_morph, FREE_MORPH, our_search)
unsettled_morph = partial(search_morph, UNSETTLED_MORPH, our_search)
