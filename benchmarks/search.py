"""Number of flights that each search needs to bring J within a share of the best known, over many seeds."""

from __future__ import annotations

import statistics
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.setting import LINKS, RATE_SAMPLES, Bench, Clock, Figures
from morphcore.geometry.aircraft import Aircraft, Flight
from morphcore.identify.descents import CANDIDATE_SPREAD
from morphcore.identify.identification import Identification
from morphcore.identify.settings import SearchSettings, search_settings
from morphcore.simulate.trajectory import Trajectory
from morphcore.threads import use_threads
from morphdata.identify import EquivalentModel, Search

# of the best known J: there a search has arrived. What a descent lowers is J and a prior whose weight it
# chooses, and searches that choose other weights end at J that differ by an eighth
WITHIN = 0.25
# "scattered" is "least_squares" from points drawn around the physical guess: a descent from the guess itself
# draws nothing, so its seeds would have no effect
METHODS = ("hybrid", "least_squares", "scattered", "cma", "pso", "paper")
MEASURED = ("hybrid", "scattered")  # of a benchmark: the default, and what depends on where it starts


@dataclass(frozen=True)
class _Run:
    """J after so many flight sets and seconds, step by step."""

    costs: tuple[float, ...]
    sets: tuple[int, ...]
    wall_s: tuple[float, ...]

    def document(self, seed: int, target: float) -> Figures:
        arrived = next((i for i, cost in enumerate(self.costs) if cost <= target), None)
        return {
            "seed": seed,
            "J": self.costs[-1],
            "flight_sets_to_target": None if arrived is None else self.sets[arrived],
            "wall_s_to_target": None if arrived is None else self.wall_s[arrived],
            "flight_sets": self.sets[-1],
            "wall_s": self.wall_s[-1],
        }


def search_figures(
    aircraft: Aircraft,
    flight: Flight,
    samples: Sequence[Trajectory],
    *,
    seeds: Iterable[int] = range(1, 11),
    methods: Sequence[str] = METHODS,
    links_per_wing: int = LINKS,
    max_sets: int | None = None,
    clock: Clock = time.perf_counter,
) -> Figures:
    """Search by several methods and seeds and count the flights.

    Parameters
    ----------
    samples : all of them are fitted. A flight set is one parameter set flown through all of them.
    methods : some of ``METHODS``; "paper" is the preset of that name.
    max_sets : a search is cut off after the step that exceeds it.
    clock : rising seconds.

    Returns
    -------
    JSON-able figures: best_known_J, target_J, methods: by name the runs, how many arrived, medians over those
    that did (flight_sets_to_target, wall_s_to_target) and over all (flight_sets, wall_s).
    """
    model = EquivalentModel(links_per_wing=links_per_wing)
    runs: dict[str, dict[int, _Run]] = {}
    listed = tuple(seeds)
    for method in methods:
        runs[method] = {
            seed: _searched(
                Identification(aircraft, flight, samples, model, _settings(method, seed)),
                method,
                max_sets,
                clock,
            )
            for seed in listed
        }
    best = min(run.costs[-1] for of_method in runs.values() for run in of_method.values())
    target = (1.0 + WITHIN) * best
    return {
        "links_per_wing": links_per_wing,
        "samples": [sample.name for sample in samples],
        "best_known_J": best,
        "target_J": target,
        "methods": {
            method: _summary([run.document(seed, target) for seed, run in of_method.items()])
            for method, of_method in runs.items()
        },
    }


def search_benchmark(bench: Bench) -> Figures:
    """The default search and descents from scattered points on the three flights, on all threads.

    In addition to the methods' figures: arrived_share, flight_sets_to_target (the worst of all runs) and
    wall_s_to_target (their median), the latter two of those runs that arrive.
    """
    use_threads(bench.threads)
    figures = search_figures(
        bench.aircraft,
        bench.flight,
        [bench.samples[name] for name in RATE_SAMPLES],
        seeds=range(1, bench.effort.seeds + 1),
        methods=MEASURED,
        clock=bench.clock,
    )
    use_threads(1)
    runs = [run for found in figures["methods"].values() for run in found["runs"]]
    arrived = [run for run in runs if run["flight_sets_to_target"] is not None]
    # the best of them all has arrived: there is one at least
    return figures | {
        "arrived_share": len(arrived) / len(runs),
        "flight_sets_to_target": max(run["flight_sets_to_target"] for run in arrived),
        "wall_s_to_target": _median(arrived, "wall_s_to_target"),
    }


def _settings(method: str, seed: int) -> SearchSettings:
    if method == "paper":
        return search_settings(Search(preset="paper", seed=seed))
    return search_settings(
        Search.parse({"method": "least_squares" if method == "scattered" else method, "seed": seed})
    )


def _searched(run: Identification, method: str, max_sets: int | None, clock: Clock) -> _Run:
    if method == "scattered":
        drawn = np.random.default_rng(run.search.seed).normal(0.0, CANDIDATE_SPREAD, run.space.dimension)
        run.known = np.clip(run.space.guess + drawn, run.space.lower, run.space.upper)[None]
    costs, sets, wall_s = [], [], []
    begin = clock()
    for step in run.steps():
        costs.append(step.best_cost)
        sets.append(step.flights // len(run.training))
        wall_s.append(clock() - begin)
        if max_sets is not None and sets[-1] >= max_sets:
            break
    return _Run(tuple(costs), tuple(sets), tuple(wall_s))


def _summary(runs: list[Figures]) -> Figures:
    arrived = [run for run in runs if run["flight_sets_to_target"] is not None]
    return {
        "runs": runs,
        "seeds": len(runs),
        "arrived": len(arrived),
        **{name: _median(arrived, name) for name in ("flight_sets_to_target", "wall_s_to_target")},
        **{name: _median(runs, name) for name in ("J", "flight_sets", "wall_s")},
    }


def _median(runs: list[Figures], name: str) -> float | None:
    return statistics.median(run[name] for run in runs) if runs else None


def search_table(figures: Figures) -> list[tuple[str, str]]:
    """The figures as lines to print: method, and what it took."""
    rows = [("best known J", f"{figures['best_known_J']:.4g} rad^2")]
    for method, found in figures["methods"].items():
        many = f"{found['arrived']} of {found['seeds']}"
        if found["arrived"]:
            took = f"{found['flight_sets_to_target']:,.0f} flight sets, {found['wall_s_to_target']:.3g} s"
            rows.append((method, f"{many} arrive; median {took}"))
        else:
            rows.append(
                (method, f"{many}; J = {found['J']:.3g} rad^2 after {found['flight_sets']:,.0f} flight sets")
            )
    return rows
