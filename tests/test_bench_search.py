"""The count of flights of a search: what is printed is what was flown."""

from __future__ import annotations

import itertools
import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from benchmarks import search
from benchmarks.run import run_benchmarks
from benchmarks.search import search_figures, search_table
from benchmarks.setting import QUICK, Figures
from benchmarks.table import benchmark_table
from morphcore.geometry.aircraft import Aircraft, Flight
from morphcore.simulate.trajectory import Trajectory
from tests.identify.flights import example, reference_aircraft, reference_flight, shortened


def test_counts_the_flights_of_every_search() -> None:
    """Each method's runs are counted in sets through all samples, cut off at the limit, and none is favoured.

    The target lies above the best of all; a search that is cut off at its first generation has not arrived.
    """
    clock = itertools.count()
    figures = search_figures(
        reference_aircraft(),
        reference_flight(),
        [shortened(example("rate_0.8"), 60), shortened(example("rate_0.5"), 60)],
        seeds=(1, 2),
        methods=("least_squares", "scattered", "cma"),
        links_per_wing=2,
        max_sets=80,
        clock=lambda: float(next(clock)),
    )
    assert json.loads(json.dumps(figures, allow_nan=False)) == figures
    methods = figures["methods"]
    every = [run for found in methods.values() for run in found["runs"]]
    assert figures["best_known_J"] == min(run["J"] for run in every)
    assert figures["target_J"] == pytest.approx(1.25 * figures["best_known_J"])
    # 10 parameters: the guess, then in every iteration 11 sets of the Jacobian and 24 trials
    assert [run["flight_sets"] for run in methods["least_squares"]["runs"]] == [106, 106]
    assert [run["flight_sets"] for run in methods["cma"]["runs"]] == [97, 97]
    assert methods["cma"]["arrived"] == 0
    scattered = methods["scattered"]["runs"]
    assert scattered[0]["J"] != scattered[1]["J"]
    for run in every:
        assert (run["flight_sets_to_target"] is None) == (run["J"] > figures["target_J"])
    assert len(search_table(figures)) == 4


def test_the_benchmark_judges_the_worst_run(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its share, worst count and median time are those of the runs."""
    clock = itertools.count()

    def shorter(aircraft: Aircraft, flight: Flight, samples: list[Trajectory], **options: Any) -> Figures:
        beginnings = [shortened(sample, 60) for sample in samples]
        return search_figures(aircraft, flight, beginnings, **options, links_per_wing=1, max_sets=100)

    monkeypatch.setattr(search, "search_figures", shorter)
    figures = run_benchmarks(
        effort=replace(QUICK, seeds=3), sections=["search"], clock=lambda: float(next(clock))
    )
    found = figures["search"]
    runs = [run for method in found["methods"].values() for run in method["runs"]]
    arrived = [run for run in runs if run["flight_sets_to_target"] is not None]
    assert len(runs) == 6
    assert found["arrived_share"] == len(arrived) / 6
    assert found["flight_sets_to_target"] == max(run["flight_sets_to_target"] for run in arrived)
    assert found["wall_s_to_target"] == np.median([run["wall_s_to_target"] for run in arrived])
    holds = {each["figure"]: each["holds"] for each in figures["requirements"]}
    assert holds["search/arrived_share"] is (len(arrived) == 6)
    assert any(line.what.startswith("searches from 3 flights") for line in benchmark_table(figures))
