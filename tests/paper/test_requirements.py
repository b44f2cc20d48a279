"""The table of requirements: computed from the stages, judged by its limits."""

from __future__ import annotations

import json

import pytest

from morphcore.paper.requirements import Requirement, judged_requirements
from tests.paper import made_up


def by_name(made: dict[str, made_up.Document], *, quick: bool = True) -> dict[str, Requirement]:
    """Give the requirements of made-up results by what they are."""
    return {each.what: each for each in judged_requirements(made, total_s=100.0, quick=quick)}


def one(made: dict[str, made_up.Document], words: str) -> Requirement:
    """Give the one figure whose description holds some words."""
    (found,) = [each for what, each in by_name(made).items() if words in what]
    return found


def test_a_limit_is_kept_on_its_own_side() -> None:
    """At most and at least; the limit itself is kept; what was not measured is not judged."""
    assert [Requirement("", 1.0, value).met for value in (0.9, 1.0, 1.1, None)] == [True, True, False, None]
    assert [Requirement("", 1.0, value, at_least=True).met for value in (0.9, 1.0, 1.1)] == [
        False,
        True,
        True,
    ]


def test_every_figure_comes_from_its_stage() -> None:
    """Values are those of the stages in the units of the table: mrad, per cent, s."""
    made = made_up.results()
    assert one(made, "elements doubled").value == pytest.approx(1e-3)
    assert one(made, "step halved").value == pytest.approx(2e-3)
    assert one(made, "tip deflection").value == pytest.approx(100 * (0.2768 / 0.273 - 1))
    assert one(made, "train_asymmetric").value == pytest.approx(1.5)
    assert one(made, "train_rate_0.5").value == pytest.approx(0.7)
    assert one(made, "0.4 rad/s, held out").value == pytest.approx(5e-7)
    assert one(made, "the flight alone").value == pytest.approx(0.4)
    assert one(made, "in a batch").value == pytest.approx(100 * 0.6 / 480 / 3.0)
    assert one(made, "flexible flight of 2 s").value == pytest.approx(3.3)
    assert one(made, "variation below constant rate").value == 25.0
    assert one(made, "largest rate").value == 0.9999
    assert one(made, "found in").value == 7.0
    assert all(each.met for each in by_name(made).values())
    json.dumps([each.to_document() for each in by_name(made).values()], allow_nan=False)


def test_worse_figures_are_called_missed() -> None:
    """Each verdict follows its own stage: nothing is hard-coded."""
    made = made_up.results()
    made["truth"]["convergence"]["rows"][1]["max_abs_rad"]["theta"] = 2e-4
    made["identification"]["fit"][4]["J_identified"] = 1e-4
    made["identification"]["fit"][5]["J_identified"] = None  # diverged
    made["computation"]["batch"]["flight_s"] = 0.004
    made["morph"]["reduction_percent"] = 4.23
    made["morph"]["checked"]["min_rate_rad_s"] = -1e-3
    verdicts = {what: each.met for what, each in by_name(made).items()}
    assert [what for what, met in verdicts.items() if met is False] == [
        "flexible model, step halved: attitude moves by",
        "1.0 rad/s, held out: J of the equivalent over J of the rigid model",
        "the same in a batch, with lattice and trim",
        "optimised morph: attitude variation below constant rate by, flown in the flexible model",
        "its fastest backward turn",
    ]
    assert [what for what, met in verdicts.items() if met is None] == [
        "quadratic, 1 rad in 2 s, held out: J of the equivalent over J of the rigid model"
    ]


def test_the_independent_flights_are_judged_with_their_own_core() -> None:
    """The other law's errors do not count; without flights there is no row."""
    made = made_up.results()
    for flown in made["independent"]["laws"][0]["flights"]:
        flown["rms_rad"] = made_up.per_angle(0.05)
    assert one(made, "train_rate_0.5").value == pytest.approx(0.7)
    made["independent"] = {"available": False, "laws": []}
    assert not [what for what in by_name(made) if "train_" in what]


def test_the_run_itself_has_a_limit() -> None:
    """An hour in full, five minutes quick."""
    made = made_up.results()
    limits = [by_name(made, quick=quick)["this run, all stages together"].limit for quick in (False, True)]
    assert limits == [3600.0, 300.0]
