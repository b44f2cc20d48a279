"""Names of drives, and which history moves which of them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from morphcore.errors import InvalidInput
from morphdata.aircraft import EXAMPLE_AIRCRAFT, Aircraft
from morphdata.drive_keys import resolved
from morphdata.drives import Hinge


def aircraft(**hinges: Any) -> Aircraft:
    """The example with surfaces of other hinges: ``right_wing={"axis": "x"}``; a list is several."""
    surfaces = []
    for name, given in hinges.items():
        side, _ = name.split("_")
        sign = 1.0 if side == "right" else -1.0
        placed = [{"position_m": [0.0, 0.35 * sign, 0.0], **each} for each in np.atleast_1d(given)]
        wing = {**EXAMPLE_AIRCRAFT["surfaces"][0], "name": name, "side": side, "hinge": None}
        surfaces.append({**wing, "hinges": placed})
    return Aircraft.parse({"fuselage": EXAMPLE_AIRCRAFT["fuselage"], "surfaces": surfaces})


def refusal(**hinges: Any) -> tuple[str, str]:
    """Code and pointer of the first fault."""
    with pytest.raises(InvalidInput) as caught:
        aircraft(**hinges)
    fault = caught.value.faults[0]
    return fault.code, fault.pointer


def test_the_old_hinge_is_a_list_of_one() -> None:
    """A document with `hinge` has the drives that its sides always had."""
    drives = Aircraft.parse(EXAMPLE_AIRCRAFT).drives
    assert list(drives) == ["sweep_right", "sweep_left"]
    assert drives["sweep_left"].hinges == ((1, 0),)


def test_a_hinge_is_named_after_its_axis_and_side_unless_it_has_a_name() -> None:
    """The word comes from the axis or the name, the side is appended once."""
    drives = aircraft(
        right_wing=[{"axis": "z"}, {"axis": "x"}],
        left_wing=[{"axis": "z"}, {"axis": "x", "name": "droop"}],
        right_tail={"axis": "y", "name": "elevator"},
        left_tail={"axis": [0.0, 2.0, 0.0], "name": "elevator_left"},
    ).drives
    assert set(drives) == {
        "sweep_right", "fold_right", "sweep_left", "droop_left", "elevator_right", "elevator_left",
    }  # fmt: skip
    assert drives["elevator_left"].word == "elevator"


def test_like_hinges_of_one_name_share_a_drive_within_the_range_of_all() -> None:
    """One history moves both, so it must suit both."""
    shared = aircraft(right_wing={"axis": "z", "max_rad": 1.0}, right_tail={"axis": "z", "min_rad": -0.2})
    drive = shared.drives["sweep_right"]
    assert (drive.surfaces, drive.low, drive.high) == (("right_wing", "right_tail"), -0.2, 1.0)


@pytest.mark.parametrize("side", ["left", "right"])
def test_mirror_images_turn_about_mirrored_axes(side: str) -> None:
    """A rotation vector is an axial vector: in the mirror image of y it keeps its y and loses its signs."""
    for letter in "xyz":
        hinge = Hinge.parse({"axis": letter, "position_m": [0.0, 0.0, 0.0]})
        x, y, z = hinge.axis_B("right")
        assert hinge.axis_B("left") == (-x, y, -z)
    skew = Hinge.parse({"axis": [3, 0, 4], "name": "cant", "position_m": [0.0, 0.0, 0.0]})
    assert skew.axis_B(side) == (0.6, 0.0, 0.8)


@pytest.mark.parametrize(
    ("hinges", "code", "pointer"),
    [
        ({"right_wing": {"axis": [0, 0, 0], "name": "a"}}, "axis_zero", "/surfaces/0/hinges/0/axis"),
        ({"right_wing": {"axis": [0, 1, 1]}}, "missing", "/surfaces/0/hinges/0/name"),
        ({"right_wing": {"axis": "z", "name": "both"}}, "name_reserved", "/surfaces/0/hinges/0/name"),
        ({"right_wing": {"axis": "z", "name": "in_left"}}, "wrong_side", "/surfaces/0/hinges/0/name"),
        (
            {"right_wing": [{"axis": "z", "name": "a"}, {"axis": "x", "name": "a"}]},
            "unlike_hinges",
            "/surfaces/0/hinges/1/name",
        ),
        (
            {"right_wing": {"axis": "z", "angle_rad": 1.4}},
            "angle_out_of_range",
            "/surfaces/0/hinges/0/angle_rad",
        ),
    ],
)
def test_hinges_that_make_no_drives_are_refused(hinges: Any, code: str, pointer: str) -> None:
    """At the hinge, with a code."""
    assert refusal(**hinges) == (code, pointer)


WING = aircraft(right_wing={"axis": "z"}, left_wing={"axis": "z"}).drives
FOLD = aircraft(right_wing={"axis": "x"}, left_wing={"axis": "x"}).drives
BOTH = aircraft(right_wing=[{"axis": "z"}, {"axis": "x"}], left_wing=[{"axis": "z"}, {"axis": "x"}]).drives


@pytest.mark.parametrize(
    ("drives", "keys", "followed"),
    [
        (WING, ["both"], {"sweep_left": "both", "sweep_right": "both"}),
        (WING, ["sweep"], {"sweep_left": "sweep", "sweep_right": "sweep"}),
        (WING, ["left"], {"sweep_left": "left"}),
        (FOLD, ["sweep_left", "right"], {"fold_left": "sweep_left", "fold_right": "right"}),
        (BOTH, ["sweep_left", "fold_right"], {"sweep_left": "sweep_left", "fold_right": "fold_right"}),
        (BOTH, ["fold"], {"fold_left": "fold", "fold_right": "fold"}),
        (aircraft(right_wing={"axis": "z"}).drives, ["left"], {}),
    ],
)
def test_keys_move_drives(drives: Any, keys: list[str], followed: dict[str, str]) -> None:
    """Full names, words of both sides, and the keys of old documents."""
    assert resolved(keys, drives) == (followed, [])


@pytest.mark.parametrize(
    ("drives", "keys", "code", "pointer"),
    [
        (WING, ["fold"], "unknown_drive", "/fold"),
        (BOTH, ["both"], "ambiguous_drive", "/both"),
        (BOTH, ["left"], "ambiguous_drive", "/left"),
        (WING, ["sweep", "sweep_left"], "given_twice", "/sweep_left"),
        (WING, ["both", "right"], "given_twice", "/right"),
    ],
)
def test_keys_that_could_mean_something_else_are_refused(
    drives: Any, keys: list[str], code: str, pointer: str
) -> None:
    """Each fault names the key, and the hint the drives."""
    _, faults = resolved(keys, drives)
    assert [(fault.code, fault.pointer) for fault in faults] == [(code, pointer)]
    assert all(name in faults[0].hint for name in drives) or code == "given_twice"
