"""Air loads on the links against the forces on all edges of the three-dimensional lattice; Jones' lag."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from morphcore.aero.environment import MovingAir, Wave
from morphcore.aero.gust_lag import KUESSNER_A, KUESSNER_B
from morphcore.aero.kernels.loads import (
    JONES_A1,
    JONES_A2,
    JONES_B1,
    JONES_B2,
    JONES_MEAN_LAG,
    L_FAST_DECAY,
    L_FAST_WEIGHT,
    L_LIFT,
    L_SLOW_DECAY,
    lagged_motion,
)
from morphcore.lanes import TOGETHER, lane_type
from morphcore.models.equivalent import chain_model, lane_constants, physical_guess
from morphcore.models.kinematics import link_poses
from morphcore.models.parameters import lag_weights
from morphcore.models.slopes import sloped_motion
from morphcore.multibody.kernels.articulated import LINK_ROWS
from morphcore.simulate.batch import initial_state, state_rates
from morphcore.simulate.kernels.step import lag_from_stage, lag_to_stage
from morphcore.simulate.plan import flight_plan
from morphcore.simulate.schedule import Hold
from morphcore.simulate.time_grid import STEP_S
from morphdata.lattice import Lattice
from tests.aero.link_loads import edge_loads, lane_loads
from tests.geometry.rehinged import rehinged
from tests.kernels import from_python
from tests.models.chains import example_aircraft, example_flight, instant, odd_aircraft, random_batch
from tests.simulate.flights import example_model, fly_free, steps

SWEEPS = [(0.0, 0.0), (0.4, 0.4), (0.3, 0.9)]
SINKING = (0.0, 0.0, 0.0, 150.0, 8.0, 9.0)  # uniform incidence, with sideslip


def settled(model, batch, angles, twist_B):
    """A plan with hinges at rest and the wake along x of B, and a state of that motion, its lag settled."""
    angles = np.asarray(angles)
    plan = instant(model, np.stack([angles, 0.0 * angles, 0.0 * angles], axis=1), wake_alpha=0.0)
    state = initial_state(
        quaternion=np.array([[1.0, 0.0, 0.0, 0.0]]),
        omega_B=np.array([twist_B[:3]]),
        velocity_B=np.array([twist_B[3:]]),
        q_joint=np.zeros((1, model.coordinates)),
        lag_motion=np.zeros((1, model.links, 3)),
    )[0]
    motion = lane_loads(model, batch, plan, state).twist[:, [5, 0, 1]].ravel()
    state[13 + 2 * model.coordinates :] = np.tile(motion, 3)
    return plan, state


def dragless(model, **changes):
    """Beam theory's guess without profile drag."""
    return physical_guess(model).changed(profile_drag=np.zeros((1, len(model.pairs))), **changes)


def compared(model, angles, twist_B):
    """Wrenches (s, 6) of the lanes and of the lattice, moments over the span and forces, in lifts."""
    batch = dragless(model)
    lanes = lane_loads(model, batch, *settled(model, batch, angles, twist_B)).wrench
    lattice = edge_loads(model, np.asarray(angles), np.array(twist_B))
    spans = np.array([s.span_m for s in model.aircraft.surfaces])
    scale = np.abs(lattice[:, 5]).max() * np.stack([*[spans] * 3, *[0.0 * spans + 1.0] * 3], axis=1)
    return lanes / scale, lattice / scale


@pytest.mark.parametrize("angles", SWEEPS)
def test_uniform_incidence_is_exact(angles):
    """All forces and the moments of lift on flat wings in uniform incidence are the lattice's to round-off.

    The yawing moment of the forces in the wing's plane leaves out the fore and aft arm of the side forces:
    within 2e-4 of lift times span, 3e-6 unswept.
    """
    lanes, lattice = compared(example_model(1), angles, SINKING)
    np.testing.assert_allclose(lanes[:, [0, 1, 3, 4, 5]], lattice[:, [0, 1, 3, 4, 5]], atol=1e-12)
    np.testing.assert_allclose(lanes[:, 2], lattice[:, 2], atol=2e-4 if any(angles) else 1e-5)


