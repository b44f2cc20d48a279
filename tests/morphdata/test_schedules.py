"""Schedules from documents: what they mean, and what is refused where."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from morphcore.errors import InvalidInput
from morphcore.simulate.request import simulation_from_document
from morphcore.simulate.schedule import ConstantRate, Hold, Quadratic, Spline, Tabulated, scheduled
from morphdata.aircraft import EXAMPLE_AIRCRAFT
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


def refused(document: Any, aircraft: Document) -> list[str]:
    """Pointers to what is wrong with schedules for an aircraft."""
    request = {**EXAMPLE_SIMULATION, "aircraft": aircraft, "schedules": document}
    with pytest.raises(InvalidInput) as caught:
        SimulateRequest.parse(request)
    assert caught.value.hint
    return [fault.pointer for fault in caught.value.faults]


def test_one_for_both_sides_or_one_for_each() -> None:
    """``both`` moves both sides; ``left`` and ``right`` each their own."""
    both, each = Schedules.parse({"both": HOLD}), Schedules.parse({"left": HOLD, "right": RATE})
    assert both.of_side("left") == both.of_side("right") == ("both", both.both)
    assert (each.of_side("left"), each.of_side("right")) == (("left", each.left), ("right", each.right))


@pytest.mark.parametrize(
    ("document", "pointers"),
    [
        ({}, ["/schedules/left", "/schedules/right"]),
        ({"left": HOLD}, ["/schedules/right"]),
        ({"both": HOLD, "right": HOLD}, ["/schedules/both"]),
        ({"both": HOLD, "middle": HOLD}, ["/schedules/middle"]),
        ({"both": {"kind": "hold", "angle_rad": "x"}}, ["/schedules/both/angle_rad"]),
        ({"both": RATE | {"final_rad": 1.4}}, ["/schedules/both/final_rad"] * 2),
        (
            {"left": SPLINE | {"knot_angle_rad": [0.0, 1.5, 1.6]}, "right": RATE},
            ["/schedules/left/knot_angle_rad/1"],
        ),
        ("hold", ["/schedules"]),
    ],
)
def test_sides_are_told_apart(document: Any, pointers: list[str]) -> None:
    """A side without a schedule or with two, no side at all, an angle beyond a hinge: refused by name."""
    assert refused(document, EXAMPLE_AIRCRAFT) == list(dict.fromkeys(pointers))


def test_a_side_without_a_hinge_needs_no_schedule() -> None:
    """Where only the right wing is hinged, the left side may stay out."""
    right, left = EXAMPLE_AIRCRAFT["surfaces"]
    fixed = {name: value for name, value in left.items() if name != "hinge"} | {
        "position_m": [0.0, -0.35, 0.0]
    }
    aircraft = EXAMPLE_AIRCRAFT | {"surfaces": [right, fixed]}
    request = {**EXAMPLE_SIMULATION, "aircraft": aircraft, "schedules": {"right": RATE}}
    assert SimulateRequest.parse(request).schedules.of_side("left") is None


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
