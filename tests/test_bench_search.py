"""The count of flights of a search: what is printed is what was flown."""

from __future__ import annotations

import itertools
import json

import pytest

from morphcore.bench_search import search_figures, search_table
from tests.identify.flights import example, reference_aircraft, reference_flight, shortened


def test_counts_the_flights_of_every_search() -> None:
    """Each method's runs are counted in sets through all samples, cut off where told, and none is flattered.

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
        most_sets=80,
        clock=lambda: float(next(clock)),
    )
    assert json.loads(json.dumps(figures, allow_nan=False)) == figures
    methods = figures["methods"]
    every = [run for found in methods.values() for run in found["runs"]]
    assert figures["best_known_J"] == min(run["J"] for run in every)
    assert figures["target_J"] == pytest.approx(1.1 * figures["best_known_J"])
    # 11 parameters: the guess, then in every iteration 12 sets of the Jacobian and 24 trials
    assert [run["flight_sets"] for run in methods["least_squares"]["runs"]] == [109, 109]
    assert [run["flight_sets"] for run in methods["cma"]["runs"]] == [97, 97]
    assert methods["cma"]["arrived"] == 0
    scattered = methods["scattered"]["runs"]
    assert scattered[0]["J"] != scattered[1]["J"]
    for run in every:
        assert (run["flight_sets_to_target"] is None) == (run["J"] > figures["target_J"])
    assert len(search_table(figures)) == 4
