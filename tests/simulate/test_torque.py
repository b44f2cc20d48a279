"""Torque of the hinge motors: against the textbook dynamics, and against the work it does in flight."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from morphcore.models.equivalent import lane_constants, physical_guess
from morphcore.simulate.plan import flight_plan
from morphcore.simulate.schedule import ConstantRate, Spline
from morphcore.simulate.time_grid import time_grid
from morphcore.simulate.torque import hinge_torques
from tests.models.chains import (
    airless,
    example_flight,
    instant,
    motion_of,
    odd_aircraft,
    random_batch,
    random_hinges,
    random_state,
    small_model,
)
from tests.models.test_chain import WIND_N, drag_wrenches
from tests.oracles.chain_tree import chain_tree
from tests.oracles.dynamics import energy, hinge_torque
from tests.simulate.flights import example_model, fly_free, fly_trimmed


@pytest.mark.parametrize("links", range(1, 6))
def test_torque_of_a_state_is_the_textbooks(links):
    """For odd aircraft in full motion the torques are those of dense dynamics and Newton-Euler, to 1e-10.

    Sweep, fold and incidence hinges away from the roots, gravity, drag, wind, thrust. Fixed surfaces have
    none. As in tests/models/test_chain.py the lift is off.
    """
    rng = np.random.default_rng(links)
    flight = replace(example_flight(), wind_N=WIND_N)
    model = small_model(odd_aircraft(rng), flight, links)
    batch = random_batch(rng, model, 1).changed(lift_factor=np.zeros(1))
    hinges, state = random_hinges(rng, model), random_state(rng, model, 1, speed=30.0)
    force_B, moment_B = 1e3 * rng.normal(size=(2, 1, 3))
    constants = lane_constants(model, batch, 0.005)
    constants.set_thrust(force_B, moment_B)
    plan = instant(model, hinges)
    found = hinge_torques(model, plan, constants, np.repeat(state, 2, axis=0))[0]
    tree, motion = chain_tree(model, batch), motion_of(model, hinges, state[0])
    wrench = drag_wrenches(model, batch, 0, tree, motion, flight.air_density_kg_m3)
    wrench[0] += np.concatenate([moment_B[0], force_B[0]])
    expected = hinge_torque(tree, motion, wrench, [0.0, 0.0, flight.gravity_m_s2])
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-10 * np.abs(expected).max())


@pytest.mark.parametrize("links", [1, 3])
def test_motors_do_the_work_that_the_aircraft_gains(links):
    """In a vacuum, without damping, the work of all hinges along a flight is the energy gained.

    Both wings differ. Trapezia over steps of 1 ms leave 1e-4 of the largest energy.
    """
    model = example_model(links)
    model = small_model(model.aircraft, airless(model.flight), links)
    guess = physical_guess(model)
    batch = guess.changed(damping_nms_rad=0.0 * guess["damping_nms_rad"])
    schedules = [Spline(np.array([0.0, 0.3, 0.6]), np.array([0.0, 0.2, angle])) for angle in (0.5, 0.3)]
    plan = flight_plan(model, schedules, time_grid(np.linspace(0.0, 0.6, 61), 0.001))
    states = fly_free(model, plan, batch, resting(model)).states[:, 0]
    constants = lane_constants(model, batch, plan.grid.step_s)
    constants.set_thrust(np.zeros((1, 3)), np.zeros((1, 3)))
    torques = hinge_torques(model, plan, constants, states)
    power = np.sum(torques * plan.rates, axis=1)
    work = np.concatenate([[0.0], np.cumsum(0.5 * (power[1:] + power[:-1]) * plan.grid.step_s)])
    tree = chain_tree(model, batch)
    gravity_N = np.array([0.0, 0.0, model.flight.gravity_m_s2])
    rows = range(0, plan.grid.steps + 1, 50)
    totals = []
    for row in rows:
        hinges = np.stack([plan.angles[row], plan.rates[row], plan.accelerations[row]], axis=1)
        totals.append(energy(tree, motion_of(model, hinges, states[row]), gravity_N).total)
    gained = np.array(totals) - totals[0]
    assert np.abs(gained).max() > 10.0  # J: the test is about something
    np.testing.assert_allclose(work[list(rows)], gained, atol=1e-4 * np.abs(gained).max())


def resting(model):
    """One state row at rest, level."""
    state = np.zeros((1, model.state_rows))
    state[0, 0] = 1.0
    return state


def test_torque_of_a_symmetric_morph_is_the_wings_inertia_and_drag():
    """Both hinges bear the same; in the ramps about I dLambda'' above what the air takes between them.

    The rigid wing of 45 kg and 3 m has 135 kg m^2 about its hinge; the body answers little.
    """
    model = example_model(1)
    ramp, rate = 0.1, 1.0 / 1.9
    schedule = ConstantRate(0.0, 1.0, 2.0, ramp_s=ramp)
    plan = flight_plan(model, [schedule, schedule], time_grid(np.linspace(0.0, 2.2, 221)))
    batch = physical_guess(model)
    flown = fly_trimmed(model, plan, batch)
    constants = lane_constants(model, batch, plan.grid.step_s)
    constants.set_thrust(flown.trim.force_B, flown.trim.moment_B)
    torques = hinge_torques(model, plan, constants, flown.states[:, 0])
    np.testing.assert_allclose(torques[:, 0], torques[:, 1], rtol=0, atol=1e-8 * np.abs(torques).max())
    jump = torques[int(0.95 * ramp / plan.grid.step_s), 0] - torques[int(1.2 * ramp / plan.grid.step_s), 0]
    assert jump == pytest.approx(135.0 * rate / ramp, rel=0.1)
