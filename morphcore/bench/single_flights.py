"""One model alone through the flight at 0.5 rad/s, rigid and equivalent: plan, trim, flight."""

from __future__ import annotations

import statistics

from morphcore.bench.setting import LINKS, Bench, Figures
from morphcore.bench.swarm import flown
from morphcore.identify.cost import shared_trims
from morphcore.models.equivalent import chain_model, physical_guess
from morphcore.simulate.flight import flight_steps
from morphcore.warming import warm_up_further


def single_flights(bench: Bench) -> Figures:
    """Medians, s."""
    sample = bench.samples["train_rate_0.5"]
    times: dict[str, list[float]] = {name: [] for name in ("rigid_s", "equivalent_s", "trim_s", "plan_s")}
    for _ in range(bench.effort.singles):
        for name, links in (("rigid_s", 1), ("equivalent_s", LINKS)):
            model = chain_model(bench.aircraft, bench.flight, links)
            begin = bench.computing()
            case = bench.cases(model, ["train_rate_0.5"])[0]
            planned = bench.computing()
            guess = physical_guess(model)
            found = next(iter(shared_trims(model, guess, [case], "trim")))[1]
            trimmed = bench.computing()
            times[name].append(flown(bench.computing, model, guess, case, found))
            if links == LINKS:
                times["plan_s"].append(planned - begin)
                times["trim_s"].append(trimmed - planned)
    return {
        "flight_s": sample.duration_s,
        **{name: statistics.median(values) for name, values in times.items()},
    }


def flexible_flight(bench: Bench) -> Figures:
    """The same flight of the flexible model, trim and all, once: it takes seconds, not milliseconds."""
    sample = bench.samples["train_rate_0.5"]
    warm_up_further()
    seconds = bench.timed(lambda: list(flight_steps(bench.aircraft, bench.flight, sample, model="flexible")))
    return {"flight_s": sample.duration_s, "flexible_s": seconds}
