"""A search that begins from a known model: sooner there than from the physical guess, never worse for it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from morphcore.errors import InvalidInput
from morphcore.identify import Identification, SearchSettings, Step
from morphcore.identify.parameters import search_space
from morphcore.identify.settings import search_settings
from morphcore.models.equivalent import ParameterBatch, chain_model
from morphcore.models.parameters_document import parameters_from_document
from morphdata.identify import EquivalentModel, IdentifySearch
from tests.identify.flights import example, reference_aircraft, reference_flight, shortened

TWO = EquivalentModel(links_per_wing=2)
COLD = SearchSettings(seed=3, screen=48, starts=3, iterations=10)
CHAIN = chain_model(reference_aircraft(), reference_flight(), 2)
MODEL = {
    "links_per_wing": 2,
    "division": [0.45, 0.55],
    "stiffness_nm_rad": [[41e3, 68e3, 380e3]],
    "damping_nms_rad": [[160.0, 270.0, 1500.0]],
    "aero": {"lift_factor": 1.06, "ac_offset_m": 0.002, "profile_drag": 0.011, "lag_s": 0.004},
}


def run(search: SearchSettings, **options: Any) -> Identification:
    """A small identification: two links, one second of one flight."""
    samples = [shortened(example("rate_0.8"), 120)]
    return Identification(reference_aircraft(), reference_flight(), samples, TWO, search, **options)


def flights_to(steps: Iterable[Step], cost: float) -> int:
    """How many flights a search took to get there."""
    for step in steps:
        if step.best_cost <= cost:
            return step.flights
    raise AssertionError(f"it never came to {cost:g} rad^2")


def identified(search: SearchSettings = COLD) -> tuple[list[Step], ParameterBatch]:
    """All steps of a search, and its model."""
    searched = run(search)
    steps = list(searched.steps())
    document = searched.best_so_far(steps[-1].checkpoint).to_document()
    return steps, parameters_from_document(document)


def test_a_model_is_the_point_it_decodes_from() -> None:
    """Encoding and decoding give the same model, and every point of the box."""
    space = search_space(CHAIN)
    x = space.lower + (space.upper - space.lower) * np.random.default_rng(1).uniform(size=space.dimension)
    # both ways are a logarithm and an exponential
    np.testing.assert_allclose(space.encode(space.decode(x)), x, rtol=1e-10, atol=1e-10)
    known = parameters_from_document(MODEL)
    found = space.decode(space.encode(known))
    for name, values in known.values.items():  # what it leaves out is the aircraft's
        np.testing.assert_allclose(found[name], values, rtol=1e-7)


def test_what_is_out_of_bounds_is_moved_in() -> None:
    """A model outside of the bounds, without damping even, gives the nearest point inside."""
    space = search_space(CHAIN)
    wild = parameters_from_document(
        {**MODEL, "division": [0.999, 0.001], "damping_nms_rad": [[0.0, 0.0, 1e12]]}
    )
    x = space.encode(wild)
    assert np.all((space.lower <= x) & (x <= space.upper))


def test_shared_wings_begin_separate_ones() -> None:
    """A model whose wings are alike begins a search for wings of their own; not the other way round."""
    separate = search_space(CHAIN, separate_wings=True)
    known = parameters_from_document(MODEL)
    both = separate.decode(separate.encode(known))
    np.testing.assert_allclose(
        both["stiffness_nm_rad"][0], np.repeat(known["stiffness_nm_rad"][0], 2, axis=0)
    )
    with pytest.raises(InvalidInput) as error:
        search_space(CHAIN).encode(both)
    assert error.value.pointer == "/search/warm_start"


def test_another_number_of_links_is_refused() -> None:
    """The field and both ways out are named."""
    three = chain_model(reference_aircraft(), reference_flight(), 3)
    with pytest.raises(InvalidInput) as error:
        search_space(three).encode(parameters_from_document(MODEL))
    assert error.value.pointer == "/search/warm_start"
    assert "model.links_per_wing to 2" in error.value.hint


def test_the_same_cost_with_fewer_flights() -> None:
    """From the model of an earlier search the cost that it ended with is there at the first flights."""
    steps, model = identified()
    goal = steps[-1].best_cost * (1.0 + 1e-6)  # the model went through its document
    cold = flights_to(steps, goal)
    again = run(replace(COLD, warm_start=model))
    warm = flights_to(again.steps(), goal)
    assert warm == 2 < cold


def test_a_bad_start_does_no_harm() -> None:
    """The physical guess stays among the candidates: no search ends worse than it."""
    guess = next(iter(run(COLD).steps())).best_cost
    bad = parameters_from_document(
        {**MODEL, "stiffness_nm_rad": [[1e3, 1e3, 1e3]], "damping_nms_rad": [[1.0, 1.0, 1.0]]}
    )
    first = next(iter(run(replace(COLD, warm_start=bad)).steps()))
    assert first.best_cost <= guess
    assert first.flights == 2


def test_first_particles_of_a_swarm() -> None:
    """A swarm begins with the known model and the physical guess; the others are where they were."""
    swarm = SearchSettings(method="pso", seed=3)
    cold, warm = run(swarm), run(replace(swarm, warm_start=parameters_from_document(MODEL)))
    tasks = []
    for searched in (cold, warm):
        task = searched.task(next(iter(searched.steps())).checkpoint)
        assert task is not None
        tasks.append(task.points)
    # the box is mapped onto the unit cube and back
    np.testing.assert_allclose(tasks[1][:2], warm.known, rtol=1e-12)
    np.testing.assert_allclose(tasks[0][0], cold.space.guess, rtol=1e-12)
    np.testing.assert_array_equal(tasks[1][2:], tasks[0][2:])


def test_documents_say_what_to_begin_from() -> None:
    """A model or a whole result; with it the search looks at fewer candidates unless told how many."""
    cold = search_settings(IdentifySearch())
    for parameters in ({"model": MODEL, "fit": []}, MODEL):
        settings = search_settings(IdentifySearch.parse({"warm_start": {"parameters": parameters}}))
        assert settings.warm_start is not None
        assert (settings.screen, settings.starts) < (cold.screen, cold.starts)
    many = IdentifySearch.parse({"warm_start": {"parameters": MODEL}, "particles": 500})
    assert search_settings(many).screen == 500
    with pytest.raises(InvalidInput) as error:
        IdentifySearch.parse({"warm_start": {"parameters": {"links_per_wing": 2}}}, "/search")
    assert error.value.pointer.startswith("/search/warm_start")
