"""Documents of telescoping wings and of schedules in metres: what they say, and what is refused."""

from __future__ import annotations

import copy
from typing import Any

import pytest

from morphcore import simulate
from morphcore.geometry.aircraft import Aircraft as Resolved
from morphdata.aircraft import Aircraft
from morphdata.environment import Environment, Gust, Turbulence
from morphdata.faults import InvalidInput
from morphdata.lattice import Lattice
from morphdata.optimize import Limits, Morph, goal_faults
from morphdata.samples import InlineSample
from morphdata.schedules import Schedules
from morphdata.simulate import SimulateRequest
from morphdata.telescopes import span_line_B
from tests.simulate.telescoped import FLIGHT, extended, telescoped


def changed(**fields: Any) -> dict[str, Any]:
    """Return the aircraft with other fields of the right outer panel's hinge."""
    document = copy.deepcopy(telescoped())
    document["surfaces"][1]["hinges"][0].update(fields)
    return {**document, "surfaces": document["surfaces"][:2]}


def test_names_and_units_of_drives() -> None:
    """A prismatic hinge along the span is `span`, with its side; its range is in metres."""
    drives = Aircraft.parse(telescoped()).drives
    assert list(drives) == ["span_right", "span_left"]
    drive = drives["span_left"]
    assert (drive.word, drive.unit, drive.low, drive.high, drive.held) == ("span", "m", 0.0, 1.0, 0.0)


@pytest.mark.parametrize(
    ("fields", "pointer", "word"),
    [
        ({"max_rad": 1.0}, "/surfaces/1/hinges/0/max_rad", "max_m"),
        ({"angle_rad": 0.1}, "/surfaces/1/hinges/0/angle_rad", "extension_m"),
        ({"max_m": None}, "/surfaces/1/hinges/0/max_m", "largest extension"),
        ({"max_m": 1.2}, "/surfaces/1/hinges/0/max_m", "0.2 m outboard"),
        ({"min_m": -0.8}, "/surfaces/1/hinges/0/min_m", "visible"),
        ({"extension_m": 1.1}, "/surfaces/1/hinges/0/extension_m", "max_m"),
        ({"axis": "x"}, "/surfaces/1/hinges/0/name", "Name its drive"),
        ({"kind": "revolute", "max_m": None, "extension_m": None}, "/surfaces/1/hinges/0/axis", "sweep"),
    ],
)
def test_hinges_that_cannot_be(fields: dict[str, Any], pointer: str, word: str) -> None:
    """The refusal names the field and what to give instead."""
    with pytest.raises(InvalidInput) as refusal:
        Aircraft.parse(changed(**fields))
    faults = [fault for fault in refusal.value.faults if fault.pointer == pointer]
    assert faults
    assert word in f"{faults[0].detail} {faults[0].hint}"


def test_controls_on_a_sliding_panel_are_refused() -> None:
    """Controls belong on the inner panel."""
    flap = {"name": "flap", "from": 0.1, "to": 0.5, "chord_fraction": 0.2}
    with pytest.raises(InvalidInput, match="telescopes"):
        Aircraft.parse(telescoped(controls=[flap]))


def test_line_of_the_span_is_that_of_the_numerics() -> None:
    """Sweep, dihedral and incidence turn it as they turn the surface."""
    document = telescoped()
    for surface in document["surfaces"]:
        surface.update(sweep_rad=0.3, dihedral_rad=0.2, incidence_rad=0.1)
        surface.pop("hinges", None)
    surfaces = Aircraft.parse(document).surfaces
    for surface, resolved in zip(surfaces, Resolved.of(document).surfaces, strict=True):
        expected = resolved.span_sign * resolved.rest_R_BW[:, 1]
        assert span_line_B(surface) == pytest.approx(expected.tolist(), abs=1e-15)


@pytest.mark.parametrize(
    ("schedule", "pointer", "hint"),
    [
        ({"kind": "hold", "angle_rad": 0.2}, "/schedules/span/angle_rad", "extension_m"),
        (
            {"kind": "constant_rate", "final_rad": 0.2, "duration_s": 1.0},
            "/schedules/span/initial_rad",
            "initial_m",
        ),
    ],
)
def test_angles_for_a_drive_that_slides(schedule: dict[str, Any], pointer: str, hint: str) -> None:
    """Requests and the library refuse them, with the name to use."""
    drives = Aircraft.parse(telescoped()).drives
    faults = list(Schedules.parse({"span": schedule}).drive_faults(drives))
    assert (faults[0].code, faults[0].pointer) == ("wrong_unit", pointer)
    assert hint in faults[0].hint
    with pytest.raises(InvalidInput, match=hint):
        simulate(telescoped(), FLIGHT, {"span": schedule}, duration_s=0.1)


