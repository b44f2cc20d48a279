"""The lanes' articulated-body pass against the textbook dynamics of the separately built tree."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from morphcore.lanes import TOGETHER
from morphcore.models.equivalent import lane_constants
from morphcore.models.kernels.layout import JOINTS
from morphcore.simulate.batch import state_rates
from morphcore.threads import thread_count, use_threads
from tests.models.chains import (
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
from tests.oracles.chain_tree import chain_tree, link_bodies, link_ends
from tests.oracles.dynamics import body_poses, body_twists, forward_dynamics_crba

WIND_N = np.array([3.0, -7.0, 2.0])


def accelerations(rates, model):
    """Derivative of the base twist and joint accelerations (p, 6 + n) out of state rates."""
    n = model.coordinates
    return np.concatenate([rates[:, 4:10], rates[:, 13 + n : 13 + 2 * n]], axis=1)


def drag_wrenches(model, batch, particle, tree, motion, density):
    """Profile drag on every body (b, 6), independently: half rho Cd A |v| v at each link's centroid."""
    bodies, origins = link_bodies(model)
    twists = body_twists(tree, motion)
    wrench = np.zeros((tree.bodies, 6))
    R_NX, _ = body_poses(tree, motion)
    link = 0
    for s, surface in enumerate(model.aircraft.surfaces):
        ends = link_ends(model, batch, s, particle)
        drag = (
            batch["profile_drag"][particle, model.set_of(batch)[s]]
            if surface.flexible
            else surface.profile_drag
        )
        for start, end in pairwise(ends):
            a, b = surface.chord_at(start), surface.chord_at(end)
            length = end - start
            area = 0.5 * (a + b) * length
            # centroid of a trapezium from its inboard side
            y = surface.span_sign * length * (a + 2.0 * b) / (3.0 * (a + b))
            body = bodies[link]
            point = origins[link] + np.array([0.0, y, 0.0])
            wind = R_NX[body].T @ WIND_N
            v = twists[body, 3:] + np.cross(twists[body, :3], point) - wind
            force = -0.5 * density * drag * area * np.linalg.norm(v) * v
            wrench[body] += np.concatenate([np.cross(point, force), force])
            link += 1
    return wrench


@pytest.mark.parametrize("links", [*range(1, 9), 16])
def test_articulated_pass_is_the_dense_solution(links):
    """Accelerations of odd aircraft in full motion are those of M a = -h to 1e-10.

    Gravity, thrust, drag, five surfaces on hinges about all axes or none, every link number, wind, both
    wing sets apart, hinges accelerating. The lift factor is zero here, so that the drag is all the air
    does; lift has its own tests (tests/aero).
    """
    rng = np.random.default_rng(links)
    flight = replace(example_flight(), wind_N=WIND_N)
    model = small_model(odd_aircraft(rng), flight, links)
    particles = 5
    batch = random_batch(rng, model, particles).changed(lift_factor=np.zeros(particles))
    hinges = random_hinges(rng, model)
    state = random_state(rng, model, particles, speed=30.0)
    force_B, moment_B = 1e3 * rng.normal(size=(2, particles, 3))
    constants = lane_constants(model, batch, 0.005)
    constants.set_thrust(force_B, moment_B)
    found = accelerations(state_rates(model, instant(model, hinges), 0, constants, state), model)
    for p in range(particles):
        tree = chain_tree(model, batch, p)
        motion = motion_of(model, hinges, state[p])
        wrench = drag_wrenches(model, batch, p, tree, motion, flight.air_density_kg_m3)
        wrench[0] += np.concatenate([moment_B[p], force_B[p]])
        expected = forward_dynamics_crba(tree, motion, wrench, [0.0, 0.0, flight.gravity_m_s2])
        both = np.concatenate([expected.base, expected.joint])
        np.testing.assert_allclose(found[p], both, rtol=0, atol=1e-10 * np.abs(both).max())


def test_kinematic_rows_of_the_state_rates():
    """Attitude, position and joints follow their rates: q' = q (0, omega) / 2, r' = R_NB v_B."""
    rng = np.random.default_rng(0)
    model = small_model(example_aircraft(), airless(example_flight()), 3)
    batch = random_batch(rng, model, 1)
    state = random_state(rng, model, 1)
    rates = state_rates(
        model, instant(model, random_hinges(rng, model)), 0, lane_constants(model, batch, 0.005), state
    )
    motion = motion_of(model, random_hinges(rng, model), state[0])
    w, xyz, omega = state[0, 0], state[0, 1:4], state[0, 4:7]
    expected = 0.5 * np.concatenate([[-xyz @ omega], w * omega + np.cross(xyz, omega)])
    np.testing.assert_allclose(rates[0, :4], expected, atol=1e-15)
    np.testing.assert_allclose(rates[0, 10:13], motion.R_NB @ state[0, 7:10], atol=1e-14)
    np.testing.assert_array_equal(rates[0, 13 : 13 + model.coordinates], motion.v_joint)