@pytest.mark.parametrize("angles", SWEEPS)
@pytest.mark.parametrize(
    "omega", [(0.5, 0.0, 0.0), (0.0, 0.5, 0.0), (0.0, 0.0, 0.5), (-0.3, 0.4, 0.5)], ids=["p", "q", "r", "all"]
)
def test_rates(angles, omega):
    """At 0.5 rad/s in roll, pitch, yaw: lift and its moments exact, in-plane forces in 3e-4 of the lift."""
    lanes, lattice = compared(example_model(1), angles, (*omega, *SINKING[3:]))
    np.testing.assert_allclose(lanes[:, [0, 1, 5]], lattice[:, [0, 1, 5]], atol=1e-12)
    np.testing.assert_allclose(lanes[:, [2, 3, 4]], lattice[:, [2, 3, 4]], atol=3e-4)


def test_odd_surfaces():
    """Tapered wings off mid-chord and a tail, all in one plane: exact.

    Out of one plane what surfaces induce along each other's planes acts at the strips' centres: its
    moments are within half a per cent of lift times span.
    """
    aircraft = odd_aircraft(np.random.default_rng(3))
    aircraft = replace(aircraft, surfaces=tuple(replace(s, profile_drag=0.0) for s in aircraft.surfaces))
    flat = replace(aircraft, surfaces=tuple(flattened(s) for s in aircraft.surfaces))
    for shape, tolerance, in_plane in ((flat, 1e-11, 1e-11), (aircraft, 5e-3, 1e-3)):
        model = chain_model(shape, example_flight(), 1, Lattice(chordwise=3, spanwise=6))
        lanes, lattice = compared(model, [0.4, 0.1, 0.05], SINKING)
        np.testing.assert_allclose(lanes[:, [0, 1, 5]], lattice[:, [0, 1, 5]], atol=tolerance)
        np.testing.assert_allclose(lanes[:, [2, 3, 4]], lattice[:, [2, 3, 4]], atol=in_plane)


def flattened(surface):
    """The same surface in the plane z = 0, its hinge, if it has one, for sweep."""
    x, y, _ = surface.position_m
    flat = replace(surface, position_m=(x, y, 0.0))
    return rehinged(flat, "z", [*flat.hinges[-1].position_m[:2], 0.0]) if flat.hinges else flat


@pytest.mark.parametrize("links", [2, 3, 7])
def test_cutting_a_wing_changes_nothing(links):
    """The loads on the links of a straight chain add up to those of the rigid wing, wherever it is cut."""
    rng = np.random.default_rng(links)
    angles = (0.3, 0.5)
    whole = example_model(1)
    expected = lane_loads(whole, dragless(whole), *settled(whole, dragless(whole), angles, SINKING)).wrench
    model = example_model(links)
    division = rng.dirichlet(np.full(links, 5.0), size=(1, 1))
    batch = dragless(model, division=division)
    cut = lane_loads(model, batch, *settled(model, batch, angles, SINKING)).wrench
    starts = 3.0 * (np.cumsum(division[0, 0]) - division[0, 0])
    for side, sign in ((0, 1.0), (1, -1.0)):
        mine = cut[side * links : (side + 1) * links]
        arms = np.stack([0.0 * starts, sign * starts, 0.0 * starts], axis=1)
        moment = (mine[:, :3] + np.cross(arms, mine[:, 3:])).sum(axis=0)
        found = np.concatenate([moment, mine[:, 3:].sum(axis=0)])
        np.testing.assert_allclose(found, expected[side], atol=1e-11 * np.abs(expected[side]).max())


def test_corrections():
    """The lift factor scales circulation and what it induces; the centre's shift moves the force."""
    model = example_model(1)
    plain, shifted = dragless(model), dragless(model, ac_offset_m=np.array([0.02]))
    lifted = dragless(model, lift_factor=np.array([1.2]))
    base, moved, more = (
        lane_loads(model, batch, *settled(model, batch, (0.3, 0.3), SINKING)).wrench
        for batch in (plain, shifted, lifted)
    )
    np.testing.assert_allclose(moved[:, 3:], base[:, 3:], rtol=1e-14)
    force = base[:, 3:]
    np.testing.assert_allclose(
        moved[:, :3] - base[:, :3], np.cross([0.02, 0.0, 0.0], force), atol=1e-12 * np.abs(base).max()
    )
    np.testing.assert_allclose(more[:, 5], 1.2 * base[:, 5], rtol=1e-13)


def test_dynamic_pressure():
    """Twice the speed at the same incidence is four times the load; loads are proportional to the density."""
    model = example_model(1)
    batch = physical_guess(model)
    slow, fast = (
        lane_loads(model, batch, *settled(model, batch, (0.3, 0.5), factor * np.array(SINKING))).wrench
        for factor in (1.0, 2.0)
    )
    np.testing.assert_allclose(fast, 4.0 * slow, rtol=1e-12, atol=1e-9)
    thin = chain_model(example_aircraft(), replace(example_flight(), air_density_kg_m3=1.1), 1)
    third = lane_loads(thin, batch, *settled(thin, batch, (0.3, 0.5), SINKING)).wrench
    np.testing.assert_allclose(third, slow * 1.1 / 1.225, rtol=1e-12, atol=1e-9)


