"""The compiled kernel of flight by itself, without what Python does around it: many lanes, and one lane."""

from __future__ import annotations

import statistics

from benchmarks.entry_points import KernelClock
from benchmarks.operations import flight_operations
from benchmarks.setting import LINKS, Bench, Figures
from benchmarks.swarm import flown
from morphcore.identify.cost import shared_trims
from morphcore.lanes import TOGETHER
from morphcore.models.equivalent import chain_model
from morphcore.paper.computation import benchmark_swarm

SAMPLE = "train_rate_0.5"
MODELS = {"batch": 8 * TOGETHER, "single": 1}


def kernel_alone(bench: Bench) -> Figures:
    """Cost of a simulated second of one model inside the kernel; share of the kernel in the whole flight.

    ``lanes_gain`` : cost of a single lane over the cost per lane in a batch; the number of lanes of a vector
    register if lanes became vector instructions, near 1 if the compiler left them scalar.
    ``operations_per_s`` : additions and multiplications of the kernel in a batch.
    """
    model = chain_model(bench.aircraft, bench.flight, LINKS)
    prepared, duration_s = {}, bench.samples[SAMPLE].duration_s
    for name, particles in MODELS.items():
        case, swarm = bench.cases(model, [SAMPLE])[0], benchmark_swarm(model, particles)
        prepared[name] = (model, swarm, case, next(iter(shared_trims(model, swarm, [case], "trim")))[1])
        flown(bench.computing, *prepared[name])  # compiles
    inside: dict[str, list[float]] = {name: [] for name in prepared}
    share: dict[str, list[float]] = {name: [] for name in prepared}
    for _ in range(bench.effort.singles):
        for name, flight in prepared.items():
            clock = KernelClock(bench.computing)
            with clock.running():
                whole = flown(bench.computing, *flight)
            inside[name].append(clock.seconds / (MODELS[name] * duration_s))
            share[name].append(clock.seconds / whole)
    cost = {name: statistics.median(values) for name, values in inside.items()}
    counted = sum(part["total"] for part in flight_operations(bench, LINKS).values())
    return {
        "s_per_simulated_s": cost,
        "share_of_flight": {name: statistics.median(values) for name, values in share.items()},
        "lanes_gain": statistics.median(
            one / many for one, many in zip(inside["single"], inside["batch"], strict=True)
        ),
        "operations_per_simulated_s": counted,
        "operations_per_s": counted / cost["batch"],
    }
