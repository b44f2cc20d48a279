"""Renamed fields: either spelling builds the same document, and two different values are refused."""

from __future__ import annotations

from typing import Any

import pytest

from morphdata.aircraft import Section
from morphdata.base import Document
from morphdata.faults import InvalidInput
from morphdata.identified import AeroCorrections
from morphdata.identify import Bounds, EquivalentModel, IdentifyRequest
from morphdata.parameters import EXAMPLE_PARAMETERS, Corrections, Parameters
from morphdata.renamed import under_both_spellings

AERO: dict[str, Any] = {"lift_factor": 1.1, "profile_drag": 0.01, "lag_s": 0.004}
SECTION: dict[str, Any] = {
    "ei_flap_n_m2": 1.0,
    "gj_n_m2": 2.0,
    "mass_per_length_kg_m": 3.0,
    "inertia_per_length_kg_m": [0.1, 0.1, 0.2],
}
Case = tuple[type[Document], dict[str, Any], str, str, Any, Any]  # rest, both names, two values
CASES: list[Case] = [
    (Corrections, AERO, "centre_shift_m", "ac_offset_m", 0.02, 0.03),
    (Bounds, {}, "centre_shift_m", "ac_offset_m", [-0.1, 0.1], [-0.2, 0.2]),
    (Section, SECTION, "ei_lag_n_m2", "ei_edge_n_m2", 4.0, 5.0),
]
EACH = pytest.mark.parametrize("case", CASES)


@EACH
def test_either_spelling_builds_the_same_document(case: Case) -> None:
    """Parsed or constructed; a result carries both, and may be given unchanged."""
    model, rest, former, name, value, _ = case
    wanted = model.parse({**rest, name: value})
    assert getattr(wanted, name) == value
    assert model.parse({**rest, former: value}) == wanted
    assert model(**{**rest, former: value}) == wanted
    assert model.parse({**rest, former: value, name: value}) == wanted
    assert former not in wanted.model_dump()


@EACH
def test_two_values_of_one_field_are_refused(case: Case) -> None:
    """The former name is the one to leave out."""
    model, rest, former, name, value, other = case
    with pytest.raises(InvalidInput) as caught:
        model.parse({**rest, former: value, name: other}, "/here")
    [fault] = caught.value.faults
    assert (fault.code, fault.pointer) == ("given_twice", f"/here/{former}")
    assert name in fault.detail


@EACH
def test_a_fault_is_named_as_it_was_sent(case: Case) -> None:
    """A pointer must lead into the client's own document, whichever spelling that has."""
    model, rest, former, name, _, _ = case
    for spelling in (former, name):
        with pytest.raises(InvalidInput) as caught:
            model.parse({**rest, spelling: "much"})
        assert [fault.pointer for fault in caught.value.faults] == [f"/{spelling}"]


def test_a_fault_across_fields_is_named_as_it_was_sent() -> None:
    """Bounds are checked by today's names and refused under the name in the document."""
    with pytest.raises(InvalidInput) as caught:
        EquivalentModel.parse({"bounds": {"centre_shift_m": [0.1, -0.1]}}, "/model")
    assert caught.value.faults[0].pointer == "/model/bounds/centre_shift_m/0"


@pytest.mark.parametrize(
    "names", [["centre_shift_m"], ["ac_offset_m"], ["ac_offset_m", "centre_shift_m"]], ids=str
)
def test_a_list_of_corrections_takes_both(names: list[str]) -> None:
    """As a result lists them; the same name twice is still refused."""
    model = EquivalentModel.parse({"aero_coefficients": ["lag_s", *names]})
    assert model.aero_coefficients == ["lag_s", "ac_offset_m"]
    with pytest.raises(InvalidInput, match="twice"):
        EquivalentModel.parse({"aero_coefficients": ["centre_shift_m", "centre_shift_m"]})


def test_a_result_of_today_and_one_of_yesterday_are_taken_whole() -> None:
    """Version 0.1 wrote the former name alone, 0.2 writes both."""
    both = EXAMPLE_PARAMETERS | {"aero": under_both_spellings(EXAMPLE_PARAMETERS["aero"])}
    former = EXAMPLE_PARAMETERS | {"aero": {k: v for k, v in both["aero"].items() if k != "ac_offset_m"}}
    assert Parameters.parse(both) == Parameters.parse(former) == Parameters.parse(EXAMPLE_PARAMETERS)
    stored = AeroCorrections.model_validate(former["aero"])
    assert stored.model_dump(exclude_none=True) == both["aero"]


def test_the_schema_marks_former_names_as_deprecated() -> None:
    """Of what is sent; the corrections of a list are named in both spellings."""
    defined = IdentifyRequest.model_json_schema()["$defs"]
    for model, former, name in (
        ("Corrections", "centre_shift_m", "ac_offset_m"),
        ("Bounds", "centre_shift_m", "ac_offset_m"),
        ("Section", "ei_lag_n_m2", "ei_edge_n_m2"),
    ):
        properties = defined[model]["properties"]
        assert properties[former]["deprecated"] is True
        assert "deprecated" not in properties[name]
        assert not {former, name} & set(defined[model].get("required", ()))