def test_zero_lag_is_quasi_steady():
    """Without lag the loads follow the motion of the instant, whatever the motion before."""
    rng = np.random.default_rng(0)
    model = example_model(3)
    instantaneous, lagging = dragless(model, lag_s=np.zeros(1)), dragless(model)
    plan, state = settled(model, lagging, (0.3, 0.5), SINKING)
    steady = lane_loads(model, lagging, plan, state).wrench
    # slow, fast and previous motion of another past; without lag they are one and the same
    state[13 + 2 * model.coordinates :] += np.tile(rng.normal(size=3 * model.links), 3)
    found = lane_loads(model, instantaneous, plan, state).wrench
    # the shortest lag is a nanosecond, not nothing
    np.testing.assert_allclose(found, steady, atol=1e-6 * np.abs(steady).max())
    other = lane_loads(model, lagging, plan, state).wrench
    assert np.abs(other - steady).max() > 1e-3 * np.abs(steady).max()


def lag_response(motion, lag_s, step_s):
    """What the circulation answers to (k,) for a motion (k,) of one link, sampled in every step's stage."""
    link = np.zeros((LINK_ROWS, TOGETHER))
    link[L_SLOW_DECAY : L_FAST_WEIGHT + 1] = lag_weights(np.array(lag_s), step_s)[:, None]
    link[[L_SLOW_DECAY, L_FAST_DECAY]] **= 0.5  # over half a step, as the step takes them
    link[L_LIFT] = 1.0
    slow, fast, previous = np.zeros((3, 3, TOGETHER))
    previous[:] = motion[0]  # a jump just before the start, if there is one
    effective, out, stage = np.empty((3, TOGETHER)), [], np.empty((3, 3, TOGETHER))
    lanes = lane_type(TOGETHER)
    to_stage, lagged, from_stage = (
        from_python(lag_to_stage),
        from_python(lagged_motion),
        from_python(lag_from_stage),
    )
    for value in motion:
        twist = np.full((6, TOGETHER), value)
        to_stage(lanes, link, slow, fast, previous, *stage)
        lagged(lanes, link, twist, *stage, effective)
        out.append(effective[0, 0])
        from_stage(lanes, link, twist, stage[0], stage[1], slow, fast, previous)
    return np.array(out)


@pytest.mark.parametrize("step_s", [0.0002, 0.005, 0.1])
def test_step_response_is_jones_function(step_s):
    """A sudden motion is answered by 1 - 0.165 exp(-0.0455 s) - 0.335 exp(-0.3 s), s = 2 V t / c."""
    speed, chord = 150.0, 0.3
    lag_s = JONES_MEAN_LAG * chord / (2 * speed)
    times = step_s * (np.arange(40) + 0.5)  # the first stage lies half a step after the jump
    found = lag_response(np.ones(40), lag_s, step_s)
    s = 2 * speed * times / chord
    expected = 1.0 - JONES_A1 * np.exp(-JONES_B1 * s) - JONES_A2 * np.exp(-JONES_B2 * s)
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_ramp_response_is_exact():
    """A motion that grows linearly is answered by the integral of Jones' function: exact at any step."""
    lag_s, step_s = 0.01, 0.013
    times = step_s * np.arange(30)
    found = lag_response(times, lag_s, step_s)
    expected = times.copy()
    for a, b in ((JONES_A1, JONES_B1), (JONES_A2, JONES_B2)):
        T = lag_s / (JONES_MEAN_LAG * b)
        expected -= a * T * (1.0 - np.exp(-times / T))
    np.testing.assert_allclose(found, expected, atol=1e-13)


def test_mean_delay_is_the_lag():
    """Long after a ramp began, the answer trails it by the lag time."""
    lag_s = 0.02
    times = 0.005 * np.arange(2000)
    assert times[-1] - lag_response(times, lag_s, 0.005)[-1] == pytest.approx(lag_s, rel=1e-6)


