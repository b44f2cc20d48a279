"""The swarm through the three flights of constant rate: on one thread, and on two where there are."""

from __future__ import annotations

import statistics
import time
from dataclasses import dataclass

import numpy as np

from morphcore.bench.setting import LINKS, RATE_SAMPLES, Bench, Figures
from morphcore.bench.swarm import benchmark_swarm, flown
from morphcore.identify.cost import SampleCase, shared_trims
from morphcore.models.equivalent import ChainModel, ParameterBatch, chain_model
from morphcore.simulate.trim import Trim
from morphcore.threads import use_threads


@dataclass(frozen=True)
class Round:
    """One flight of the swarm, in s: on the wall, of the process's threads, of the calling thread alone."""

    wall: float
    process: float
    caller: float


def batch_speed(bench: Bench) -> Figures:
    """Real-time factors on one core, and what a second thread brings.

    Per core and second means per second that a core computes: other processes on the machine do not count.
    Two threads are judged twice: by the wall, and by the computing times, the caller's own (serial) plus the
    pool's share of a thread. The second stands where the machine is shared.
    """
    model = chain_model(bench.aircraft, bench.flight, LINKS)
    cases = bench.cases(model, RATE_SAMPLES)
    swarm = benchmark_swarm(model, bench.effort.particles)
    counts = sorted({1, min(2, bench.threads)})
    trim_s: list[float] = []
    rounds: dict[int, list[Round]] = {count: [] for count in counts}
    trimmed: list[tuple[SampleCase, Trim]] = []
    for _ in range(bench.effort.rounds):
        use_threads(1)
        begin = bench.computing()
        trimmed = list(shared_trims(model, swarm, cases, "trim"))
        trim_s.append(bench.computing() - begin)
        for count in counts:
            use_threads(count)
            rounds[count].append(_round(bench, model, swarm, trimmed))
    use_threads(1)
    one, trims = statistics.median(r.caller for r in rounds[1]), statistics.median(trim_s)
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


def _round(
    bench: Bench, model: ChainModel, swarm: ParameterBatch, trimmed: list[tuple[SampleCase, Trim]]
) -> Round:
    wall, process = bench.clock(), time.process_time()
    caller = sum(flown(bench.computing, model, swarm, case, found) for case, found in trimmed)
    return Round(bench.clock() - wall, time.process_time() - process, caller)


def _threads(rounds: dict[int, list[Round]]) -> Figures:
    """Speed-up of the largest number of threads; ``serial_share``: of the time on one thread."""
    most = max(rounds)
    by_wall = [one.wall / many.wall for one, many in zip(rounds[1], rounds[most], strict=True)]
    found: Figures = {
        "fly_s": {str(count): statistics.median(r.wall for r in times) for count, times in rounds.items()},
        "speed_up": statistics.median(by_wall),
    }
    if most > 1:
        pairs = list(zip(rounds[1], rounds[most], strict=True))
        pooled = [max(0.0, many.process - many.caller) for _, many in pairs]
        found["speed_up_by_computing_time"] = statistics.median(
            one.process / (many.caller + pool / most) for (one, many), pool in zip(pairs, pooled, strict=True)
        )
        found["serial_share"] = statistics.median(many.caller / one.process for one, many in pairs)
    return found
