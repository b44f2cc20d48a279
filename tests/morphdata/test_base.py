"""Laws of every document: how it is built, and how it says what is wrong."""

from __future__ import annotations

import pickle
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from morphdata.aircraft import EXAMPLE_AIRCRAFT, Aircraft, Fuselage, Surface
from morphdata.base import Document
from morphdata.drives import Hinge
from morphdata.faults import Fault, InvalidInput
from morphdata.lattice import Lattice

WING = EXAMPLE_AIRCRAFT["surfaces"][0]


def pointers(caught: pytest.ExceptionInfo[InvalidInput]) -> list[str]:
    """Where the faults are, in their order."""
    return [fault.pointer for fault in caught.value.faults]


def test_python_and_json_build_the_same_document() -> None:
    """Documents in documents, tuples, arrays and whole numbers of numpy are taken as JSON's values are."""
    hinge = Hinge(position_m=(0.0, 0.35, 0.0), axis="z")
    wings = [Surface(**(surface | {"hinge": hinge})) for surface in EXAMPLE_AIRCRAFT["surfaces"][:1]]
    parsed = Aircraft.parse(EXAMPLE_AIRCRAFT | {"surfaces": [WING]})
    built = Aircraft(
        name=EXAMPLE_AIRCRAFT["name"], fuselage=Fuselage(**EXAMPLE_AIRCRAFT["fuselage"]), surfaces=wings
    )
    assert built == parsed
    assert Hinge(position_m=np.array([0.0, 0.35, 0.0]), axis="z") == hinge  # type: ignore[arg-type]
    for whole in (np.int64(3), np.uint8(3), 3.0):
        assert type(Lattice(chordwise=whole).chordwise) is int  # type: ignore[arg-type]


@pytest.mark.parametrize("value", [3.5, True, np.True_, "3", np.nan, [3]], ids=repr)
def test_what_is_not_whole_is_refused(value: Any) -> None:
    """A fraction, a truth value, a text, no number."""
    with pytest.raises(InvalidInput) as caught:
        Lattice(chordwise=value)
    assert pointers(caught) == ["/chordwise"]


def test_every_fault_is_named_the_misspelt_field_first() -> None:
    """Independent faults come together; a misspelt name is not hidden behind the field that it stands for."""
    wing = {name: value for name, value in WING.items() if name not in ("chord_m", "thickness_m")}
    document = EXAMPLE_AIRCRAFT | {"surfaces": [wing | {"chrod_m": 0.3, "thicknes_m": 0.1, "span_m": -3.0}]}
    with pytest.raises(InvalidInput) as caught:
        Aircraft.parse(document, "/aircraft")
    at = "/aircraft/surfaces/0"
    assert pointers(caught) == [f"{at}/chrod_m", f"{at}/thicknes_m", f"{at}/span_m", f"{at}/thickness_m"]
    assert "'chord_m'" in caught.value.hint
    assert caught.value.message == caught.value.faults[0].detail


def test_a_constructor_refuses_as_parse_does() -> None:
    """The same faults, and they survive pickling."""
    with pytest.raises(InvalidInput) as parsed:
        Surface.parse(WING | {"span_m": -1.0, "side": "top"})
    with pytest.raises(InvalidInput) as built:
        Surface(**(WING | {"span_m": -1.0, "side": "top"}))
    assert built.value.faults == parsed.value.faults
    again = pickle.loads(pickle.dumps(built.value))  # noqa: S301 - our own
    assert (again.faults, str(again)) == (built.value.faults, str(built.value))


class _Inner(Document):
    low: float
    high: float

    def faults(self) -> Iterator[Fault]:
        if self.low > self.high:
            yield Fault("range_upside_down", "Upside down.", "/low", "Swap them.")
            yield Fault("range_upside_down", "Upside down.", "/high", "Swap them.")


class _Outer(Document):
    ranges: list[_Inner]

    def faults(self) -> Iterator[Fault]:
        if len(self.ranges) > 2:
            yield Fault("too_many", "Too many.", "/ranges", "Give fewer.")


def test_a_model_says_what_is_wrong_across_its_fields() -> None:
    """Pointers of an inner model are relative to it; the outer one is checked once those are right."""
    upside_down, right = {"low": 2.0, "high": 1.0}, {"low": 1.0, "high": 2.0}
    with pytest.raises(InvalidInput) as caught:
        _Outer.parse({"ranges": [right, upside_down, upside_down]}, "/x")
    assert pointers(caught) == [f"/x/ranges/{row}/{name}" for row in (1, 2) for name in ("low", "high")]
    with pytest.raises(InvalidInput) as caught:
        _Outer.parse({"ranges": [right] * 3})
    assert [fault.code for fault in caught.value.faults] == ["too_many"]
