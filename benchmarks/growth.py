"""Cost of a simulated second by number of links, for one block of lanes."""

from __future__ import annotations

import statistics

from benchmarks.setting import Bench, Figures
from benchmarks.swarm import flown
from morphcore.identify.cost import shared_trims
from morphcore.lanes import TOGETHER
from morphcore.models.equivalent import chain_model
from morphcore.paper.computation import benchmark_swarm

SAMPLE = "train_rate_0.5"


def growth_with_links(bench: Bench) -> Figures:
    """Medians of interleaved flights at 0.5 rad/s; how their operations grow stands in `operations`."""
    prepared = {}
    for links in bench.effort.links:
        model = chain_model(bench.aircraft, bench.flight, links)
        case, swarm = bench.cases(model, [SAMPLE])[0], benchmark_swarm(model, TOGETHER)
        prepared[links] = (model, swarm, case, next(iter(shared_trims(model, swarm, [case], "trim")))[1])
    times: dict[int, list[float]] = {links: [] for links in prepared}
    for _ in range(bench.effort.singles):
        for links, flight in prepared.items():
            times[links].append(flown(bench.computing, *flight) / bench.samples[SAMPLE].duration_s)
    return {
        "models": TOGETHER,
        "s_per_simulated_s": {str(links): statistics.median(values) for links, values in times.items()},
    }
