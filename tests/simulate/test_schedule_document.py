"""Schedules from documents: what they mean, and what is refused where."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from morphcore.errors import InvalidInput
from morphcore.simulate.schedule import ConstantRate, Hold, Quadratic, Spline, Tabulated
from morphcore.simulate.schedule_document import (
    require_hinge_ranges,
    schedule_from_document,
    schedules_from_document,
)
from tests.models.chains import example_aircraft

HOLD = {"kind": "hold", "angle_rad": 0.3}
RATE = {"kind": "constant_rate", "final_rad": 1.0, "duration_s": 2.0}
SPLINE = {"kind": "spline", "knot_time_s": [0.0, 1.0, 2.0], "knot_angle_rad": [0.0, 0.5, 0.6]}
TABLE = {"kind": "tabulated", "time_s": [0.0, 1.0, 2.0], "angle_rad": [0.0, 0.5, 0.6]}
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
    read, meant = schedule_from_document(document, "/s").motion(TIMES), schedule.motion(TIMES)
    for name in ("angle", "rate", "acceleration"):
        np.testing.assert_array_equal(getattr(read, name), getattr(meant, name))


def test_a_rate_is_the_mean_rate() -> None:
    """0.5 rad/s from 0.2 to 1.0 rad and back takes 1.6 s, ramps included, either way round."""
    for initial, final in ((0.2, 1.0), (1.0, 0.2)):
        document = {"kind": "constant_rate", "initial_rad": initial, "final_rad": final, "rate_rad_s": 0.5}
        schedule = schedule_from_document(document, "/s")
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
        ({}, "/s/kind"),
        ({"kind": "spiral"}, "/s/kind"),
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
        ({"kind": "constant_rate", "final_rad": 0.0, "rate_rad_s": 0.5}, "/s/rate_rad_s"),
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
        schedule_from_document(document, "/s")
    assert caught.value.pointer == pointer
    assert caught.value.hint


def test_one_for_both_sides_or_one_for_each() -> None:
    """``both`` moves both sides; ``left`` and ``right`` each their own."""
    aircraft = example_aircraft()
    both = schedules_from_document({"both": HOLD}, aircraft)
    each = schedules_from_document({"left": HOLD, "right": RATE}, aircraft)
    assert both == {"left": Hold(0.3), "right": Hold(0.3)}
    assert each == {"left": Hold(0.3), "right": ConstantRate(0.0, 1.0, 2.0)}


@pytest.mark.parametrize(
    ("document", "pointer"),
    [
        ({}, "/schedules/left"),
        ({"left": HOLD}, "/schedules/right"),
        ({"both": HOLD, "right": HOLD}, "/schedules/right"),
        ({"both": HOLD, "middle": HOLD}, "/schedules/middle"),
        ({"both": {"kind": "hold", "angle_rad": "x"}}, "/schedules/both/angle_rad"),
        ("hold", "/schedules"),
    ],
)
def test_sides_are_told_apart(document: Any, pointer: str) -> None:
    """A side without a schedule or with two, or no side at all, is refused by name."""
    with pytest.raises(InvalidInput) as caught:
        schedules_from_document(document, example_aircraft())
    assert caught.value.pointer == pointer
    assert caught.value.hint


def test_a_side_without_a_hinge_needs_no_schedule() -> None:
    """Where only the right wing is hinged, the left side may stay out; it holds still."""
    right, left = example_aircraft().surfaces
    aircraft = replace(example_aircraft(), surfaces=(right, replace(left, hinge=None)))
    assert schedules_from_document({"right": RATE}, aircraft)["left"] == Hold(0.0)


def test_hinges_keep_their_range() -> None:
    """A spline within its range at all knots but beyond it between them is refused, on its own side.

    The left hinge goes to 1.3 rad; the spline through 1.29 rad at 1.0 s and 1.6 s overshoots between the two.
    """
    aircraft = example_aircraft()
    knots = {"kind": "spline", "knot_time_s": [0.0, 1.0, 1.6, 2.0], "knot_angle_rad": [0.0, 1.29, 1.29, 0.5]}
    schedules = schedules_from_document({"left": knots, "right": RATE}, aircraft)
    pointers = {"left": "/schedules/left", "right": "/schedules/right"}
    require_hinge_ranges(aircraft, schedules, np.array(knots["knot_time_s"]), pointers)
    with pytest.raises(InvalidInput) as caught:
        require_hinge_ranges(aircraft, schedules, np.linspace(0.0, 2.0, 2001), pointers)
    assert caught.value.pointer == "/schedules/left"
    assert "t = 1.0" in caught.value.message
