"""Benchmarks of this machine: cost of a swarm, of one flight, of the lattice; error of the shipped step."""

from __future__ import annotations

import os
import platform
import statistics
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from morphcore.aero.operator import lattice_operator
from morphcore.errors import InvalidInput
from morphcore.geometry.aircraft import Aircraft, Flight, load_aircraft, load_flight
from morphcore.identify.cost import SampleCase, fly_attitudes, sample_cases, shared_trims
from morphcore.lanes import TOGETHER
from morphcore.models.equivalent import (
    ChainModel,
    ParameterBatch,
    chain_model,
    lane_constants,
    physical_guess,
)
from morphcore.simulate.batch import fly_batch
from morphcore.simulate.plan import STEP_S
from morphcore.simulate.trajectory import Trajectory, load_trajectory
from morphcore.simulate.trim import Trim, trimmed_state
from morphcore.threads import thread_count, use_threads
from morphcore.warming import warm_up

Array = NDArray[np.float64]
Figures = dict[str, Any]
Clock = Callable[[], float]

RATE_SAMPLES = ("train_rate_0.2", "train_rate_0.5", "train_rate_0.8")
ACCURACY_SAMPLES = (*RATE_SAMPLES, "train_asymmetric")
LINKS = 3
SWARM_SEED = 1
# spread of the benchmark's swarm around the physical guess: as wide as an identification's candidates
STIFFNESS_SPREAD = 0.3  # standard deviation of the logarithm
DIVISION_CONCENTRATION = 20.0  # of the Dirichlet distribution of the links' shares


@dataclass(frozen=True)
class Effort:
    """How long to measure.

    particles : parameter sets of the swarm. rounds : interleaved repetitions, of which medians are taken.
    singles : repetitions of single flights. links : numbers of links whose cost is compared.
    refinement : how many times finer the reference of the step error is.
    """

    particles: int
    rounds: int
    singles: int
    links: tuple[int, ...]
    refinement: int


FULL = Effort(particles=2500, rounds=3, singles=15, links=(1, 2, 3, 4, 5, 6, 7, 8), refinement=50)
QUICK = Effort(particles=480, rounds=2, singles=5, links=(1, 3, 5), refinement=10)


@dataclass(frozen=True)
class Bench:
    """The reference aircraft and flights, and a clock."""

    aircraft: Aircraft
    flight: Flight
    samples: Mapping[str, Trajectory]
    effort: Effort
    threads: int
    clock: Clock

    def cases(
        self, model: ChainModel, names: Sequence[str], step_s: float = STEP_S
    ) -> tuple[SampleCase, ...]:
        """Plans of some samples."""
        return sample_cases(model, [self.samples[name] for name in names], step_s)

    def timed(self, work: Callable[[], object]) -> float:
        """Wall time of some work, s."""
        begin = self.clock()
        work()
        return self.clock() - begin


def example_samples_dir() -> Path:
    """The folder of the example flights in a source tree.

    Raises
    ------
    InvalidInput : the library is installed without them.
    """
    folder = Path(__file__).resolve().parent.parent / "examples"
    if not (folder / "aircraft.json").is_file():
        raise InvalidInput(
            "the example flights are not beside this installation",
            pointer="/samples_dir",
            hint="name the folder examples/ of a source tree",
        )
    return folder


def run_benchmarks(
    quick: bool = False,  # noqa: FBT001, FBT002 - the command line's own flag
    *,
    samples_dir: str | Path | None = None,
    effort: Effort | None = None,
    clock: Clock = time.perf_counter,
) -> Figures:
    """Measure this machine.

    Parameters
    ----------
    quick : fewer parameter sets and repetitions: half a minute instead of some, and figures good to a tenth.
    samples_dir : folder with aircraft.json, flight.json and the example flights; None: the source tree's.
    effort : measure that long instead. clock : rising seconds.

    Returns
    -------
    JSON-able figures: machine, settings, batch, threads, single_flight, growth_with_links, step_error,
    lattice. Times are in s; real-time factors are simulated seconds of all flights over seconds on one core.

    Raises
    ------
    InvalidInput : the example flights are not there.
    """
    folder = example_samples_dir() if samples_dir is None else Path(samples_dir)
    bench = Bench(
        aircraft=load_aircraft(folder / "aircraft.json"),
        flight=load_flight(folder / "flight.json"),
        samples={name: load_trajectory(folder / f"{name}.csv") for name in ACCURACY_SAMPLES},
        effort=effort or (QUICK if quick else FULL),
        threads=thread_count(),
        clock=clock,
    )
    try:
        use_threads(1)
        compile_s = bench.timed(warm_up)
        return {
            "machine": {**_machine(), "threads": bench.threads, "warm_up_s": compile_s},
            "settings": {
                "quick": quick,
                "step_s": STEP_S,
                "links_per_wing": LINKS,
                "particles": bench.effort.particles,
                "flight_s": sum(bench.samples[name].duration_s for name in RATE_SAMPLES),
            },
            **batch_speed(bench),
            "single_flight": single_flights(bench),
            "growth_with_links": growth_with_links(bench),
            "step_error": step_error(bench),
            "lattice": lattice_cost(bench),
        }
    finally:
        use_threads(bench.threads)


