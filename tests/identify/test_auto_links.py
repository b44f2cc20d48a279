"""The number of links per wing is the fewest under which the flights are about as likely as under any."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from morphcore.errors import InvalidInput
from morphcore.identify import AutoIdentification, Identification, identification_from_request
from morphcore.identify.parameters import search_space
from morphcore.identify.settings import SearchSettings
from morphcore.models.equivalent import chain_model
from morphcore.search.step import Step
from morphcore.simulate.time_grid import STEP_S
from morphdata.identify import AUTO_LINKS, EXAMPLE_REQUEST, EquivalentModel, IdentifyRequest
from morphdata.operations.identify import cost
from tests.identify.flights import example, reference_aircraft, reference_flight, synthetic

AUTO = EquivalentModel(links_per_wing="auto", step_s=STEP_S)


def two_links() -> AutoIdentification:
    """Flights of a two-link model, with the noise of a good sensor."""
    space = search_space(chain_model(reference_aircraft(), reference_flight(), 2))
    truth = space.guess + np.random.default_rng(2).normal(0.0, 0.25, space.dimension)
    batch = space.decode(np.clip(truth, space.lower, space.upper))
    samples = [
        synthetic(batch, name="apart", left_rad=0.3, right_rad=0.5, noise_rad=1e-5, seed=1),
        synthetic(batch, name="together", noise_rad=1e-5, seed=2),
    ]
    search = SearchSettings(method="least_squares", iterations=12)
    return AutoIdentification(reference_aircraft(), reference_flight(), samples, AUTO, search)


@cache
def searched() -> tuple[Step, ...]:
    """Its steps."""
    return tuple(two_links().steps())


def without_times(document: dict[str, Any]) -> dict[str, Any]:
    """A result document without what a clock put into it."""
    search = {key: value for key, value in document["search"].items() if key != "wall_s"}
    return {**document, "search": search, "cost": None}


@pytest.mark.slow
def test_finds_the_number_of_links_that_flew() -> None:
    """Flights of two links are flown by two; one is far less likely, and more are tried in vain."""
    document = two_links().result(searched()[-1].checkpoint).to_document()
    tried = {row["links_per_wing"]: row["log_likelihood"] for row in document["search"]["links_tried"]}
    print(tried)
    assert document["model"]["links_per_wing"] == 2
    assert list(tried) == list(AUTO_LINKS[: len(tried)])
    assert len(tried) < len(AUTO_LINKS)
    assert tried[1] < tried[2] - 10.0
    assert document["search"]["flights"] == sum(row["flights"] for row in document["search"]["links_tried"])


@pytest.mark.slow
def test_resumes_from_any_step_to_the_identical_result() -> None:
    """Cut off within any number of links and begun again from the bytes."""
    steps = searched()
    whole = without_times(two_links().result(steps[-1].checkpoint).to_document())
    for cut in (1, len(steps) // 2, len(steps) - 2):
        resumed = two_links()
        *_, ended = resumed.steps(steps[cut].checkpoint)
        assert without_times(resumed.result(ended.checkpoint).to_document()) == whole
    fractions = [step.fraction for step in steps]
    assert fractions == sorted(fractions)
    assert fractions[-1] == 1.0


@pytest.mark.slow
def test_three_symmetric_flights_predict_an_asymmetric_one() -> None:
    """Of the flexible program's flights: J on the one held out is at most 2e-4 of the rigid model's."""
    samples = [example(f"rate_{rate}") for rate in ("0.2", "0.5", "0.8")] + [
        example("asymmetric", "held_out")
    ]
    model = EquivalentModel(links_per_wing="auto")
    run = AutoIdentification(reference_aircraft(), reference_flight(), samples, model)
    *_, last = run.steps()
    document = run.result(last.checkpoint).to_document()
    ratios = {fit["sample"]: fit["J_identified"] / fit["J_rigid"] for fit in document["fit"]}
    print(document["search"]["links_tried"], ratios)
    assert max(ratios.values()) <= 2e-4


def test_a_request_may_ask_for_it() -> None:
    """The document takes "auto", its cost is that of all numbers, and the library makes the run of it."""
    given = {**EXAMPLE_REQUEST, "model": {"links_per_wing": "auto"}}
    request = IdentifyRequest.parse(given)
    each = [
        cost(IdentifyRequest.parse({**EXAMPLE_REQUEST, "model": {"links_per_wing": links}})).flights
        for links in AUTO_LINKS
    ]
    assert cost(request).flights == sum(each)
    run = identification_from_request(request)
    assert isinstance(run, AutoIdentification)
    assert list(run.runs) == list(AUTO_LINKS)


def test_a_model_to_begin_from_fixes_the_number() -> None:
    """It has a number of links already, so none can be chosen."""
    known = {
        "links_per_wing": 1,
        "division": [1.0],
        "stiffness_nm_rad": [],
        "damping_nms_rad": [],
        "aero": {"profile_drag": 0.01, "lag_s": 0.004},
    }
    search = {"warm_start": {"parameters": known}}
    with pytest.raises(InvalidInput) as refused:
        IdentifyRequest.parse({**EXAMPLE_REQUEST, "model": {"links_per_wing": "auto"}, "search": search})
    assert [fault.code for fault in refused.value.faults] == ["links_differ"]


def test_a_single_identification_refuses_it() -> None:
    """With a hint to the class that chooses."""
    samples = [replace(example("rate_0.8"))]
    with pytest.raises(InvalidInput) as refused:
        Identification(reference_aircraft(), reference_flight(), samples, AUTO)
    assert refused.value.pointer == "/model/links_per_wing"