def test_wind_without_air_does_nothing():
    """In a vacuum the wind's velocity drops out of the accelerations."""
    rng = np.random.default_rng(1)
    aircraft, calm = odd_aircraft(rng), airless(example_flight())
    model = small_model(aircraft, calm, 3)
    batch, state, hinges = random_batch(rng, model, 2), random_state(rng, model, 2), random_hinges(rng, model)
    found = []
    for flight in (calm, replace(calm, wind_N=WIND_N)):
        blown = small_model(aircraft, flight, 3)
        rates = state_rates(blown, instant(blown, hinges), 0, lane_constants(blown, batch, 0.005), state)
        found.append(accelerations(rates, model))
    np.testing.assert_allclose(found[0], found[1], rtol=0, atol=1e-12 * np.abs(found[0]).max())


def full_rates(particles, order=None):
    """State rates of random flights of the example in air; ``order`` picks and orders particles."""
    rng = np.random.default_rng(7)
    model = small_model(example_aircraft(), example_flight(), 3)
    batch, state = random_batch(rng, model, particles), random_state(rng, model, particles, speed=150.0)
    hinges = random_hinges(rng, model)
    index = np.arange(particles) if order is None else order
    constants = lane_constants(model, batch.select(index), 0.005)
    rates = state_rates(model, instant(model, hinges), 0, constants, state[index])
    return rates[:, : JOINTS + 2 * model.coordinates]  # the lag states' are not computed


def test_lanes_are_independent_and_order_does_not_matter():
    """A particle's rates are bit for bit the same alone, in any lane and company, on one thread or two."""
    particles = 3 * TOGETHER + 5
    together = full_rates(particles)
    order = np.random.default_rng(0).permutation(particles)
    np.testing.assert_array_equal(full_rates(particles, order), together[order])
    for alone in (0, TOGETHER, particles - 1):
        np.testing.assert_array_equal(full_rates(particles, np.array([alone]))[0], together[alone])
    threads = thread_count()
    try:
        use_threads(1)
        np.testing.assert_array_equal(full_rates(particles), together)
    finally:
        use_threads(threads)


def test_padding_lanes_are_harmless():
    """The lanes that fill up the last block change nothing in the others."""
    together = full_rates(TOGETHER + 1)
    np.testing.assert_array_equal(full_rates(TOGETHER + 1, np.arange(TOGETHER)), together[:TOGETHER])
    assert np.isfinite(together).all()


def test_a_diverged_lane_leaves_its_neighbours_alone():
    """NaN in one particle stays there."""
    rng = np.random.default_rng(3)
    model = small_model(example_aircraft(), example_flight(), 2)
    batch, state = random_batch(rng, model, 4), random_state(rng, model, 4, speed=150.0)
    plan, constants = instant(model, random_hinges(rng, model)), lane_constants(model, batch, 0.005)
    sound = state_rates(model, plan, 0, constants, state)
    state[2] = np.nan
    broken = state_rates(model, plan, 0, constants, state)
    np.testing.assert_array_equal(broken[[0, 1, 3]], sound[[0, 1, 3]])
    assert np.isnan(broken[2, 4:10]).all()


UNCOMPILED = """
import numpy as np
from tests.models.test_chain import full_rates
np.save({path!r}, full_rates(2))
"""


def test_kernels_run_as_plain_python(tmp_path, root):
    """With the compiler off the kernels give the same numbers, up to fused multiply-adds."""
    path = str(tmp_path / "rates.npy")
    subprocess.run(
        [sys.executable, "-c", UNCOMPILED.format(path=path)],
        check=True,
        cwd=root,
        env={**os.environ, "NUMBA_DISABLE_JIT": "1", "PYTHONPATH": str(root)},
        timeout=120,
    )
    compiled = full_rates(2)
    np.testing.assert_allclose(np.load(path), compiled, rtol=0, atol=1e-11 * np.abs(compiled).max())