def benchmark_table(figures: Figures) -> list[tuple[str, str]]:
    """The figures as lines to print: what, and its value with unit."""
    settings, batch, single = figures["settings"], figures["batch"], figures["single_flight"]
    what = f"{settings['particles']} models x {settings['flight_s']:.2f} s of flight, {LINKS} links a wing"
    rows = [
        (f"{what}, real time per core", f"{batch['real_time_factor_per_core']:,.0f} x"),
        ("the same with every model's trim", f"{batch['real_time_factor_per_core_with_trim']:,.0f} x"),
        ("flights a second on one core", f"{batch['flights_per_s']:,.0f}"),
    ]
    rows += [
        (f"the same swarm on {count} thread{'s' * (count != '1')}", f"{seconds:.3g} s")
        for count, seconds in figures["threads"]["fly_s"].items()
    ]
    rows += [
        (f"one flight of {single['flight_s']:.2f} s, rigid", f"{1e3 * single['rigid_s']:.3g} ms"),
        (f"one flight, {LINKS} links a wing", f"{1e3 * single['equivalent_s']:.3g} ms"),
        ("trim of one model", f"{1e3 * single['trim_s']:.3g} ms"),
        ("plan of one flight (lattice along the morph)", f"{1e3 * single['plan_s']:.3g} ms"),
        ("one lattice operator", f"{1e3 * figures['lattice']['operator_s']:.3g} ms"),
    ]
    rows += [
        (
            f"{TOGETHER} models of {links} link{'s' * (links != '1')} a wing, a simulated second",
            f"{1e3 * s:.3g} ms",
        )
        for links, s in figures["growth_with_links"]["s_per_simulated_s"].items()
    ]
    error = figures["step_error"]
    rows.append((f"attitude error of the step {1e3 * error['step_s']:g} ms", f"{error['worst_rad']:.2g} rad"))
    return rows


def benchmark_swarm(model: ChainModel, particles: int, seed: int = SWARM_SEED) -> ParameterBatch:
    """Parameter sets around the physical guess, as a search has them."""
    rng = np.random.default_rng(seed)
    n = model.links_per_wing
    division = rng.dirichlet(np.full(n, DIVISION_CONCENTRATION), (particles, 1))
    batch = physical_guess(model, division)
    factor = np.exp(rng.normal(0.0, STIFFNESS_SPREAD, batch.stiffness.shape))
    return ParameterBatch(**{**vars(batch), "stiffness": batch.stiffness * factor})


def batch_speed(bench: Bench) -> Figures:
    """The swarm through the three flights of constant rate: on one thread, and on two where there are."""
    model = chain_model(bench.aircraft, bench.flight, LINKS)
    cases = bench.cases(model, RATE_SAMPLES)
    swarm = benchmark_swarm(model, bench.effort.particles)
    counts = sorted({1, min(2, bench.threads)})
    trim_s: list[float] = []
    fly_s: dict[int, list[float]] = {count: [] for count in counts}
    trimmed: list[tuple[SampleCase, Trim]] = []
    for _ in range(bench.effort.rounds):
        use_threads(1)
        begin = bench.clock()
        trimmed = list(shared_trims(model, swarm, cases, "trim"))
        trim_s.append(bench.clock() - begin)
        for count in counts:
            use_threads(count)
            fly_s[count].append(sum(_fly(bench.clock, model, swarm, case, found) for case, found in trimmed))
    use_threads(1)
    one, trims = statistics.median(fly_s[1]), statistics.median(trim_s)
    simulated = swarm.particles * sum(case.sample.duration_s for case in cases)
    return {
        "batch": {
            "flights": swarm.particles * len(cases),
            "fly_s": one,
            "trim_s": trims,
            "real_time_factor_per_core": simulated / one,
            "real_time_factor_per_core_with_trim": simulated / (one + trims),
            "flights_per_s": swarm.particles * len(cases) / (one + trims),
            "untrimmed": int(sum(np.sum(~found.converged) for _, found in trimmed[:1])),
        },
        "threads": {
            "fly_s": {str(count): statistics.median(times) for count, times in fly_s.items()},
            "speed_up": one / statistics.median(fly_s[counts[-1]]),
        },
    }


