"""Control surfaces in documents: names of their drives, and what is refused at which pointer."""

from __future__ import annotations

from typing import Any

import pytest

from morphdata.aircraft import EXAMPLE_AIRCRAFT, Aircraft
from morphdata.drive_keys import resolved
from morphdata.faults import InvalidInput
from morphdata.flight import EXAMPLE_FLIGHT
from morphdata.identify import EXAMPLE_REQUEST, IdentifyRequest
from morphdata.optimize import EXAMPLE_OPTIMIZATION, OptimizeRequest
from morphdata.parameters import EXAMPLE_PARAMETERS
from morphdata.simulate import SimulateRequest
from tests.aero.controlled import tailed

Document = dict[str, Any]
FLAP = {"name": "flap", "from": 0.1, "to": 0.5, "chord_fraction": 0.3}


def with_controls(right: list[Document], left: list[Document] | None = None) -> Document:
    """The example's wings with controls; the same on the left unless given."""
    wings = [
        {**wing, **({"controls": own} if own else {})}
        for wing, own in zip(
            EXAMPLE_AIRCRAFT["surfaces"], (right, right if left is None else left), strict=True
        )
    ]
    return {**EXAMPLE_AIRCRAFT, "surfaces": wings}


def test_names_have_sides_where_both_sides_have_the_control() -> None:
    """`flap` of both wings is two drives and a word; a control of one side alone is its name."""
    both = Aircraft.parse(with_controls([FLAP])).drives
    assert list(both) == ["sweep_right", "sweep_left", "flap_right", "flap_left"]
    assert resolved(["flap"], both) == ({"flap_right": "flap", "flap_left": "flap"}, [])
    alone = Aircraft.parse(with_controls([FLAP], [])).drives
    assert list(alone) == ["sweep_right", "sweep_left", "flap"]
    assert alone["flap"].controls == ((0, 0),)
    assert alone["flap"].hinges == ()
    assert resolved(["flap"], alone) == ({"flap": "flap"}, [])


def test_old_keys_of_sides_mean_hinges() -> None:
    """`left` and `both` turn hinges, as ever; without hinges they are refused with the names there are."""
    drives = Aircraft.parse(with_controls([FLAP])).drives
    assert resolved(["both"], drives) == ({"sweep_right": "both", "sweep_left": "both"}, [])
    _, faults = resolved(["left"], Aircraft.parse(tailed()).drives)
    assert "elevator_left" in faults[0].hint


def test_a_document_reads_back() -> None:
    """`from` is a field like others, in Python and in JSON."""
    aircraft = Aircraft.parse(with_controls([FLAP]))
    again = Aircraft.model_validate_json(aircraft.model_dump_json())
    assert again == aircraft
    control = again.surfaces[0].all_controls[0]
    assert (control.start, control.stop) == (0.1, 0.5)
    assert control.model_dump()["from"] == 0.1
    schema = Aircraft.model_json_schema()["$defs"]["Control"]
    assert schema["required"] == ["from", "to", "name", "chord_fraction"]


@pytest.mark.parametrize(
    ("controls", "pointer", "code"),
    [
        ([{**FLAP, "from": 0.5}], "/surfaces/0/controls/0/from", "range_upside_down"),
        ([{**FLAP, "to": 1.2}], "/surfaces/0/controls/0/to", "less_than_equal"),
        ([{**FLAP, "chord_fraction": 0.01}], "/surfaces/0/controls/0/chord_fraction", "greater_than_equal"),
        ([{**FLAP, "min_rad": 0.2, "max_rad": 0.1}], "/surfaces/0/controls/0/min_rad", "range_upside_down"),
        ([{**FLAP, "angle_rad": 0.7}], "/surfaces/0/controls/0/angle_rad", "angle_out_of_range"),
        (
            [FLAP, {**FLAP, "name": "tab", "from": 0.4, "to": 0.6}],
            "/surfaces/0/controls/1/from",
            "controls_overlap",
        ),
        ([FLAP, {**FLAP, "from": 0.6, "to": 0.7}], "/surfaces/0/controls/1/name", "name_not_unique"),
        ([{**FLAP, "name": "sweep"}], "/surfaces/0/controls/0/name", "name_not_unique"),
        ([{**FLAP, "name": "flap_left"}], "/surfaces/0/controls/0/name", "wrong_side"),
        ([{**FLAP, "name": "theta"}], "/surfaces/0/controls/0/name", "name_reserved"),
        ([{**FLAP, "mirrored": "symmetric"}], "/surfaces/0/controls/0/mirrored", "unknown_field"),
        ([{key: FLAP[key] for key in FLAP if key != "from"}], "/surfaces/0/controls/0/from", "missing"),
    ],
)
def test_mistakes_are_named(controls: list[Document], pointer: str, code: str) -> None:
    """Every mistake has its pointer and a hint."""
    with pytest.raises(InvalidInput) as caught:
        Aircraft.parse(with_controls(controls))
    fault = caught.value.faults[0]
    assert (fault.pointer, fault.code) == (pointer, code)
    assert fault.hint


