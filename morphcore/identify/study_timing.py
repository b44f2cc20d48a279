"""Wall time of one flight of each model of a study: one at a time, on one thread, the models in turn.

What is timed is what a caller waits for once the lattice along the morph is tabulated: trim and flight. The
table is the same for all models and timed on its own.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from morphcore.geometry.aircraft import Aircraft
from morphcore.identify.cost import SampleCase, fly_attitudes, sample_cases, shared_trims
from morphcore.models.equivalent import ChainModel, ParameterBatch
from morphcore.simulate.hinge_schedules import followed_flight
from morphcore.simulate.trajectory import Trajectory
from morphcore.simulate.trim import StartMode
from morphcore.stopping import Stop, check_stop

Clock = Callable[[], float]
Flyable = tuple[ChainModel, ParameterBatch]

FLIGHT_S = 2.0  # duration of the flight that is timed, as of the paper's morph
OUTPUT_STEP_S = 0.01
ROUNDS = 7  # of which medians are taken


def timed_flight(aircraft: Aircraft, samples: Sequence[Trajectory]) -> Trajectory:
    """A flight of two seconds along the measured drives that move most in their first two seconds.

    A shorter sample is held where it ends. The attitudes are not looked at.
    """
    times = OUTPUT_STEP_S * np.arange(round(FLIGHT_S / OUTPUT_STEP_S) + 1, dtype=np.float64)
    rest = np.zeros_like(times)
    flights = []
    for sample in samples:
        start_s = sample.time_s[0]
        drives = {
            name: schedule.motion(start_s + times).angle
            for name, (_, schedule) in followed_flight(aircraft, sample).items()
        }
        flights.append(Trajectory("timed", times, drives, rest, rest, rest))
    return max(flights, key=_travel)


def _travel(flight: Trajectory) -> float:
    return float(sum(np.abs(np.diff(values)).sum() for values in flight.drives.values()))


@dataclass(frozen=True)
class FlightTiming:
    """The flight with each model's step, and the models that fly it in turn.

    plan_s : wall time of a plan, s.
    """

    cases: tuple[SampleCase, ...]
    models: tuple[Flyable | None, ...]
    start: StartMode
    clock: Clock
    plan_s: float

    def round(self, stop: Stop | None = None) -> tuple[float | None, ...]:
        """Fly every model once; give the wall times, s, None where there is no model.

        A single flight is a single block of lanes: it never uses more than one thread.
        """
        return tuple(
            None if flown is None else self._fly(case, *flown, stop)
            for case, flown in zip(self.cases, self.models, strict=True)
        )

    def _fly(self, case: SampleCase, model: ChainModel, batch: ParameterBatch, stop: Stop | None) -> float:
        check_stop(stop)
        begin = self.clock()
        ((_, found),) = shared_trims(model, batch, (case,), self.start)
        fly_attitudes(model, batch, case, found)
        return self.clock() - begin


def flight_timing(
    models: Sequence[Flyable | None],
    samples: Sequence[Trajectory],
    *,
    steps_s: Sequence[float],
    start: StartMode,
    clock: Clock = time.perf_counter,
) -> FlightTiming:
    """Plan the flight and fly every model once: nothing is compiled or loaded while time is taken.

    models : the first is the rigid one; None stands for a size of which none flies. steps_s : each model's.
    """
    first = next(flown for flown in models if flown is not None)[0]
    flight = timed_flight(first.aircraft, samples)
    # a plan knows the lattice and the hinges, not the links: all models of one step fly the same one
    cases = {
        step_s: sample_cases(first, [flight], step_s, start=start)[0] for step_s in dict.fromkeys(steps_s)
    }
    timing = FlightTiming(tuple(cases[step_s] for step_s in steps_s), tuple(models), start, clock, 0.0)
    timing.round()
    begin = clock()
    sample_cases(first, [flight], steps_s[0], start=start)
    return replace(timing, plan_s=clock() - begin)


def medians(rounds: Sequence[Sequence[float | None]]) -> list[float | None]:
    """Median over the rounds of each model's wall time, s; None where there is no model."""
    timed = [[time_s for time_s in times if time_s is not None] for times in zip(*rounds, strict=True)]
    return [statistics.median(times) if times else None for times in timed]
