"""What all flights of a sample share: the time grid and the lattice along the morph."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from morphcore.aero.environment import MovingAir, Wave
from morphcore.aero.operator import lattice_operator
from morphcore.errors import InvalidInput
from morphcore.multibody.kernels.hinge import H_ORIGIN, H_TWIST
from morphcore.simulate.common_path import common_path
from morphcore.simulate.plan import flight_plan, start_at
from morphcore.simulate.schedule import ConstantRate, Hold
from morphcore.simulate.time_grid import STEP_S, time_grid
from morphcore.simulate.wake import wake_direction
from tests.geometry.rehinged import fixed
from tests.models.chains import Parabola, odd_aircraft, small_model
from tests.simulate.flights import example_model, fly_trimmed, sample, sample_plan, sample_schedules


@settings(max_examples=50, deadline=None)
@given(rows=st.integers(3, 400), spacing=st.floats(1e-4, 0.5), start=st.floats(-5.0, 5.0))
def test_even_samples_are_hit(rows, spacing, start):
    """Evenly spaced output times are rows of the grid, whose steps are no longer than they may be."""
    times = start + spacing * np.arange(rows)
    grid = time_grid(times)
    np.testing.assert_allclose(grid.times_s[grid.at], times, atol=1e-9)
    assert grid.step_s <= STEP_S * (1.0 + 1e-8)
    assert grid.steps * (grid.step_s + 1e-12) >= times[-1] - times[0]
    assert grid.steps == grid.at[-1]


def test_rounded_times_count_as_even():
    """Times written with few digits still are one grid."""
    times = np.round(np.arange(50) / 30.0, 8)
    assert time_grid(times).at is not None


def test_uneven_samples_get_a_grid_of_their_own():
    """Where rows are unevenly spaced the grid covers them, and the attitude is to be interpolated."""
    times = np.array([0.0, 0.013, 0.02, 0.05, 0.0503])
    grid = time_grid(times)
    assert grid.at is None
    assert grid.times_s[0] == 0.0
    assert grid.times_s[-1] == pytest.approx(times[-1], abs=1e-15)
    assert grid.step_s <= STEP_S


def table_error(model, schedules, duration_s):
    """Largest error of the interpolated operators, relative to the largest element of each kind of row."""
    plan = flight_plan(model, schedules, time_grid(np.linspace(0.0, duration_s, 41), duration_s / 40))
    worst = 0.0
    wake = wake_direction(start_at(model, plan.angles[0], "trim").alpha)
    for row in range(plan.grid.steps + 1):
        matrices, strips = plan.table.between(row, row + 1)
        exact = lattice_operator(model.lattice, plan.angles[row], wake_direction_B=wake)
        worst = max(worst, float(np.abs(strips[0] - exact.strips).max()))
        for kind in range(5):
            found, right = matrices[0, kind:-4:5], exact.matrix[kind:-4:5]
            worst = max(worst, float(np.abs(found - right).max() / np.abs(right).max()))
    return worst


@pytest.mark.parametrize(
    "schedules",
    [
        (ConstantRate(0.0, 1.2, 2.0), ConstantRate(0.0, 1.2, 2.0)),
        (ConstantRate(0.0, 0.6, 1.5), ConstantRate(0.5, 0.0, 1.0, start_s=0.7)),
        (Hold(0.3), Hold(0.5)),
    ],
)
def test_interpolated_lattice(schedules):
    """Cubics between nodes 25 mrad apart give the lattice of any angle to 1e-3 of its largest elements.

    The worst are where an inboard wake leg passes control points, and corners of the path. What that does
    to a flight is the next test's.
    """
    assert table_error(example_model(3), schedules, 2.0) < 1e-3


def test_the_tables_spacing_does_not_show_in_the_attitude():
    """A table five times finer moves the attitude of the quickest sample by less than 2e-6 rad."""
    model, name = example_model(2), "train_asymmetric"
    plan = sample_plan(model, name, STEP_S)
    fine = flight_plan(model, sample_schedules(name), plan.grid, node_spacing_rad=0.005)
    difference = fly_trimmed(model, plan).euler - fly_trimmed(model, fine).euler
    assert np.abs(difference).max() < 2e-6


def test_hinge_rows_are_the_surfaces_motion():
    """Pose, twist and origin of odd hinges: differences in time of the pose give the twist rows.

    R' = R [w x], p' = R v, with [w; v] the twist in link axes.
    """
    rng = np.random.default_rng(0)
    model = small_model(odd_aircraft(rng), example_model(1).flight, 2)
    probe = 1e-6
    schedules = [Parabola(*row) for row in rng.normal(size=(len(model.aircraft.hinges), 3)) * [0.4, 1.0, 2.0]]
    rows = flight_plan(model, schedules, time_grid(np.array([0.0, probe, 2 * probe]))).hinges
    for s, surface in enumerate(model.aircraft.surfaces):
        R, p, twist = rows[:, s, :9].reshape(-1, 3, 3), rows[:, s, H_ORIGIN:], rows[1, s, H_TWIST:H_ORIGIN]
        spin = R[1].T @ (R[2] - R[0]) / (2 * probe)
        np.testing.assert_allclose([spin[2, 1], spin[0, 2], spin[1, 0]], twist[:3], atol=1e-8)
        np.testing.assert_allclose(R[1].T @ (p[2] - p[0]) / (2 * probe), twist[3:], atol=1e-8)
        if not surface.hinges:
            np.testing.assert_array_equal(twist, 0.0)


def test_mean_accelerations_add_up_to_the_rates():
    """Over a whole sample the mean accelerations make the rates exactly, jumps of the schedule included."""
    model = example_model(1)
    plan = sample_plan(model, "train_rate_0.8", STEP_S)
    twists = plan.hinges[:, :, H_TWIST:H_ORIGIN]
    summed = twists[0] + plan.grid.step_s * np.cumsum(plan.mean_accelerations, axis=0)
    np.testing.assert_allclose(summed, twists[1:], atol=1e-12)
    assert plan.rates.max() == pytest.approx(1.0 / 1.15, rel=2e-3)  # a radian, ramps inside its 1.25 s
    assert sample("train_rate_0.8").time_s.size == plan.grid.at.size


def test_a_gust_reaches_the_flight():
    """A gust along the path is in the plan and moves the aircraft; before it nothing happens."""
    model = example_model(1)
    grid = time_grid(np.linspace(0.0, 0.4, 41))
    airspeed = model.flight.airspeed_m_s
    gust = Wave(0.21 * airspeed, 1.0, np.tile([0.0, 0.0, -3.0], (100, 1)), np.zeros(1), np.ones(1))
    calm = flight_plan(model, [Hold(), Hold()], grid)
    blown = flight_plan(model, [Hold(), Hold()], grid, air=MovingAir((gust,), airspeed))
    still, moved = fly_trimmed(model, calm).states, fly_trimmed(model, blown).states
    before = grid.times_s < 0.2
    np.testing.assert_allclose(moved[before], still[before], atol=1e-12)
    assert moved[-1, 0, 12] < still[-1, 0, 12] - 0.03  # carried up


def test_an_aircraft_without_hinges_has_a_plan():
    """Nothing moves: one lattice, and surfaces at rest where they are."""
    aircraft = odd_aircraft(np.random.default_rng(1))
    aircraft = replace(aircraft, surfaces=tuple(fixed(surface) for surface in aircraft.surfaces))
    plan = flight_plan(
        small_model(aircraft, example_model(1).flight, 1), [], time_grid(np.array([0.0, 0.01, 0.02]))
    )
    assert plan.angles.shape == (3, 0)
    assert plan.table.matrices.shape[0] == 1
    np.testing.assert_array_equal(plan.hinges[:, :, H_TWIST:H_ORIGIN], 0.0)
    np.testing.assert_array_equal(plan.mean_accelerations, np.zeros((2, 5, 6)))


def test_a_common_path_gives_the_plans_of_single_schedules():
    """A table over a range of angles serves any schedule within it: same hinges, same lattice to 1e-4.

    Both tables interpolate, between other nodes; what each is off by is the test above's.
    """
    model = example_model(2)
    path = common_path(model, 0.0, 1.0)
    grid = time_grid(np.linspace(0.0, 2.0, 41))
    schedules = [ConstantRate(0.0, 1.0, 1.5), ConstantRate(1.0, 0.2, 1.0), Hold(0.4)]
    for schedule in schedules:
        alone = flight_plan(model, [schedule, schedule], grid, wake_alpha=path.begin.alpha)
        shared = path.plan(model, schedule, grid)
        assert shared.table.matrices is path.matrices
        for name in ("angles", "rates", "accelerations", "hinges", "wind_N"):
            np.testing.assert_array_equal(getattr(shared, name), getattr(alone, name))
        for own, common in zip(alone.table.between(0, 41), shared.table.between(0, 41), strict=True):
            assert np.abs(own - common).max() < 1e-4 * np.abs(own).max()


def test_a_common_path_refuses_what_leaves_its_range():
    """Beyond its nodes a table would extrapolate; a schedule that goes there is an error."""
    path = common_path(example_model(1), 0.0, 0.5)
    with pytest.raises(InvalidInput):
        path.plan(example_model(1), ConstantRate(0.0, 0.51, 1.0), time_grid(np.linspace(0.0, 1.0, 11)))


@pytest.mark.parametrize("times", [0, 1, 3])
def test_a_coarser_plan_is_the_plan_of_the_coarser_grid(times):
    """Motion, wind and lattice at steps and middles are those of a new plan."""
    model = example_model(2)
    schedules = [ConstantRate(0.0, 0.5, 0.4, start_s=0.1, ramp_s=0.1), Hold()]
    grid = time_grid(np.linspace(0.0, 0.6, 61))
    anew = flight_plan(model, schedules, grid)
    found = flight_plan(model, schedules, grid.halved(times)).coarser(grid)
    assert found.grid.steps == grid.steps
    np.testing.assert_array_equal(found.grid.at, grid.at)
    for name in ("angles", "rates", "accelerations", "hinges", "wind_N"):
        np.testing.assert_allclose(getattr(found, name), getattr(anew, name), rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(found.middle.hinges, anew.middle.hinges, rtol=1e-12, atol=1e-12)
    np.testing.assert_array_equal(found.middle.wind_N, anew.middle.wind_N)
    for table, right in ((found.table, anew.table), (found.middle.table, anew.middle.table)):
        assert table.position.size == right.position.size
        scale = np.abs(right.matrices).max()
        for one, other in zip(table.between(0, 60), right.between(0, 60), strict=True):
            np.testing.assert_allclose(one, other, atol=1e-9 * scale)


def test_a_plan_holds_no_grid_between_its_steps():
    """Steps that are not among the plan's are refused."""
    model = example_model(2)
    plan = flight_plan(model, [Hold(), Hold()], time_grid(np.linspace(0.0, 0.6, 61)))
    with pytest.raises(ValueError, match="not among"):
        plan.coarser(time_grid(np.linspace(0.0, 0.6, 21), 0.03))
    with pytest.raises(ValueError, match="not among"):
        plan.coarser(time_grid(np.linspace(0.0, 0.6, 41)))
