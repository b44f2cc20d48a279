"""Flights of candidates: as the simulator flies, with the torques of the hinges, on any number of threads."""

from __future__ import annotations

import threading

import numpy as np
import pytest

from morphcore.aero.kernels.loads import L_LIFT
from morphcore.models.equivalent import chain_model, physical_guess
from morphcore.models.kernels.layout import LINKS_C
from morphcore.optimise import flights as module
from morphcore.optimise.flights import DIVERGED_ANGLE, Flown, MorphFlights, sample_times
from morphcore.simulate.common_path import common_path
from morphcore.simulate.schedule import ConstantRate, Spline
from morphcore.simulate.time_grid import STEP_S
from morphcore.stopping import Interrupted
from morphcore.threads import thread_count, use_threads
from morphdata.optimize import Weights
from tests.identify.flights import reference_aircraft, reference_flight
from tests.simulate.flights import fly

SCHEDULES = (
    Spline(np.array([0.0, 0.2, 0.35, 0.6]), np.array([0.0, 0.1, 0.2, 0.4])),
    ConstantRate(0.0, 0.4, 0.6, ramp_s=0.02),
    Spline(np.array([0.0, 0.3, 0.5, 0.6]), np.array([0.0, 0.1, 0.3, 0.4])),
)


def morph_flights(step_s):
    """Two links a wing over nine tenths of a second."""
    model = chain_model(reference_aircraft(), reference_flight(), 2)
    return MorphFlights(
        model,
        physical_guess(model),
        common_path(model, 0.0, 0.4),
        sample_times(0.6, 0.3),
        initial_rad=0.0,
        start="trim",
        step_s=step_s,
    )


@pytest.fixture(scope="module")
def flights():
    """Flights at the step that ships."""
    return morph_flights(STEP_S)


def test_departures_are_those_of_the_simulator(flights):
    """The sum over 10 ms rows is what `simulate` gives for the same schedule.

    Both tables of the lattice interpolate between other nodes: 1e-5 of the largest departure.
    """
    flown = flights.fly(SCHEDULES, torque=False)
    for i, schedule in enumerate(SCHEDULES):
        alone = fly(
            reference_aircraft(),
            reference_flight(),
            {"left": schedule, "right": schedule},
            model=physical_guess(flights.model),
            duration_s=0.9,
        ).trajectory
        np.testing.assert_allclose(alone.time_s, flights.times_s, atol=1e-12)
        departure = alone.euler - alone.euler[0]
        assert np.abs(flown.departure[i] - departure).max() < 1e-5 * np.abs(departure).max()
        assert flown.variation[i] == pytest.approx(np.sum(departure**2), rel=1e-4)


def test_a_flight_begins_in_trim_however_the_morph_begins(flights):
    """A morph that accelerates at once and the same after a rest of ten rows fly alike, ten rows apart.

    While nothing moves, trim holds; its Newton iteration leaves 1e-9 rad. A morph that begins with the flight
    meets a step that remembers no slopes yet: that costs a hundred-thousandth of the motion, and a quarter
    of it with half the step.
    """
    at_once = SCHEDULES[0]
    later = Spline(at_once.knot_time_s + 0.1, at_once.knot_angle_rad)
    assert at_once.motion(0.01).acceleration > 1.0
    apart, motion = [], 0.0
    for each in (flights, morph_flights(0.5 * STEP_S)):
        first, second = each.fly([at_once, later], torque=False).departure
        apart.append(np.abs(second[10:] - first[:-10]).max())
        motion = np.abs(first).max()
    assert apart[0] < 1e-5 * motion
    assert apart[1] < apart[0] / 3.0


def test_weights_count_each_angle():
    """J is the weighted sum, the variation the plain one; the errors' squares add up to J."""
    rng = np.random.default_rng(0)
    departure = rng.normal(size=(4, 30, 3))
    flown = Flown(departure, np.zeros((4, 0)), np.zeros(4, dtype=bool))
    weights = Weights(phi=0.5, theta=2.0, psi=0.0)
    expected = np.sum(departure**2 * np.array([0.5, 2.0, 0.0]), axis=(1, 2))
    np.testing.assert_allclose(flown.cost(weights), expected, rtol=1e-12)
    np.testing.assert_allclose(np.sum(flown.errors(weights) ** 2, axis=1), expected, rtol=1e-12)
    np.testing.assert_allclose(flown.variation, np.sum(departure**2, axis=(1, 2)), rtol=1e-12)


def test_torques_come_without_changing_the_flight(flights):
    """With torques requested the departures are bit-identical; the jolt of short ramps shows."""
    plain, full = flights.fly(SCHEDULES, torque=False), flights.fly(SCHEDULES, torque=True)
    np.testing.assert_array_equal(plain.departure, full.departure)
    assert plain.torque.shape == (3, 0)
    assert full.torque.shape == (3, 2 * (flights.grid.steps + 1))
    assert full.peak_torque[1] > 1.5 * full.peak_torque[0]


def test_threads_and_company_change_nothing(flights):
    """A schedule flies the same alone and among others, on one thread or two."""
    threads, flown = thread_count(), []
    try:
        for count in (1, 2):
            use_threads(count)
            flown.append(flights.fly(SCHEDULES, torque=False).departure)
    finally:
        use_threads(threads)
    np.testing.assert_array_equal(flown[0], flown[1])
    alone = flights.fly(SCHEDULES[2:], torque=False).departure
    np.testing.assert_array_equal(alone[0], flown[0][2])


def test_stop_is_asked_between_flights(flights):
    """A stop that turns true ends a batch before its next round."""
    answers = iter([False, True])
    with pytest.raises(Interrupted):
        flights.fly(SCHEDULES * 2, torque=False, stop=lambda: next(answers))


def test_stop_is_asked_within_long_flights(flights, monkeypatch):
    """A flight of many steps is broken off in its midst, by one question at a time."""
    monkeypatch.setattr(module, "LONG_FLIGHT", 10)
    asking, requested = threading.Lock(), []

    def stop():
        assert asking.acquire(blocking=False)
        requested.append(None)
        asking.release()
        return len(requested) > 2

    with pytest.raises(Interrupted):
        flights.fly(SCHEDULES[:2], torque=False, stop=stop)
    assert len(requested) >= 3


def test_a_diverged_flight_is_charged(flights):
    """A flight that leaves the numbers costs much, but not infinity, and its neighbours nothing."""
    wild = flights.constants.rows.copy()
    flights.constants.rows[:, LINKS_C + L_LIFT] = 1e7  # of the innermost link
    try:
        lost = flights.fly(SCHEDULES[:1], torque=False)
    finally:
        flights.constants.rows[:] = wild
    assert lost.diverged.all()
    assert (lost.departure[:, -1] == DIVERGED_ANGLE).all()
    assert np.isfinite(lost.variation).all()


def test_rows_reach_to_the_end_of_the_window():
    """10 ms rows from zero to the end of the settling, also where durations are no whole rows."""
    assert sample_times(2.0, 2.0).size == 401
    assert sample_times(0.3, 0.0)[-1] == pytest.approx(0.3)
    assert sample_times(1.236, 0.5)[-1] == pytest.approx(1.73)