def single_flights(bench: Bench) -> Figures:
    """One model alone through the flight at 0.5 rad/s, rigid and equivalent: plan, trim, flight."""
    sample = bench.samples["train_rate_0.5"]
    times: dict[str, list[float]] = {name: [] for name in ("rigid_s", "equivalent_s", "trim_s", "plan_s")}
    for _ in range(bench.effort.singles):
        for name, links in (("rigid_s", 1), ("equivalent_s", LINKS)):
            model = chain_model(bench.aircraft, bench.flight, links)
            begin = bench.clock()
            case = bench.cases(model, ["train_rate_0.5"])[0]
            planned = bench.clock()
            guess = physical_guess(model)
            found = next(iter(shared_trims(model, guess, [case], "trim")))[1]
            trimmed = bench.clock()
            times[name].append(_fly(bench.clock, model, guess, case, found))
            if links == LINKS:
                times["plan_s"].append(planned - begin)
                times["trim_s"].append(trimmed - planned)
    return {
        "flight_s": sample.duration_s,
        **{name: statistics.median(values) for name, values in times.items()},
    }


def growth_with_links(bench: Bench) -> Figures:
    """One block of lanes through the flight at 0.5 rad/s: cost of a simulated second by number of links."""
    name = "train_rate_0.5"
    prepared = {}
    for links in bench.effort.links:
        model = chain_model(bench.aircraft, bench.flight, links)
        case, swarm = bench.cases(model, [name])[0], benchmark_swarm(model, TOGETHER)
        prepared[links] = (model, swarm, case, next(iter(shared_trims(model, swarm, [case], "trim")))[1])
    times: dict[int, list[float]] = {links: [] for links in prepared}
    for _ in range(bench.effort.singles):
        for links, flight in prepared.items():
            times[links].append(_fly(bench.clock, *flight) / bench.samples[name].duration_s)
    return {
        "models": TOGETHER,
        "s_per_simulated_s": {str(links): statistics.median(values) for links, values in times.items()},
    }


def step_error(bench: Bench) -> Figures:
    """Largest attitude difference, rad, between the shipped step and a much finer one, on four flights."""
    model = chain_model(bench.aircraft, bench.flight, LINKS)
    guess = physical_guess(model)
    fine_s = STEP_S / bench.effort.refinement
    errors = {}
    for name in ACCURACY_SAMPLES:
        shipped, fine = (
            _attitude(model, guess, bench.cases(model, [name], step)[0]) for step in (STEP_S, fine_s)
        )
        errors[name] = float(np.abs(shipped - fine).max())
    return {"step_s": STEP_S, "reference_step_s": fine_s, "rad": errors, "worst_rad": max(errors.values())}


def lattice_cost(bench: Bench) -> Figures:
    """Assembly of one reduced lattice operator: influence of all rings, solution, reduction."""
    model = chain_model(bench.aircraft, bench.flight, LINKS)
    angles = np.full(len(bench.aircraft.surfaces), 0.3)
    times = [
        bench.timed(lambda: lattice_operator(model.lattice, tuple(angles)))
        for _ in range(bench.effort.singles)
    ]
    return {
        "rings": int(model.lattice.table.rings),
        "strips": model.lattice.strips,
        "operator_s": statistics.median(times),
    }


def _fly(clock: Clock, model: ChainModel, batch: ParameterBatch, case: SampleCase, found: Trim) -> float:
    """Fly a batch through a plan, attitudes recorded as in an identification; gives its wall time, s."""
    begin = clock()
    constants = lane_constants(model, batch, case.plan.grid.step_s)
    constants.set_thrust(found.force_B, found.moment_B)
    state = trimmed_state(model, batch, case.plan, found)
    for _ in fly_batch(model, case.plan, constants, state, record_rows=4):
        pass
    return clock() - begin


def _attitude(model: ChainModel, batch: ParameterBatch, case: SampleCase) -> Array:
    found = next(iter(shared_trims(model, batch, [case], "trim")))[1]
    return fly_attitudes(model, batch, case, found.require())


def _machine() -> Figures:
    return {
        "processor": processor_name(),
        "cores": os.cpu_count(),
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
        "numpy": np.__version__,
        "numba": numba.__version__,
        # unless 1, linear algebra on threads of its own fights with ours for the cores
        "openblas_num_threads": os.environ.get("OPENBLAS_NUM_THREADS"),
    }


def processor_name() -> str:
    """What this machine calls its processor."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or "unknown"
    return next(
        (line.partition(":")[2].strip() for line in lines if line.startswith("model name")), "unknown"
    )
