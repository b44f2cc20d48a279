"""Schedules: rates and accelerations belong to their angles, ends are held, tables follow their rows."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from morphcore.errors import InvalidInput
from morphcore.simulate.plan import flight_plan
from morphcore.simulate.schedule import ConstantRate, HingeMotion, Hold, Quadratic, Spline, Tabulated
from morphcore.simulate.time_grid import time_grid
from tests.simulate.flights import example_model, fly_trimmed, sample, sample_schedules

TIMES = np.linspace(0.0, 1.7, 35)
SCHEDULES = {
    "hold": Hold(0.3),
    "constant rate": ConstantRate(0.1, 0.9, 1.0, start_s=0.2, ramp_s=0.15),
    "quadratic": Quadratic(0.0, 1.0, 1.2, start_s=0.1),
    "spline": Spline(np.array([0.2, 0.6, 1.0, 1.5]), np.array([0.0, 0.2, 0.7, 1.0])),
    "tabulated": Tabulated(TIMES, 0.5 * (1.0 - np.cos(2.0 * TIMES))),
}


@pytest.mark.parametrize("name", SCHEDULES)
def test_rates_and_accelerations_are_derivatives(name):
    """Central differences of angle and rate give rate and acceleration, away from their jumps."""
    schedule = SCHEDULES[name]
    probe, times = 1e-6, np.linspace(-0.1, 1.9, 402) + 1.234e-3  # off every knot, ramp end and table row
    here, ahead, behind = (schedule.motion(times + part) for part in (0.0, probe, -probe))
    np.testing.assert_allclose((ahead.angle - behind.angle) / (2 * probe), here.rate, atol=1e-8)
    np.testing.assert_allclose((ahead.rate - behind.rate) / (2 * probe), here.acceleration, atol=1e-8)


@pytest.mark.parametrize("name", SCHEDULES)
def test_angles_never_jump_and_rest_outside(name):
    """Angles are continuous; before the first and after the last instant the hinge is at rest."""
    schedule = SCHEDULES[name]
    fine = schedule.motion(np.linspace(-0.5, 2.5, 30_001))
    assert np.abs(np.diff(fine.angle)).max() < 3e-4  # 0.1 ms at 3 rad/s at most
    outside = schedule.motion([-0.4, 2.4])
    np.testing.assert_array_equal(outside.rate, 0.0)
    np.testing.assert_array_equal(outside.acceleration, 0.0)


@settings(max_examples=50, deadline=None)
@given(
    initial=st.floats(-1.0, 1.0),
    final=st.floats(-1.0, 1.0),
    duration=st.floats(0.1, 5.0),
    share=st.just(0.0) | st.floats(1e-6, 0.5),
)
def test_constant_rate_is_a_trapezium(initial, final, duration, share):
    """The rate is a trapezium whose area is the change of angle; both ends are met, halfway is half done."""
    schedule = ConstantRate(initial, final, duration, start_s=0.3, ramp_s=share * duration)
    ends = schedule.motion([0.3, 0.3 + duration / 2, 0.3 + duration + 1e-9])
    np.testing.assert_allclose(ends.angle, [initial, (initial + final) / 2, final], atol=1e-9)
    plateau = (final - initial) / (duration * (1.0 - share))
    assert ends.rate[1] == pytest.approx(plateau, abs=1e-9)
    inside = schedule.motion(0.3 + duration * np.linspace(0.001, 0.999, 57))
    assert np.abs(inside.rate).max() <= abs(plateau) + 1e-9


def test_quadratic_is_the_papers():
    """One radian in two seconds, quadratic: Lambda = t^2 / 4."""
    t = np.linspace(0.0, 1.99, 20)
    motion = Quadratic(0.0, 1.0, 2.0).motion(t)
    np.testing.assert_allclose(motion.angle, t**2 / 4, atol=1e-15)
    np.testing.assert_allclose(motion.acceleration, 0.5, atol=1e-15)


def test_spline_meets_its_knots_at_rest():
    """The clamped spline goes through its knots and starts and ends without rate."""
    schedule = SCHEDULES["spline"]
    motion = schedule.motion(schedule.knot_time_s)
    np.testing.assert_allclose(motion.angle, schedule.knot_angle_rad, atol=1e-14)
    np.testing.assert_allclose(motion.rate[[0, -1]], 0.0, atol=1e-12)


def test_a_table_of_a_parabola_follows_it():
    """The angle is right to a third of what straight lines would miss, the rate to half of what steps would.

    Plain Akima slopes would be exact here; the modified ones give that up for corners without overshoot.
    """
    for rows in (21, 41, 81):
        times = np.linspace(0.0, 1.0, rows)
        schedule = Tabulated(times, 0.2 + 0.3 * times - 0.7 * times**2)
        step, inner = times[1], np.linspace(times[3], times[-4], 301)
        motion = schedule.motion(inner)
        sagitta = 1.4 * step**2 / 8
        assert np.abs(motion.angle - (0.2 + 0.3 * inner - 0.7 * inner**2)).max() < sagitta / 3
        assert np.abs(motion.rate - (0.3 - 1.4 * inner)).max() < 0.5 * 1.4 * step


class SmoothRamp:
    """The morph of the sample flights: one radian at a rate that rises and falls as 3 s^2 - 2 s^3."""

    def __init__(self, duration_s):
        self.duration_s, self.rate = duration_s, 1.0 / (duration_s - 0.1)

    def motion(self, time_s):
        """The motion, written out."""
        t = np.asarray(time_s) - 0.2

        def up(begin):
            s, late = np.clip((t - begin) / 0.1, 0.0, 1.0), np.maximum(t - begin - 0.1, 0.0)
            return 0.1 * (s**3 - s**4 / 2) + late, 3 * s**2 - 2 * s**3, (6 * s - 6 * s**2) / 0.1

        rise, fall = up(0.0), up(self.duration_s - 0.1)
        return HingeMotion(*(self.rate * (a - b) for a, b in zip(rise, fall, strict=True)))


def test_tables_do_as_well_as_the_schedule_they_tabulate():
    """The quickest sample flown along its table and along its own formula: as near as halved steps.

    The stages lie half-way between the table's rows, where interpolation is at its worst.
    """
    model, flown = example_model(3), sample("train_rate_0.8")
    grid, exact = time_grid(flown.time_s), SmoothRamp(1.25)
    np.testing.assert_allclose(exact.motion(flown.time_s).angle, flown.sweep_right, atol=1e-6)
    formula = fly_trimmed(model, flight_plan(model, [exact, exact], grid)).euler
    table = fly_trimmed(model, flight_plan(model, sample_schedules("train_rate_0.8"), grid)).euler
    halved = fly_trimmed(model, flight_plan(model, [exact, exact], grid.halved())).euler[::2]
    print(np.abs(formula - table).max(), np.abs(formula - halved).max())
    assert np.abs(formula - table).max() < np.abs(formula - halved).max()


def test_a_table_keeps_its_rows_and_its_flat_parts():
    """Every row is met; where the table is flat the hinge is at rest, without overshoot next to a corner."""
    times = np.linspace(0.0, 2.0, 41)
    angles = np.clip(times - 0.5, 0.0, 1.0)
    schedule = Tabulated(times, angles)
    np.testing.assert_allclose(schedule.motion(times).angle, angles, atol=1e-15)
    rest = np.linspace(0.0, 0.45, 91)  # flat, except for the last row next to the corner
    np.testing.assert_allclose(schedule.motion(rest).angle, 0.0, atol=1e-15)
    np.testing.assert_allclose(schedule.motion(rest).rate, 0.0, atol=1e-13)
    everywhere = schedule.motion(np.linspace(0.0, 2.0, 4001)).angle
    assert everywhere.min() >= -1e-15
    assert everywhere.max() <= 1.0 + 1e-15


def test_a_table_that_never_moves_is_a_hold():
    """A constant column needs no interpolation."""
    motion = Tabulated(np.array([0.0, 0.5, 2.0]), np.full(3, 0.4)).motion([0.3, 1.0])
    np.testing.assert_array_equal(motion.angle, 0.4)
    np.testing.assert_array_equal(motion.rate, 0.0)


@pytest.mark.parametrize(
    ("duration", "ramp", "field"), [(0.0, 0.0, "duration_s"), (1.0, 0.6, "ramp_s"), (1.0, -0.1, "ramp_s")]
)
def test_impossible_ramps_are_refused(duration, ramp, field):
    """The error names the field."""
    with pytest.raises(InvalidInput) as caught:
        ConstantRate(0.0, 1.0, duration, ramp_s=ramp)
    assert caught.value.pointer == f"/schedule/{field}"
