"""Numbers of documents and settings: whole ones out of numpy, and hints about the bound that was broken."""

from __future__ import annotations

import inspect
import json
import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from morphcore.errors import InvalidInput, MorphError
from morphcore.geometry.fields import whole_number
from morphcore.identify import Identification, SearchSettings
from morphcore.identify.study import Study
from morphcore.models.equivalent import chain_model
from morphcore.models.flexible import flexible_model
from morphcore.optimise.settings import ScheduleSettings
from morphcore.search.evolution import EvolutionSettings
from morphcore.search.swarm import SwarmSettings
from morphcore.simulate.request import simulation_from_document
from morphdata.identify import EquivalentModel
from morphdata.lattice import Lattice
from morphdata.optimize import OptimizeRequest
from tests.app.request_documents import optimize_document, simulate_document
from tests.identify.flights import example, reference_aircraft, reference_flight, shortened

WHOLE = [np.int64(3), np.uint8(3), 3.0, np.float32(3.0), 3]
NOT_WHOLE = [3.5, True, np.True_, "3", None, np.nan, np.inf, [3]]


@pytest.mark.parametrize("value", WHOLE, ids=lambda value: type(value).__name__)
def test_whole_numbers_are_pythons_own(value: Any) -> None:
    """Out of numpy and with a point: equal to what was given, and fit for JSON."""
    number = whole_number(value, "seed")
    assert (number, type(number)) == (3, int)


@pytest.mark.parametrize("value", NOT_WHOLE, ids=repr)
def test_other_things_are_no_whole_numbers(value: Any) -> None:
    """A fraction, a truth value, a text, nothing, and what is no number."""
    with pytest.raises(InvalidInput) as caught:
        whole_number(value, "seed")
    assert (caught.value.pointer, caught.value.hint) == ("/seed", "give a whole number")


SETTINGS: list[tuple[type, dict[str, Any]]] = [
    (SearchSettings, {}),
    (SwarmSettings, {}),
    (EvolutionSettings, {}),
    (ScheduleSettings, {}),
]


@pytest.mark.parametrize(("kind", "rest"), SETTINGS, ids=lambda item: getattr(item, "__name__", ""))
def test_settings_take_numpys_whole_numbers(kind: type, rest: dict[str, Any]) -> None:
    """Every count and seed of every settings value; a fraction is refused by the field's name."""
    names = [name for name, item in inspect.signature(kind).parameters.items() if item.annotation == "int"]
    assert names
    for name in names:
        made = kind(**{**rest, name: np.int64(5)})
        assert type(getattr(made, name)) is int
        assert made == kind(**{**rest, name: 5}) == kind(**{**rest, name: 5.0})
        with pytest.raises(InvalidInput, match=name):
            kind(**{**rest, name: 5.5})


def test_a_search_with_numpys_numbers_ends_in_json() -> None:
    """Seed, links and counts out of numpy: the result is a document, equal to that of Python's numbers."""
    flight = shortened(example("rate_0.8"), 60)

    def searched(whole: Any) -> dict[str, Any]:
        run = Identification(
            reference_aircraft(),
            reference_flight(),
            [flight],
            EquivalentModel(
                links_per_wing=whole(2),
                lattice=Lattice(chordwise=whole(1), spanwise=whole(4)),
                step_s=0.01,
            ),
            SearchSettings(method="pso", seed=whole(3), swarm=SwarmSettings(whole(4), whole(1))),
        )
        *_, last = run.steps()
        document = run.best_so_far(last.checkpoint).to_document()
        return {"model": document["model"], "fit": document["fit"], "seed": document["search"]["seed"]}

    assert json.loads(json.dumps(searched(np.int64))) == json.loads(json.dumps(searched(int)))
    links = Study(reference_aircraft(), reference_flight(), [flight], links=np.arange(1, 3)).links
    assert json.dumps(links) == "[1, 2]"


def test_numbers_of_links_and_elements_are_whole() -> None:
    """As they are for the functions that make models of them."""
    aircraft, flight = reference_aircraft(), reference_flight()
    lattice = Lattice(chordwise=1, spanwise=4)
    assert type(chain_model(aircraft, flight, np.int8(2), lattice).links) is int
    assert flexible_model(aircraft, flight, elements=2.0, lattice=lattice) is not None  # type: ignore[arg-type]
    for make, hint in (
        (lambda: chain_model(aircraft, flight, 17, lattice), "it must be at most 16"),
        (lambda: chain_model(aircraft, flight, 0, lattice), "it must be at least 1"),
        (lambda: flexible_model(aircraft, flight, elements=0, lattice=lattice), "it must be at least 1"),
        (lambda: flexible_model(aircraft, flight, elements=1.5, lattice=lattice), "give a whole number"),  # type: ignore[arg-type]
    ):
        with pytest.raises(InvalidInput) as caught:
            make()
        assert caught.value.hint == hint


HUGE = (1e300, -1e300)


def numbers_in(document: Any, pointer: str = "") -> list[str]:
    """Pointers to all numbers of a document, of long lists the first."""
    if isinstance(document, dict):
        return [found for name, item in document.items() for found in numbers_in(item, f"{pointer}/{name}")]
    if isinstance(document, list):
        return numbers_in(document[0], f"{pointer}/0") if document else []
    return [pointer] if isinstance(document, int | float) and not isinstance(document, bool) else []


def with_value(document: Any, pointer: str, value: Any) -> Any:
    """A copy with another value at a place."""
    copy = json.loads(json.dumps(document))
    place: Any = copy
    *parents, name = pointer.split("/")[1:]
    for parent in parents:
        place = place[int(parent)] if isinstance(place, list) else place[parent]
    place[int(name) if isinstance(place, list) else name] = value
    return copy


READERS = [
    (simulate_document(), simulation_from_document),
    (optimize_document(), OptimizeRequest.parse),
]


@pytest.mark.parametrize("value", HUGE)
def test_no_hint_of_any_number_speaks_of_infinity(value: float) -> None:
    """Every number of a simulation's and an optimisation's request, far too large and far too small."""
    refused = 0
    for document, read in READERS:
        for pointer in numbers_in(document):
            error = refusal(read, with_value(document, pointer, value))
            if error is not None:
                refused += 1
                assert not re.search(r"\b(inf|nan)\b", str(error)), (pointer, str(error))
                assert error.hint, pointer
    assert refused > 20


def refusal(read: Callable[[Any], object], document: Any) -> MorphError | None:
    """The error that reading a document ends in; None where it goes well."""
    try:
        read(document)
    except MorphError as error:
        return error
    return None