def test_a_sudden_gust_builds_lift_up_as_kuessner_says():
    """A very heavy aircraft meets a sharp-edged updraught: its lift grows as Küssner's function.

    The edge is at the leading edges at the start, one semichord ahead of the reference point.
    """
    aircraft = example_aircraft()
    heavy = replace(aircraft.fuselage, mass_kg=1e8, inertia_B=1e13 * np.eye(3))
    flight = replace(example_flight(), gravity_m_s2=0.0)
    model = chain_model(replace(aircraft, fuselage=heavy), flight, 1, Lattice(chordwise=2, spanwise=4))
    batch, grid = dragless(model), steps(0.1, 0.0005)
    air = MovingAir((step_gust([0.0, 0.0, -2.0], start_m=0.15, spacing_m=0.002),), 150.0)
    plan = flight_plan(model, [Hold(), Hold()], grid, air=air, wake_alpha=0.0)
    _, state = settled(model, batch, (0.0, 0.0), (0.0, 0.0, 0.0, 150.0, 0.0, 0.0))
    states = fly_free(model, plan, batch, state[None]).states[:, 0]
    lift = -np.diff(states[:, 9]) / grid.step_s  # of the stages, in the middle of the steps
    s = 2 * 150.0 * (grid.times_s[:-1] + 0.5 * grid.step_s) / 0.3
    expected = 1.0 - sum(a * np.exp(-b * s) for a, b in zip(KUESSNER_A, KUESSNER_B, strict=True))
    np.testing.assert_allclose(lift / lift[-1] * expected[-1], expected, atol=1e-4)


@pytest.mark.parametrize("links", [1, 3])
def test_a_gust_that_is_the_same_everywhere_is_wind(links):
    """Settled in it, every link bears what it bears in wind of that velocity: lift, suction, drag, cm0."""
    rng = np.random.default_rng(links)
    wind = np.array([3.0, -5.0, -4.0])
    aircraft = odd_aircraft(rng)
    cambered = tuple(
        replace(surface, zero_lift_rad=-0.05, cm0=-0.07, twist_rad=0.04) for surface in aircraft.surfaces
    )
    aircraft = replace(aircraft, surfaces=cambered)
    wrenches = []
    for own, gust in ((wind, np.zeros(3)), (np.zeros(3), wind)):
        flight = replace(example_flight(), wind_N=own)
        model = chain_model(aircraft, flight, links, Lattice(chordwise=2, spanwise=5))
        batch = random_batch(np.random.default_rng(5), model, 1)
        held = [Hold(0.3)] * len(aircraft.hinges)
        air = MovingAir((step_gust(gust.tolist(), start_m=-2000.0),), 150.0)
        plan = flight_plan(model, held, steps(0.01, 0.01), air=air, wake_alpha=0.0)
        still = np.zeros((1, model.coordinates))
        R_BL, _ = link_poses(model, batch, plan.hinges[0], still)
        flown = np.array([[149.0, 4.0, 9.0]])
        state = initial_state(
            quaternion=np.array([[1.0, 0.0, 0.0, 0.0]]),
            omega_B=np.zeros((1, 3)),
            velocity_B=flown,
            q_joint=still,
            lag_motion=sloped_motion(model, batch, R_BL, flown - own),
        )[0]
        wrenches.append(lane_loads(model, batch, plan, state).wrench)
    scale = np.abs(wrenches[0]).max()
    np.testing.assert_allclose(wrenches[1] / scale, wrenches[0] / scale, rtol=0.0, atol=1e-10)


def step_gust(velocity_N, *, start_m, spacing_m=0.05):
    """Air of one velocity from a place on, the same everywhere across the path."""
    everywhere = np.zeros(1), np.ones(1)
    return Wave(start_m, spacing_m, np.tile(np.array(velocity_N, dtype=float), (60_000, 1)), *everywhere)


def test_damping_in_roll_heave_and_pitch():
    """Local velocities damp: roll and heave are resisted, pitch by swept wings."""
    model = example_model(1)
    batch = physical_guess(model)

    def rates(angles, twist_B):
        plan, state = settled(model, batch, angles, np.array(twist_B))
        return state_rates(model, plan, 0, lane_constants(model, batch, STEP_S), state[None])[0, 4:10]

    level = rates((0.6, 0.6), (0, 0, 0, 150, 0, 9))
    assert rates((0.6, 0.6), (0.3, 0, 0, 150, 0, 9))[0] - level[0] < -1.0
    assert rates((0.6, 0.6), (0, 0, 0, 150, 0, 11))[5] - level[5] < -1.0
    assert rates((0.6, 0.6), (0, 0.3, 0, 150, 0, 9))[1] - level[1] < -0.05
