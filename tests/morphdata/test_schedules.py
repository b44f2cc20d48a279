"""Schedules from documents: what they mean, and what is refused where."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from morphcore.errors import InvalidInput
from morphcore.simulate.request import simulation_from_document
from morphcore.simulate.schedule import ConstantRate, Hold, Quadratic, Spline, Tabulated, scheduled
from morphdata.aircraft import EXAMPLE_AIRCRAFT, Aircraft
from morphdata.schedules import AnySchedule, Schedules
from morphdata.simulate import EXAMPLE_SIMULATION, SimulateRequest

Document = dict[str, Any]

HOLD = {"kind": "hold", "angle_rad": 0.3}
RATE = {"kind": "constant_rate", "final_rad": 1.0, "duration_s": 2.0}
SPLINE = {"kind": "spline", "knot_time_s": [0.0, 1.0, 2.0], "knot_angle_rad": [0.0, 0.5, 0.6]}
TABLE = {"kind": "tabulated", "time_s": [0.0, 1.0, 2.0], "angle_rad": [0.0, 0.5, 0.6]}


def given(document: Any) -> AnySchedule:
    """The schedule of both sides that a document describes."""
    both = Schedules.parse({"both": document}, "/schedules").both
    assert both is not None
    return both


TIMES = np.linspace(-0.5, 3.0, 141)


@pytest.mark.parametrize(
    ("document", "schedule"),
    [
        (HOLD, Hold(0.3)),
        ({"kind": "hold"}, Hold(0.0)),
        (RATE, ConstantRate(0.0, 1.0, 2.0, start_s=0.0, ramp_s=0.1)),
        (
            RATE | {"initial_rad": 0.2, "start_s": 0.3, "ramp_s": 0.0},
            ConstantRate(0.2, 1.0, 2.0, start_s=0.3, ramp_s=0.0),
        ),
        (
            {"kind": "quadratic", "final_rad": 1.0, "duration_s": 2.0, "start_s": 0.1},
            Quadratic(0.0, 1.0, 2.0, start_s=0.1),
        ),
        (SPLINE, Spline(np.array([0.0, 1.0, 2.0]), np.array([0.0, 0.5, 0.6]))),
        (TABLE, Tabulated(np.array([0.0, 1.0, 2.0]), np.array([0.0, 0.5, 0.6]))),
    ],
)
def test_a_document_moves_as_its_schedule(document: dict[str, Any], schedule: Any) -> None:
    """Each kind gives the angle, rate and acceleration of the schedule of that name."""
    read, meant = scheduled(given(document)).motion(TIMES), schedule.motion(TIMES)
    for name in ("angle", "rate", "acceleration"):
        np.testing.assert_array_equal(getattr(read, name), getattr(meant, name))


def test_a_rate_is_the_mean_rate() -> None:
    """0.5 rad/s from 0.2 to 1.0 rad and back takes 1.6 s, ramps included, either way round."""
    for initial, final in ((0.2, 1.0), (1.0, 0.2)):
        document = {"kind": "constant_rate", "initial_rad": initial, "final_rad": final, "rate_rad_s": 0.5}
        schedule = scheduled(given(document))
        before, end = schedule.motion([1.59, 1.6]).angle
        assert end == pytest.approx(final, abs=1e-12)
        assert abs(before - final) > 1e-5
        assert np.mean(np.diff(schedule.motion([0.0, 1.6]).angle)) / 1.6 == pytest.approx(
            (final - initial) / 1.6
        )


@pytest.mark.parametrize(
    ("document", "pointer"),
    [
        ([], "/s"),
        ({}, "/s"),
        ({"kind": "spiral"}, "/s"),
        (HOLD | {"angle_deg": 3.0}, "/s/angle_deg"),
        ({"kind": "hold", "angle_rad": 45.0}, "/s/angle_rad"),
        ({"kind": "constant_rate", "duration_s": 1.0}, "/s/final_rad"),
        ({"kind": "constant_rate", "final_rad": 1.0}, "/s/duration_s"),
        (RATE | {"rate_rad_s": 0.5}, "/s/rate_rad_s"),
        (RATE | {"duration_s": 0.0}, "/s/duration_s"),
        (RATE | {"duration_s": float("inf")}, "/s/duration_s"),
        (RATE | {"ramp_s": 1.5}, "/s/ramp_s"),
        (RATE | {"start_s": -1.0}, "/s/start_s"),
        ({"kind": "constant_rate", "final_rad": 1.0, "rate_rad_s": 1e-9}, "/s/rate_rad_s"),
        ({"kind": "constant_rate", "final_rad": 0.0, "rate_rad_s": 0.5}, "/s/final_rad"),
        ({"kind": "quadratic", "final_rad": 1.0}, "/s/duration_s"),
        (SPLINE | {"knot_time_s": [0.0]}, "/s/knot_time_s"),
        (SPLINE | {"knot_time_s": [0.0, 1.0]}, "/s/knot_angle_rad"),
        (SPLINE | {"knot_time_s": [0.0, 1.0, 1.0]}, "/s/knot_time_s/2"),
        (SPLINE | {"knot_angle_rad": [0.0, None, 1.0]}, "/s/knot_angle_rad/1"),
        (SPLINE | {"knot_angle_rad": [0.0, 30.0, 60.0]}, "/s/knot_angle_rad/1"),
        (SPLINE | {"knot_angle_rad": "steep"}, "/s/knot_angle_rad"),
        (TABLE | {"time_s": [0.0, 1.0], "angle_rad": [0.0, 1.0]}, "/s/time_s"),
        (TABLE | {"time_s": [0.0, 2.0, 1.0]}, "/s/time_s/2"),
        (TABLE | {"knot_time_s": [0.0]}, "/s/knot_time_s"),
    ],
)
def test_what_is_wrong_is_pointed_at(document: Any, pointer: str) -> None:
    """A schedule that makes no sense is refused with a pointer to the field or row, and a hint."""
    with pytest.raises(InvalidInput) as caught:
        given(document)
    assert caught.value.pointer == pointer.replace("/s", "/schedules/both", 1)
    assert caught.value.hint


def aircraft(*words: str, tail: bool = False) -> Document:
    """The example with wings whose hinges have these axes, and with a tail that has an incidence hinge."""
    wings = []
    for wing in EXAMPLE_AIRCRAFT["surfaces"]:
        place = wing["hinge"]["position_m"]
        hinges = [{"position_m": place, "axis": axis} for axis in words]
        wings.append({**wing, "hinge": None, "hinges": hinges} if words else {**wing})
    tails = [
        {**wing, "name": f"{wing['side']} tail", "span_m": 1.0, "flexible": False, "hinges": None}
        | {"hinge": {"position_m": [-2.0, wing["hinge"]["position_m"][1], 0.0], "axis": "y"}}
        for wing in EXAMPLE_AIRCRAFT["surfaces"]
    ]
    return EXAMPLE_AIRCRAFT | {"surfaces": [*wings, *(tails if tail else ())]}


def refusals(schedules: Any, of: Document) -> list[tuple[str, str, str]]:
    """Code, pointer and hint of every fault."""
    with pytest.raises(InvalidInput) as caught:
        SimulateRequest.parse({**EXAMPLE_SIMULATION, "aircraft": of, "schedules": schedules})
    return [(fault.code, fault.pointer, fault.hint) for fault in caught.value.faults]


@pytest.mark.parametrize("key", ["both", "left"])
def test_one_history_never_turns_two_unlike_hinges(key: str) -> None:
    """The case of the issue: a wing that sweeps and a tail with an incidence hinge, and `both` for them."""
    ((code, pointer, hint),) = refusals({key: RATE}, aircraft("z", tail=True))
    assert (code, pointer) == ("ambiguous_drive", f"/schedules/{key}")
    for name in (
        "sweep_left",
        "sweep_right",
        "incidence_left",
        "incidence_right",
        "sweep, incidence for both",
    ):
        assert name in hint


def test_keys_are_drives_words_and_sides() -> None:
    """The wings sweep and the left one folds; the tail holds its angle."""
    drives = Aircraft.parse(aircraft("z", "x", tail=True)).drives
    given = Schedules.parse({"sweep": RATE, "fold_left": HOLD})
    sweep, fold = given.given.values()
    assert given.by_drive(drives) == {"sweep_right": sweep, "sweep_left": sweep, "fold_left": fold}
    assert given.keys_by_drive(drives)["sweep_left"] == "sweep"
    assert Schedules.parse(given.model_dump(exclude_none=True)) == given


def test_documents_of_old_move_what_they_moved() -> None:
    """``both`` moves both sides; ``left`` and ``right`` each their own, be it sweep or another one kind."""
    for axis, word in (("z", "sweep"), ("x", "fold")):
        drives = Aircraft.parse(aircraft(axis)).drives
        both, each = Schedules.parse({"both": HOLD}), Schedules.parse({"left": HOLD, "right": RATE})
        assert both.by_drive(drives) == {f"{word}_right": both.both, f"{word}_left": both.both}
        assert each.by_drive(drives) == {f"{word}_right": each.right, f"{word}_left": each.left}
        assert Schedules.parse({"both": None, "left": HOLD}).by_drive(drives) == {f"{word}_left": each.left}


@pytest.mark.parametrize("schedules", [{}, {"left": HOLD}, {"sweep_right": RATE}])
def test_what_nobody_moves_holds_its_angle(schedules: Document) -> None:
    """A drive without a schedule is no fault."""
    SimulateRequest.parse({**EXAMPLE_SIMULATION, "schedules": schedules})


@pytest.mark.parametrize(
    ("document", "code", "pointers"),
    [
        ({"both": HOLD, "right": HOLD}, "given_twice", ["/schedules/right"]),
        ({"sweep": HOLD, "sweep_left": HOLD}, "given_twice", ["/schedules/sweep_left"]),
        ({"both": HOLD, "middle": HOLD}, "unknown_drive", ["/schedules/middle"]),
        ({"swep": RATE}, "unknown_drive", ["/schedules/swep"]),
        ({"sweep": {"kind": "hold", "angle_rad": "x"}}, "float_type", ["/schedules/sweep/angle_rad"]),
        ({"sweep": {"kind": "hold", "angel_rad": 0.1}}, "unknown_field", ["/schedules/sweep/angel_rad"]),
        ({"both": RATE | {"final_rad": 1.4}}, "sweep_out_of_range", ["/schedules/both/final_rad"]),
        (
            {"left": SPLINE | {"knot_angle_rad": [0.0, 1.5, 1.6]}, "right": RATE},
            "sweep_out_of_range",
            ["/schedules/left/knot_angle_rad/1"],
        ),
        (RATE, "missing", ["/schedules"]),
        ("hold", "model_type", ["/schedules"]),
    ],
)
def test_what_moves_nothing_or_too_much_is_refused(document: Any, code: str, pointers: list[str]) -> None:
    """Two schedules of a drive, a drive that is none, an angle beyond a range: refused by its key."""
    found = refusals(document, EXAMPLE_AIRCRAFT)
    assert [pointer for _, pointer, _ in found] == pointers
    assert found[0][0] == code
    assert all(hint for _, _, hint in found)


def test_a_misspelt_key_is_guessed() -> None:
    """By name; a schedule in place of schedules by drive gets a specific hint."""
    ((_, _, hint),) = refusals({"swep_left": RATE}, EXAMPLE_AIRCRAFT)
    assert "Did you mean 'sweep_left'?" in hint
    assert "sweep" in refusals(RATE, EXAMPLE_AIRCRAFT)[0][2]


def test_every_drive_has_its_own_range() -> None:
    """Fold to 1.25 rad is beyond the hinges' range, sweep is not; degrees are guessed."""
    document = aircraft("z", "x")
    for wing in document["surfaces"]:
        wing["hinges"][1]["max_rad"] = 1.2
    ((code, pointer, hint),) = refusals({"sweep": HOLD, "fold": HOLD | {"angle_rad": 1.25}}, document)
    assert (code, pointer) == ("angle_out_of_range", "/schedules/fold/angle_rad")
    assert "'right wing'" in hint
    ((_, _, hint),) = refusals({"fold": HOLD | {"angle_rad": 45.0}}, document)
    assert "degrees" in hint


def test_hinges_keep_their_range_between_knots() -> None:
    """A spline in range at all knots but beyond it between them is refused by the flight, by its side.

    The left hinge goes to 1.3 rad; the spline through 1.29 rad at 1.0 s and 1.6 s overshoots between the two.
    """
    knots = {"kind": "spline", "knot_time_s": [0.0, 1.0, 1.6, 2.0], "knot_angle_rad": [0.0, 1.29, 1.29, 0.5]}
    request = {**EXAMPLE_SIMULATION, "schedules": {"left": knots, "right": RATE}}
    with pytest.raises(InvalidInput) as caught:
        simulation_from_document(request).result()
    assert caught.value.pointer == "/schedules/left"
    assert "t = 1.0" in caught.value.message