def test_controls_of_one_name_are_alike() -> None:
    """One history moves them all, so what it means may not differ."""
    with pytest.raises(InvalidInput) as caught:
        Aircraft.parse(with_controls([FLAP], [{**FLAP, "mirror": "antisymmetric"}]))
    assert caught.value.faults[0].pointer == "/surfaces/1/controls/0/mirror"


def request(**schedules: Document) -> Document:
    """A flight of the tailed aircraft."""
    flight = {"airspeed_m_s": 20.0, "air_density_kg_m3": 1.225}
    model = {"kind": "rigid"}
    return {"aircraft": tailed(), "flight": flight, "model": model, "schedules": schedules, "duration_s": 1.0}


def test_schedules_of_controls() -> None:
    """A word moves both sides; what the aircraft lacks, and angles beyond the limits, are refused."""
    parsed = SimulateRequest.parse(request(elevator={"kind": "hold", "angle_rad": 0.1}))
    assert set(parsed.schedules.by_drive(parsed.aircraft.drives)) == {"elevator_left", "elevator_right"}
    with pytest.raises(InvalidInput) as caught:
        SimulateRequest.parse(request(elevator={"kind": "hold", "angle_rad": 0.6}))
    (fault,) = caught.value.faults
    assert fault.pointer == "/schedules/elevator/angle_rad"
    assert "from -0.5 to 0.5 rad" in fault.hint
    assert "control" in fault.hint
    with pytest.raises(InvalidInput) as caught:
        SimulateRequest.parse(request(rudder={"kind": "hold", "angle_rad": 0.1}))
    assert "elevator" in caught.value.hint
    assert caught.value.pointer == "/schedules/rudder"


def test_samples_and_morphs_of_controls() -> None:
    """Samples have columns of controls; a morph names the one that moves, without a limit of its torque."""
    aircraft = with_controls([{**FLAP, "name": "elevator"}])
    sample = {**EXAMPLE_REQUEST["samples"][0]}
    rows = len(sample["time_s"])
    drives = [key for key in sample if key.startswith("sweep")]
    for key in drives:
        del sample[key]
    sample["elevator_rad"] = [0.01] * rows
    parsed = IdentifyRequest.parse({**EXAMPLE_REQUEST, "aircraft": aircraft, "samples": [sample]})
    assert parsed.inline_samples()[0].drives == {"elevator": [0.01] * rows}
    beyond = {**sample, "elevator_rad": [0.01] * (rows - 1) + [0.51]}
    with pytest.raises(InvalidInput) as caught:
        IdentifyRequest.parse({**EXAMPLE_REQUEST, "aircraft": aircraft, "samples": [beyond]})
    assert caught.value.pointer == f"/samples/0/elevator_rad/{rows - 1}"
    morph = {"drive": "elevator", "final_rad": 0.2, "duration_s": 2.0}
    optimisation = {
        **EXAMPLE_OPTIMIZATION,
        "aircraft": aircraft,
        "flight": EXAMPLE_FLIGHT,
        "model": {"parameters": EXAMPLE_PARAMETERS},
        "morph": morph,
    }
    OptimizeRequest.parse(optimisation)
    for change, pointer in (
        ({"morph": {**morph, "final_rad": 0.6}}, "/morph/final_rad"),
        ({"morph": {key: morph[key] for key in ("final_rad", "duration_s")}}, "/morph/drive"),
        ({"limits": {"max_hinge_torque_nm": 10.0}}, "/limits/max_hinge_torque_nm"),
    ):
        with pytest.raises(InvalidInput) as caught:
            OptimizeRequest.parse({**optimisation, **change})
        assert caught.value.pointer == pointer
