"""The stage "computation" (Table 2): cost of one flight in each model, on one core, one at a time.

The models take turns, flight by flight, so that a slowdown of the machine affects all of them; medians are
kept. The comparison uses the processor time of the flight's thread, which other programs on the machine
hardly change; the wall time is reported as well. ``flight_steps`` of any model reports once before the flight
starts: the time before is called preparation (trim, and the lattice along the morph or its first one), the
time after it flight.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from morphcore.identify.cost import fly_attitudes, sample_cases, shared_trims
from morphcore.models.equivalent import ChainModel, ParameterBatch, chain_model, physical_guess
from morphcore.models.parameters_document import parameters_from_document
from morphcore.paper.scenario import LINKS, PaperFlight, aircraft, flight, paper_flights, two_second_flight
from morphcore.paper.settings import PaperSettings
from morphcore.paper.stages import Progress, Results, Work
from morphcore.simulate.flexible import FLEXIBLE_STEP_S
from morphcore.simulate.flight import ModelChoice, flight_steps
from morphcore.simulate.time_grid import STEP_S
from morphcore.simulate.trajectory import Trajectory
from morphcore.threads import one_blas_thread, thread_count, use_threads

Document = dict[str, Any]

BATCH_ROUNDS = 3
TIMES = ("prepare_s", "fly_s", "total_s", "wall_s")
SWARM_SEED = 1
# spread of the benchmark's swarm around the physical guess: that of an identification's candidates
STIFFNESS_SPREAD = 0.3  # standard deviation of the logarithm
DIVISION_CONCENTRATION = 20.0  # of the Dirichlet distribution of the links' shares


def benchmark_swarm(model: ChainModel, particles: int, seed: int = SWARM_SEED) -> ParameterBatch:
    """Parameter sets around the physical guess, like those of a search."""
    rng = np.random.default_rng(seed)
    n = model.links_per_wing
    division = rng.dirichlet(np.full(n, DIVISION_CONCENTRATION), (particles, 1))
    batch = physical_guess(model, division)
    stiffness = batch["stiffness_nm_rad"]
    factor = np.exp(rng.normal(0.0, STIFFNESS_SPREAD, stiffness.shape))
    return batch.changed(stiffness_nm_rad=stiffness * factor)


def time_models(settings: PaperSettings, results: Results, _checkpoint: bytes | None) -> Work:
    """Time every model on every flight, then the equivalent one in a batch."""
    identified = parameters_from_document(results["identification"]["model"])
    rounds = settings.effort.timing_rounds
    flights = (two_second_flight(), *(paper_flights() if settings.effort.all_flights_timed else ()))
    models: dict[str, ModelChoice] = {"rigid": "rigid", "equivalent": identified, "flexible": "flexible"}
    rows: list[Document] = []
    trajectory: Trajectory | None = None
    with _one_core():
        for number, each in enumerate(flights):
            taken: dict[str, list[Document]] = {name: [] for name in models}
            for turn in range(rounds + 1):  # the first turn loads and compiles, and is not counted
                for name, model in models.items():
                    share = (number + turn / (rounds + 1)) / (1 + len(flights))
                    yield Progress(share, f"{each.label}, {name} model, turn {turn} of {rounds}")
                    times, flown = _timed(settings, each, model)
                    taken[name].append(times)
                    trajectory = flown if trajectory is None else trajectory
            rows.append(_row(each, taken))
        yield Progress(len(flights) / (1 + len(flights)), "equivalent models in a batch")
        batch = _timed_batch(settings, trajectory)
    return {"flights": rows, "batch": batch, "links_per_wing": LINKS}


def _timed(
    settings: PaperSettings, each: PaperFlight, model: ModelChoice
) -> tuple[dict[str, float], Trajectory]:
    """Processor time of one flight, by part, and its wall time, s."""
    schedules = each.schedules()
    wall, begin = time.perf_counter(), time.thread_time()
    steps = flight_steps(
        aircraft(), flight(), schedules, model=model, duration_s=each.duration_s,
        lattice=settings.lattice, elements=settings.elements,
        step_s=FLEXIBLE_STEP_S if model == "flexible" else STEP_S,  # known, so that no step has to be chosen
    )  # fmt: skip
    next(steps)
    ready = time.thread_time()
    *_, last = steps
    end = time.thread_time()
    assert last.simulation is not None  # noqa: S101 - a flight ends with its simulation
    times = {
        "prepare_s": ready - begin,
        "fly_s": end - ready,
        "total_s": end - begin,
        "wall_s": time.perf_counter() - wall,
    }
    return times, last.simulation.trajectory


def _row(each: PaperFlight, taken: dict[str, list[Document]]) -> Document:
    """Medians over the turns without the first, and their spread."""
    medians = {
        name: {part: statistics.median(turn[part] for turn in turns[1:]) for part in TIMES}
        for name, turns in taken.items()
    }
    spread = {
        name: max(turn["total_s"] for turn in turns[1:]) / min(turn["total_s"] for turn in turns[1:])
        for name, turns in taken.items()
    }
    return {
        "flight": each.name,
        "label": each.label,
        "duration_s": each.duration_s,
        "models": medians,
        "slowest_over_fastest": spread,
    }


def _timed_batch(settings: PaperSettings, trajectory: Trajectory | None) -> Document:
    """Cost of one flight in a batch, including lattice and trims, on one core."""
    assert trajectory is not None  # noqa: S101 - flights were timed before
    model = chain_model(aircraft(), flight(), LINKS, settings.lattice)
    swarm = benchmark_swarm(model, settings.effort.batch)
    taken: dict[str, list[float]] = {"prepare_s": [], "fly_s": []}
    for _ in range(BATCH_ROUNDS):
        begin = time.thread_time()
        cases = sample_cases(model, [trajectory])
        ((case, found),) = shared_trims(model, swarm, cases, "trim")
        ready = time.thread_time()
        fly_attitudes(model, swarm, case, found)
        taken["prepare_s"].append(ready - begin)
        taken["fly_s"].append(time.thread_time() - ready)
    prepare_s, fly_s = (statistics.median(taken[part]) for part in ("prepare_s", "fly_s"))
    return {
        "parameter_sets": swarm.particles,
        "rounds": BATCH_ROUNDS,
        "prepare_s": prepare_s,
        "fly_s": fly_s,
        "flight_s": (prepare_s + fly_s) / swarm.particles,
    }


@contextmanager
def _one_core() -> Iterator[None]:
    """Use one kernel thread and one BLAS thread inside the block."""
    before = thread_count()
    use_threads(1)
    try:
        with one_blas_thread():
            yield
    finally:
        use_threads(before)
