"""The time step: its order, what it conserves, and MuJoCo's flights of the same aircraft."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from morphcore.frames import quaternion_from_euler, wrap_angle
from morphcore.models.equivalent import lane_constants, physical_guess
from morphcore.simulate.batch import initial_state, state_rates
from morphcore.simulate.kernels.step import BEFORE, GAMMA, LAST
from morphcore.simulate.schedule import Hold
from morphcore.simulate.time_grid import STEP_S
from tests.models.chains import (
    Swing,
    airless,
    example_aircraft,
    example_flight,
    instant,
    motion_of,
    odd_aircraft,
    random_batch,
    random_hinges,
    random_state,
    small_model,
)
from tests.oracles.chain_tree import chain_tree, link_bodies
from tests.oracles.dynamics import Acceleration, energy, inverse_dynamics, momentum
from tests.simulate.dragged_mujoco import Drag, DraggedMujoco, fly_dragged
from tests.simulate.flights import SAMPLES, example_model, fly_free, fly_trimmed, plan_of, sample_plan

SWINGS = (Swing(0.5, np.pi / 2), Swing(0.35, np.pi / 2))
SHIPPED_STEP_ERROR_RAD = 1e-4  # the project's own requirement
WIND_N = np.array([3.0, -7.0, 2.0])


@pytest.mark.parametrize("links", [1, 3])
def test_order_two(links):
    """Halving the step divides the error by four, stiff joints, lag and accelerating hinges included.

    The joints' fastest poles lie a hundred times beyond the step: the order does not suffer from them.
    Measured ratios: 4.2 to 4.5.
    """
    model = example_model(links)

    def attitude(step_s):
        return fly_trimmed(model, plan_of(model, SWINGS, 0.5, step_s)).euler[:: round(0.01 / step_s)]

    converged = attitude(0.000125)
    errors = np.array([np.abs(attitude(step) - converged).max() for step in (0.005, 0.0025, 0.00125)])
    assert (errors[:-1] / errors[1:] > 3.6).all()
    assert (errors[:-1] / errors[1:] < 5.0).all()
    assert errors[0] < SHIPPED_STEP_ERROR_RAD


def growth(stiff, gamma=GAMMA):
    """Spectral radius (k,) of a step of u' = lambda u with A exact, for stiff = h lambda (k,).

    From the definition: the recursion of (u, h k1, h k2) that the step makes.
    """
    k = np.zeros((stiff.size, 3), dtype=complex)
    # h k = z (U + gamma h k - (gamma - BEFORE) h k1 - BEFORE h k2), U = u + LAST h k1 + BEFORE h k2
    implicit = 1.0 - gamma * stiff
    k[:, 0] = stiff / implicit
    k[:, 1] = stiff * (LAST - (gamma - BEFORE)) / implicit
    k[:, 2] = stiff * (BEFORE - BEFORE) / implicit
    step = np.zeros((stiff.size, 3, 3), dtype=complex)
    step[:, 0] = k + np.array([1.0, 0.0, 0.0])
    step[:, 1] = k
    step[:, 2, 1] = 1.0
    return np.abs(np.linalg.eigvals(step)).max(axis=1)


def test_no_joint_grows_and_stiff_ones_die_out():
    """Undamped oscillations of any frequency stay or shrink; at infinity 1/3 is left, the least there is."""
    sizes = np.logspace(-2, 6, 801)
    for angle in (0.5, 0.6, 0.75, 1.0):  # of the pole, in pi: undamped to aperiodic
        assert growth(sizes * np.exp(1j * np.pi * angle)).max() < 1.0 + 1e-9
    infinite = np.array([-1e12 + 0j])
    assert growth(infinite)[0] == pytest.approx(1.0 / 3.0, abs=1e-5)  # a double root: round-off's square root
    assert all(growth(infinite, GAMMA + off)[0] > 1.0 / 3.0 + 0.01 for off in (-0.02, 0.02))


def shipped_step_error(links, name, parts):
    """Largest difference in attitude, (3,) rad, between the shipped step and one of its many parts."""
    model = example_model(links)
    plan, fine = sample_plan(model, name, STEP_S), sample_plan(model, name, STEP_S / parts)
    coarse_euler = fly_trimmed(model, plan).euler[plan.grid.at, 0]
    fine_euler = fly_trimmed(model, fine).euler[fine.grid.at, 0]
    return np.abs(wrap_angle(coarse_euler - fine_euler)).max(axis=0)


def test_shipped_step():
    """The step that ships stays within 1e-4 rad of a tenth of it (which has 1 per cent of its error).

    Measured on three links: 2e-5 rad.
    """
    assert shipped_step_error(3, "train_asymmetric", 10).max() < SHIPPED_STEP_ERROR_RAD


@pytest.mark.slow
@pytest.mark.parametrize("links", [1, 3, 8])
@pytest.mark.parametrize("name", SAMPLES)
def test_shipped_step_on_all_samples(name, links):
    """The same against a fiftieth on all four flights, for few and many links; measured: 3e-5 rad at most."""
    error = shipped_step_error(links, name, 50)
    print(f"{name}, {links} links: {error} rad")
    assert error.max() < SHIPPED_STEP_ERROR_RAD


def vacuum_drifts(step_s, schedules, *, links=3, gravity=0.0):
    """Relative drifts of energy, linear and angular momentum in half a second, soft springs, no dampers.

    Springs a thousand times softer than the wings': they swing through large angles, slowly enough to be
    seen.
    """
    rng = np.random.default_rng(0)
    model = small_model(example_aircraft(), airless(example_flight(), gravity=gravity), links)
    guess = physical_guess(model)
    batch = guess.changed(
        stiffness_nm_rad=1e-3 * guess["stiffness_nm_rad"], damping_nms_rad=0.0 * guess["damping_nms_rad"]
    )
    state = random_state(rng, model, 1, speed=10.0)
    n = model.coordinates
    state[:, 13 : 13 + n] *= 0.3
    plan = plan_of(model, schedules, 0.5, step_s)
    states = fly_free(model, plan, batch, state).states[:, 0]
    tree = chain_tree(model, batch)
    energies, linear, angular = [], [], []
    every = round(0.025 / step_s)
    for i in range(0, states.shape[0], every):
        hinges = np.stack([plan.angles[i], plan.rates[i], plan.accelerations[i]], axis=1)
        motion = motion_of(model, hinges, states[i])
        found = momentum(tree, motion)
        energies.append(energy(tree, motion, [0.0, 0.0, gravity]).total)
        # gravity adds to the linear momentum what it must, and nothing to the angular one about the centre
        linear.append(found.linear_N - found.mass * np.array([0.0, 0.0, gravity * plan.grid.times_s[i]]))
        angular.append(found.angular_centre_N)
    return np.array(
        [
            np.abs(np.array(values) - values[0]).max() / np.linalg.norm(values[0])
            for values in (energies, linear, angular)
        ]
    )


@pytest.mark.parametrize("gravity", [0.0, 9.81])
def test_energy_and_momentum_with_the_sweep_locked(gravity):
    """Without air, energy and both momenta drift with the square of the step, towards nothing.

    From 4 ms to 0.125 ms the drift falls a thousandfold; what is left is 1e-7 of energy and 1e-6 of
    momentum at most. (An implicit step has no business being exact here: what is exact is the next test's.)
    """
    locked = [Hold(0.3), Hold(0.7)]
    coarse, middle, fine = (vacuum_drifts(step, locked, gravity=gravity) for step in (1e-3, 5e-4, 1.25e-4))
    np.testing.assert_allclose(coarse / middle, 4.0, rtol=0.15)
    np.testing.assert_allclose(middle / fine, 16.0, rtol=0.15)
    assert fine.max() < 1e-6


def test_momentum_while_the_wings_sweep():
    """Hinge motors work, but they are inside: momentum holds as before, through the sweep's accelerations."""
    coarse, fine = (vacuum_drifts(step, SWINGS)[1:] for step in (5e-4, 2.5e-4))
    np.testing.assert_allclose(coarse / fine, 4.0, rtol=0.15)
    assert fine.max() < 5e-6


def test_energy_of_a_tumbling_rigid_aircraft_to_round_off():
    """Without joints nothing limits the accuracy but the step: energy to 1e-12, momenta to 1e-10."""
    drifts = vacuum_drifts(5e-5, [Hold(0.3), Hold(0.7)], links=1)
    assert drifts[0] < 1e-12
    assert drifts[1:].max() < 1e-10


@pytest.mark.parametrize("links", [1, 3, 8])
def test_accelerations_balance_momentum_and_power_to_round_off(links):
    """Without air and thrust, the lanes' accelerations require no external forces.

    By Newton and Euler's recursion the rate of change of momentum is the wrench on the base, and the power
    that goes into kinetic and elastic energy is that wrench's plus the joints' plus the hinges': with
    locked hinges all of it vanishes. Sizes are those of the terms that cancel.
    """
    rng = np.random.default_rng(links)
    model = small_model(odd_aircraft(rng), airless(example_flight(), gravity=0.0), links)
    batch = random_batch(rng, model, 1)
    batch = batch.changed(damping_nms_rad=0.0 * batch["damping_nms_rad"])
    hinges, state = random_hinges(rng, model), random_state(rng, model, 1)
    n = model.coordinates
    rates = state_rates(model, instant(model, hinges), 0, lane_constants(model, batch, STEP_S), state)[0]
    tree, motion = chain_tree(model, batch), motion_of(model, hinges, state[0])
    requested = inverse_dynamics(tree, motion, Acceleration(rates[4:10], rates[13 + n : 13 + 2 * n]))
    from_springs = tree.stiffness * motion.q_joint
    size = max(np.abs(from_springs).max(initial=0.0), 1e3 * np.abs(rates[4:10]).max())
    np.testing.assert_allclose(requested.base_wrench_B, 0.0, atol=1e-11 * size)
    np.testing.assert_allclose(requested.joint_torque, 0.0, atol=1e-11 * size)


def forced_flights(links, duration_s, mujoco_step_s):
    """Quaternions and joint angles every 0.1 s, in lanes and MuJoCo, of a sweeping, falling aircraft.

    Wings forced by a profile drag of 1 in a fall of 90 m/s through a side wind: 4 kN on each, in all
    directions, changing along the flight; thrust and moment on the fuselage, gravity, hinges accelerating
    all the time.
    """
    model = small_model(example_aircraft(), replace(example_flight(), wind_N=WIND_N), links)
    batch = physical_guess(model).changed(lift_factor=np.zeros(1), profile_drag=np.ones((1, 1)))
    state = initial_state(
        quaternion=quaternion_from_euler(0.1, 0.05, -0.2)[None],
        omega_B=np.array([[0.1, -0.05, 0.2]]),
        velocity_B=np.array([[40.0, 5.0, 90.0]]),
        q_joint=np.zeros((1, model.coordinates)),
        lag_motion=np.zeros((1, model.links, 3)),
    )
    force_B, moment_B = np.array([[300.0, -50.0, 20.0]]), np.array([[30.0, -700.0, 60.0]])
    plan = plan_of(model, SWINGS, duration_s, 1e-4)
    lanes = fly_free(model, plan, batch, state, force_B=force_B, moment_B=moment_B).states[::1000, 0]
    lengths, chord = np.tile(3.0 * batch["division"][0, 0], 2), 0.3
    bodies, _ = link_bodies(model)
    side = np.repeat([1.0, -1.0], links)
    drags = [
        Drag(int(b), chord * length, np.array([0.0, s * length / 2, 0.0]))
        for b, length, s in zip(bodies, lengths, side, strict=True)
    ]
    flight = model.flight
    body = DraggedMujoco(
        chain_tree(model, batch), [0.0, 0.0, flight.gravity_m_s2], drags, flight.air_density_kg_m3, WIND_N
    )
    thrust = np.concatenate([moment_B[0], force_B[0]])
    every = round(0.1 / mujoco_step_s)
    mujoco = fly_dragged(body, state[0], SWINGS, thrust, duration_s, mujoco_step_s, every=every)
    return lanes[:, [0, 1, 2, 3, *range(13, 13 + model.coordinates)]], mujoco


def hold_against_mujoco(links, duration_s, mujoco_step_s):
    """Attitude and joints within 1e-6 rad of MuJoCo's; the aircraft bends and turns."""
    lanes, mujoco = forced_flights(links, duration_s, mujoco_step_s)
    error = np.abs(lanes - mujoco).max(axis=0)
    print(f"{links} links: attitude {2 * error[:4].max():.1e} rad, joints {error[4:].max():.1e} rad")
    assert 2.0 * error[:4].max() < 1e-6  # an angle is twice its share of the quaternion
    assert error[4:].max() < 1e-6
    assert np.abs(mujoco[:, 4:]).max() > 0.03
    assert np.abs(mujoco[-1, :4] - mujoco[0, :4]).max() > 0.1


def test_forced_flight_in_mujoco():
    """Most of a second of forced morphing flight agrees with MuJoCo."""
    hold_against_mujoco(2, 0.8, 1e-3)


@pytest.mark.slow
@pytest.mark.parametrize(("links", "mujoco_step_s"), [(2, 1e-3), (3, 5e-4)])
def test_two_forced_seconds_in_mujoco(links, mujoco_step_s):
    """Two seconds agree as well; measured 1e-8 rad in attitude, 1e-7 rad in the joints.

    Stiffer joints take MuJoCo's explicit scheme shorter steps.
    """
    hold_against_mujoco(links, 2.0, mujoco_step_s)
