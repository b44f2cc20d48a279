"""Which drives trim: those named, and the aircraft's own controls for roll and yaw in asymmetric flight."""

from __future__ import annotations

import math

import pytest

from morphdata.trim_drives import PITCH, ROLL, YAW, ControlPart, balancing, own_control

UP = 0.5 * math.pi


def pair(word: str, dihedral: float, *, opposed: bool) -> list[ControlPart]:
    """A control on both sides."""
    left = -1.0 if opposed else 1.0
    return [
        ControlPart(f"{word}_right", "right", dihedral, 1.0),
        ControlPart(f"{word}_left", "left", dihedral, left),
    ]


FLAPS, AILERONS = pair("flap", 0.0, opposed=False), pair("aileron", 0.05, opposed=True)
RUDDER = [ControlPart("rudder", "right", UP, 1.0)]


@pytest.mark.parametrize(
    ("parts", "roll", "yaw"),
    [
        ([], None, None),
        (FLAPS + AILERONS + RUDDER, "aileron", "rudder"),
        (FLAPS, None, None),
        (pair("rudder", UP, opposed=True), None, "rudder"),
        (pair("brake", UP, opposed=False), None, None),
        (pair("ruddervator", 0.7, opposed=True) + AILERONS, "ruddervator", None),
        ([ControlPart("tab", "left", 0.0, 1.0)], None, None),
    ],
)
def test_the_aircrafts_own_controls(parts: list[ControlPart], roll: str | None, yaw: str | None) -> None:
    """Ailerons work against each other; a rudder is on a fin, on a pair of fins against each other too."""
    assert own_control(ROLL, parts) == roll
    assert own_control(YAW, parts) == yaw


def test_what_is_named_comes_first() -> None:
    """A control that trims in pitch is not taken for roll; "auto" means none in symmetric flight."""
    parts = AILERONS + pair("spoiler", 0.0, opposed=True) + RUDDER
    drives = [part.drive for part in parts]
    auto = {PITCH: None, ROLL: "auto", YAW: "auto"}
    assert balancing(auto, drives, parts, asymmetric=False) == {}
    assert balancing(auto, drives, parts, asymmetric=True) == {ROLL: "aileron", YAW: "rudder"}
    odd = auto | {PITCH: "aileron_left", YAW: "none"}
    assert balancing(odd, drives, parts, asymmetric=True) == {PITCH: "aileron_left", ROLL: "spoiler"}
    assert balancing(auto | {YAW: "rudder"}, drives, parts, asymmetric=False) == {YAW: "rudder"}
