"""What every figure is measured with: the reference aircraft and flights, clocks, and how long to measure."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from morphcore.geometry.aircraft import Aircraft, Flight
from morphcore.identify.cost import SampleCase, sample_cases
from morphcore.models.equivalent import ChainModel
from morphcore.simulate.time_grid import STEP_S
from morphcore.simulate.trajectory import Trajectory, load_trajectory
from morphcore.stopping import check_stop
from morphcore.threads import thread_count
from morphdata.aircraft import load_aircraft
from morphdata.flight import load_flight

Array = NDArray[np.float64]
Figures = dict[str, Any]
Clock = Callable[[], float]

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
RATE_SAMPLES = ("train_rate_0.2", "train_rate_0.5", "train_rate_0.8")
ACCURACY_SAMPLES = (*RATE_SAMPLES, "train_asymmetric")
LINKS = 3


@dataclass(frozen=True)
class Effort:
    """How long to measure.

    particles : parameter sets of the swarm. rounds : interleaved repetitions, of which medians are taken.
    singles : repetitions of single flights. links : numbers of links whose cost is compared.
    refinement : how many times finer the reference of the step error is. seeds : of each search.
    """

    particles: int
    rounds: int
    singles: int
    links: tuple[int, ...]
    refinement: int
    seeds: int = 10


FULL = Effort(particles=2500, rounds=3, singles=15, links=(1, 2, 3, 4, 5, 6, 7, 8), refinement=50)
QUICK = Effort(particles=480, rounds=2, singles=5, links=(1, 3, 5), refinement=10, seeds=1)


@dataclass(frozen=True)
class Bench:
    """The reference aircraft and flights, and the clocks.

    folder : where they were read. clock : rising seconds of the wall. computing : seconds that this thread
    has computed, which other processes on the machine do not lengthen; what runs on one thread is measured
    by it.
    """

    aircraft: Aircraft
    flight: Flight
    samples: Mapping[str, Trajectory]
    folder: Path
    effort: Effort
    threads: int
    clock: Clock = time.perf_counter
    computing: Clock = time.thread_time

    def cases(
        self, model: ChainModel, names: Sequence[str], step_s: float = STEP_S
    ) -> tuple[SampleCase, ...]:
        """Plans of some samples."""
        return sample_cases(model, [self.samples[name] for name in names], step_s)

    def timed(self, work: Callable[[], object]) -> float:
        """Computing time of some work on this thread, s."""
        check_stop()
        begin = self.computing()
        work()
        return self.computing() - begin


def bench_of(
    effort: Effort,
    samples_dir: str | Path | None = None,
    *,
    clock: Clock = time.perf_counter,
    computing: Clock = time.thread_time,
) -> Bench:
    """Load the reference aircraft and flights from a folder; None: the examples of this checkout.

    Raises
    ------
    InvalidInput : they are not there.
    """
    folder = EXAMPLES if samples_dir is None else Path(samples_dir)
    return Bench(
        aircraft=Aircraft.of(load_aircraft(folder / "aircraft.json")),
        flight=Flight.of(load_flight(folder / "flight.json")),
        samples={name: load_trajectory(folder / f"{name}.csv") for name in ACCURACY_SAMPLES},
        folder=folder,
        effort=effort,
        threads=thread_count(),
        clock=clock,
        computing=computing,
    )