def test_extension_beyond_the_range() -> None:
    """The fault is in metres and names the range."""
    drives = Aircraft.parse(telescoped()).drives
    (fault,) = Schedules.parse({"span": extended(0.0, 1.3)}).drive_faults(drives)
    assert fault.code == "extension_out_of_range"
    assert "from 0 to 1 m" in fault.hint


SAMPLE = {
    "name": "flight",
    "time_s": [0.0, 0.1, 0.2],
    "phi_rad": [0.0] * 3,
    "theta_rad": [0.1] * 3,
    "psi_rad": [0.0] * 3,
}


def test_samples_in_metres() -> None:
    """`span_m` moves both sides; radians, and a range left, are refused."""
    drives = Aircraft.parse(telescoped()).drives
    sample = InlineSample.parse({**SAMPLE, "span_m": [0.0, 0.1, 0.2]})
    assert sample.drives == {"span": [0.0, 0.1, 0.2]}
    assert list(sample.drive_faults(drives)) == []
    (fault,) = InlineSample.parse({**SAMPLE, "span_rad": [0.0, 0.1, 0.2]}).drive_faults(drives)
    assert (fault.code, fault.pointer) == ("wrong_unit", "/span_rad")
    (fault,) = InlineSample.parse({**SAMPLE, "span_m": [0.0, 0.1, 2.0]}).drive_faults(drives)
    assert fault.pointer == "/span_m/2"


def test_morphs_in_metres() -> None:
    """A morph ends at an angle or at an extension, and limits are in its unit."""
    morph = Morph(initial_m=0.1, final_m=0.5, duration_s=1.0)
    assert (morph.unit, morph.begin, morph.end) == ("m", 0.1, 0.5)
    with pytest.raises(InvalidInput, match="angles and extensions"):
        Morph(final_m=0.5, final_rad=0.5, duration_s=1.0)
    with pytest.raises(InvalidInput, match="final_m"):
        Morph(duration_s=1.0)
    (fault,) = goal_faults(morph, Limits(max_rate_rad_s=1.0))
    assert "max_rate_m_s" in fault.hint


def test_apparent_mass_of_a_telescoping_wing_is_refused() -> None:
    """It would have to follow the visible span."""
    with pytest.raises(InvalidInput, match="telescopes"):
        simulate(telescoped(), {**FLIGHT, "apparent_mass": True}, {}, duration_s=0.1)


@pytest.mark.parametrize(
    ("options", "pointer"),
    [
        ({"environment": Environment(gust=Gust(amplitude_m_s=1.0, gradient_m=5.0))}, "/environment"),
        ({"environment": Environment(turbulence=Turbulence(sigma_high_m_s=1.0))}, "/environment"),
        ({"lattice": Lattice(shape="trimmed")}, "/model/lattice/shape"),
        ({"channels": ["p", "section_cl"]}, "/channels/1"),
        ({"channels": ["drive_force"], "model": "flexible"}, "/channels/0"),
    ],
)
def test_what_does_not_follow_the_visible_span_is_refused(options: dict[str, Any], pointer: str) -> None:
    """By library and service alike; steady flights and whole loads of the same aircraft fly."""
    with pytest.raises(InvalidInput, match="telescopes") as refusal:
        simulate(telescoped(), FLIGHT, {}, duration_s=0.1, **options)
    assert [fault.pointer for fault in refusal.value.faults] == [pointer]
    kind = {"kind": options.get("model", "rigid")}
    request: dict[str, Any] = {
        "aircraft": telescoped(),
        "flight": FLIGHT,
        "schedules": {},
        "duration_s": 0.1,
        "model": kind,
    }
    if "lattice" in options:
        kind["lattice"] = options["lattice"].model_dump(exclude_none=True)
    if "environment" in options:
        request["environment"] = options["environment"].model_dump(exclude_none=True)
    if "channels" in options:
        request["channels"] = options["channels"]
    with pytest.raises(InvalidInput) as refusal:
        SimulateRequest.parse(request)
    assert pointer in [fault.pointer for fault in refusal.value.faults]


def test_limits_of_the_panels_lift_are_refused() -> None:
    """Those of its strips change with the extension."""
    document = telescoped()
    document["surfaces"][1]["cl_max"] = 1.4
    with pytest.raises(InvalidInput, match="telescopes") as refusal:
        Aircraft.parse(document)
    assert refusal.value.faults[0].pointer == "/surfaces/1/cl_max"


def test_an_inner_panel_does_not_bend() -> None:
    """The outer one would not follow its tip."""
    document = telescoped()
    document["surfaces"][0]["flexible"] = True
    with pytest.raises(InvalidInput, match="does not follow") as refusal:
        Aircraft.parse(document)
    assert refusal.value.faults[0].pointer == "/surfaces/0/flexible"
