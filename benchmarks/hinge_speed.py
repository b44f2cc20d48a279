"""Cost of the number of hinges: the same swarm on wings of one, two and three hinges, in turn.

A surface's hinges are composed once for all lanes, so they should not slow down the batch.
"""

from __future__ import annotations

import statistics
from dataclasses import replace

from benchmarks.setting import LINKS, Bench, Figures
from benchmarks.swarm import flown
from morphcore.geometry.aircraft import Aircraft
from morphcore.geometry.hinge import Hinge
from morphcore.geometry.surface import Surface
from morphcore.identify.cost import SampleCase
from morphcore.models.equivalent import ChainModel, ParameterBatch, chain_model
from morphcore.paper.computation import benchmark_swarm
from morphcore.simulate.plan import flight_plan
from morphcore.simulate.schedule import ConstantRate
from morphcore.simulate.time_grid import time_grid
from morphcore.simulate.trim import Trim, trim
from morphcore.threads import use_threads

NUMBERS = (1, 2, 3)
SAMPLE = "train_rate_0.5"
TURNS_RAD = (0.5, 0.2, -0.1)  # over the flight, of the hinges from the fuselage outward
OUTWARD_M = 0.1  # from one hinge to the next


def hinge_speed(bench: Bench) -> Figures:
    """Median time of a flight of the swarm, s, and its ratio to that on one hinge a wing."""
    use_threads(1)
    prepared = [_prepared(bench, number) for number in NUMBERS]
    times: dict[int, list[float]] = {number: [] for number in NUMBERS}
    for _ in range(bench.effort.rounds):
        for number, flight in zip(NUMBERS, prepared, strict=True):
            times[number].append(flown(bench.computing, *flight))
    medians = {number: statistics.median(each) for number, each in times.items()}
    return {
        "fly_s": {str(number): value for number, value in medians.items()},
        "ratio_to_one_hinge": {str(number): value / medians[1] for number, value in medians.items()},
    }


def _prepared(bench: Bench, number: int) -> tuple[ChainModel, ParameterBatch, SampleCase, Trim]:
    """Model, swarm, case and trim of one number of hinges."""
    aircraft = _on_hinges(bench.aircraft, number)
    model, sample = chain_model(aircraft, bench.flight, LINKS), bench.samples[SAMPLE]
    schedules = [
        ConstantRate(0.0, TURNS_RAD[place], sample.duration_s)
        for surface in aircraft.surfaces
        for place in range(len(surface.hinges))
    ]
    case = SampleCase(sample, flight_plan(model, schedules, time_grid(sample.time_s), may_halve=True))
    swarm = benchmark_swarm(model, bench.effort.particles)
    return model, swarm, case, trim(case.plan.flown(model), swarm, case.plan)


def _on_hinges(aircraft: Aircraft, number: int) -> Aircraft:
    return replace(aircraft, surfaces=tuple(_hinged(surface, number) for surface in aircraft.surfaces))


def _hinged(surface: Surface, number: int) -> Surface:
    first, side = surface.hinges[0], surface.span_sign
    x, y, z = first.position_m
    added: list[Hinge] = [
        replace(
            first,
            drive=f"added_{place}_{surface.side}",
            position_m=(x, y + side * OUTWARD_M * place, z),
            axis_B=(-0.6 * side, 0.0, 0.8 * side),
        )
        for place in range(1, number)
    ]
    return replace(surface, hinges=(first, *added))
