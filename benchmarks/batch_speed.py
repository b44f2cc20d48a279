"""The swarm through the three flights of constant rate, on one core and with a second thread."""

from __future__ import annotations

import statistics
import time
from dataclasses import dataclass

import numpy as np

from benchmarks.setting import LINKS, RATE_SAMPLES, Bench, Figures
from benchmarks.swarm import flown
from morphcore.identify.cost import SampleCase, costs, shared_trims
from morphcore.models.equivalent import chain_model
from morphcore.paper.computation import benchmark_swarm
from morphcore.simulate.trim import Trim
from morphcore.threads import one_blas_thread, use_threads


@dataclass(frozen=True)
class Round:
    """One generation, in s: on the wall, of the process's threads, of the calling thread alone."""

    wall: float
    process: float
    caller: float


def batch_speed(bench: Bench) -> Figures:
    """Real-time factors of flights on one core, and the speed-up of whole generations on two.

    Per core and second means per second that a core computes: other processes on the machine do not count.
    Two threads are judged twice: by the wall, and by their computing times, which stand where the machine is
    shared. A generation is the work that a search requests: trims, flights, errors.
    """
    model = chain_model(bench.aircraft, bench.flight, LINKS)
    cases = bench.cases(model, RATE_SAMPLES)
    swarm = benchmark_swarm(model, bench.effort.particles)
    counts = sorted({1, min(2, bench.threads)})
    trim_s: list[float] = []
    fly_s: list[float] = []
    rounds: dict[int, list[Round]] = {count: [] for count in counts}
    trimmed: list[tuple[SampleCase, Trim]] = []
    for _ in range(bench.effort.rounds):
        use_threads(1)
        begin = bench.computing()
        trimmed = list(shared_trims(model, swarm, cases, "trim"))
        trim_s.append(bench.computing() - begin)
        fly_s.append(sum(flown(bench.computing, model, swarm, case, found) for case, found in trimmed))
        for count in counts:
            use_threads(count)
            wall, process, caller = bench.clock(), time.process_time(), bench.computing()
            with one_blas_thread():
                costs(model, swarm, cases, "trim")
            rounds[count].append(
                Round(bench.clock() - wall, time.process_time() - process, bench.computing() - caller)
            )
    use_threads(1)
    one, trims = statistics.median(fly_s), statistics.median(trim_s)
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
        "threads": _threads(rounds),
    }


def _threads(rounds: dict[int, list[Round]]) -> Figures:
    """Speed-up of the largest number of threads over one.

    ``speed_up_by_computing_time`` : all computing over the longest way through it, the caller's own time and
    then the pool's in equal parts; at most the number of threads. ``work_growth`` : computing on so many
    threads over that on one, what they take from each other. ``serial_share`` : the caller's own.
    """
    maximum = max(rounds)
    by_wall = [one.wall / many.wall for one, many in zip(rounds[1], rounds[maximum], strict=True)]
    found: Figures = {
        "generation_s": {
            str(count): statistics.median(r.wall for r in times) for count, times in rounds.items()
        },
        "speed_up": statistics.median(by_wall),
    }
    if maximum > 1:
        shares = [min(1.0, many.caller / many.process) for many in rounds[maximum]]
        found |= {
            "speed_up_by_computing_time": statistics.median(1.0 / (s + (1.0 - s) / maximum) for s in shares),
            "serial_share": statistics.median(shares),
            "work_growth": statistics.median(
                many.process / one.process for one, many in zip(rounds[1], rounds[maximum], strict=True)
            ),
        }
    return found
