"""All benchmarks in one run."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Mapping
from pathlib import Path

from benchmarks.accuracy import lattice_cost, step_error
from benchmarks.against_mujoco import against_mujoco
from benchmarks.batch_speed import batch_speed
from benchmarks.growth import growth_with_links
from benchmarks.hinge_speed import hinge_speed
from benchmarks.kernel_alone import kernel_alone
from benchmarks.machine import machine
from benchmarks.memory import swarm_memory
from benchmarks.operations import operations, structural_growth
from benchmarks.requirements import judged
from benchmarks.search import search_benchmark
from benchmarks.setting import FULL, LINKS, QUICK, RATE_SAMPLES, Bench, Clock, Effort, Figures, bench_of
from benchmarks.single_flights import flexible_flight, single_flights
from benchmarks.start_up import cold_compilation, first_generation, import_times
from benchmarks.work_precision import quick_work_precision
from morphcore.errors import InvalidInput
from morphcore.simulate.time_grid import STEP_S
from morphcore.stopping import check_stop
from morphcore.threads import use_threads
from morphcore.warming import warm_up

WORK_PRECISION_SAMPLES = ("train_rate_0.8", "train_asymmetric")  # both wings alike, and not

Section = Callable[[Bench], Figures]


def work_precision_of(bench: Bench) -> Figures:
    """The shipped stepper and the one before it, on a symmetric and an asymmetric flight."""
    samples = [bench.samples[name] for name in WORK_PRECISION_SAMPLES]
    return quick_work_precision(bench.aircraft, bench.flight, samples)


def _counted(bench: Bench) -> Figures:
    found = operations(bench)
    return {"operations": found, "structural_growth": structural_growth(found)}


# in this order; each gives entries of the figures
SECTIONS: Mapping[str, Section] = {
    "batch": batch_speed,
    "hinges": lambda bench: {"hinges": hinge_speed(bench)},
    "kernel": lambda bench: {"kernel": kernel_alone(bench)},
    "single_flight": lambda bench: {"single_flight": single_flights(bench)},
    "flexible": lambda bench: {"flexible": flexible_flight(bench)},
    "growth_with_links": lambda bench: {"growth_with_links": growth_with_links(bench)},
    "operations": _counted,
    "search": lambda bench: {"search": search_benchmark(bench)},
    "mujoco": lambda bench: {"mujoco": against_mujoco(bench)},
    "work_precision": lambda bench: {"work_precision": work_precision_of(bench)},
    "step_error": lambda bench: {"step_error": step_error(bench)},
    "lattice": lambda bench: {"lattice": lattice_cost(bench)},
    "memory": lambda bench: {"memory": swarm_memory(bench.folder, bench.effort.particles)},
    "start_up": lambda bench: {"start_up": {**first_generation(bench.folder), "import": import_times()}},
    "compilation": lambda _: {"compilation": cold_compilation()},
}
SLOW_SECTIONS = frozenset({"flexible", "work_precision", "compilation"})  # omitted from a quick run


def run_benchmarks(
    quick: bool = False,  # noqa: FBT001, FBT002 - the command line's own flag
    *,
    samples_dir: str | Path | None = None,
    effort: Effort | None = None,
    sections: Collection[str] | None = None,
    clock: Clock = time.perf_counter,
    computing: Clock = time.thread_time,
) -> Figures:
    """Measure this machine.

    Parameters
    ----------
    quick : fewer parameter sets and repetitions, no slow sections: a minute or two instead of several, and
        figures good to a tenth.
    samples_dir : folder with aircraft.json, flight.json and the example flights; None: the source tree's.
    effort : measure that long instead. sections : names out of SECTIONS; None: all (when quick, the fast
        ones). clock : rising seconds of the wall. computing : seconds that this thread has computed.

    Returns
    -------
    JSON-able figures: machine, settings, what the sections found, and requirements. Times are in s;
    real-time factors are simulated seconds of all flights over seconds that one core computes.

    Raises
    ------
    InvalidInput : the example flights are not there, or there is no such section.
    Interrupted : the surrounding `stoppable` block requests a stop.
    """
    chosen = (
        tuple(s for s in SECTIONS if not (quick and s in SLOW_SECTIONS)) if sections is None else sections
    )
    unknown = sorted(set(chosen) - set(SECTIONS))
    if unknown:
        raise InvalidInput(
            f"there is no benchmark {unknown[0]!r}",
            pointer="/sections",
            hint=f"choose from {', '.join(SECTIONS)}",
        )
    bench = bench_of(effort or (QUICK if quick else FULL), samples_dir, clock=clock, computing=computing)
    try:
        use_threads(1)
        begin = bench.clock()
        warm_up()
        figures: Figures = {
            "machine": {**machine(), "threads": bench.threads, "warm_up_s": bench.clock() - begin},
            "settings": {
                "quick": quick,
                "step_s": STEP_S,
                "links_per_wing": LINKS,
                "particles": bench.effort.particles,
                "flight_s": sum(bench.samples[name].duration_s for name in RATE_SAMPLES),
            },
        }
        for name, section in SECTIONS.items():
            if name in chosen:
                check_stop()
                figures |= section(bench)
        return {**figures, "requirements": judged(figures)}
    finally:
        use_threads(bench.threads)
