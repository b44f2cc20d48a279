"""Surfaces on several hinges and about any axis: against independent dynamics and symmetry."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from morphcore.errors import InvalidInput
from morphcore.geometry.aircraft import Aircraft
from morphcore.geometry.lattice import surface_pose
from morphcore.models.equivalent import chain_model, lane_constants, physical_guess
from morphcore.models.kernels.layout import JOINTS
from morphcore.multibody.hinges import hinge_screws, relative_motion
from morphcore.simulate.batch import state_rates
from morphcore.simulate.common_path import path_angles
from morphcore.simulate.flight import ModelChoice, Simulation
from morphcore.simulate.plan import flight_plan
from morphcore.simulate.schedule import ConstantRate, Hold, Spline
from morphcore.simulate.time_grid import time_grid
from morphcore.simulate.torque import hinge_torques
from morphdata.lattice import Lattice
from tests.geometry.rehinged import rehinged
from tests.models.chains import (
    Swing,
    aircraft_of,
    airless,
    example_aircraft,
    example_flight,
    instant,
    motion_of,
    random_batch,
    random_hinges,
    random_state,
    small_model,
)
from tests.models.many_hinges import CANT, FOLD, SWEEP, hinged_wings, many_hinges, on_hinges
from tests.multibody.mujoco_flight import MujocoTree
from tests.oracles.chain_tree import chain_tree, of_hinges, tree_hinges
from tests.oracles.dynamics import energy, forward_dynamics_crba, hinge_torque
from tests.simulate.dragged_mujoco import DraggedMujoco, fly_dragged
from tests.simulate.flights import fly, fly_free, plan_of

COARSE = Lattice(chordwise=2, spanwise=6)
DOWN_N = [0.0, 0.0, 9.81]


def vacuum_rates(seed, links):
    """A random motion of an aircraft of many hinges under thrust, and the accelerations that it has."""
    rng = np.random.default_rng(seed)
    model = small_model(many_hinges(rng), airless(example_flight(), gravity=9.81), links)
    batch, hinges = random_batch(rng, model, 1), random_hinges(rng, model)
    state = random_state(rng, model, 1, speed=30.0)
    thrust = 1e3 * rng.normal(size=6)
    constants = lane_constants(model, batch, 0.005)
    constants.set_thrust(thrust[None, 3:], thrust[None, :3])
    plan = instant(model, hinges)
    rates = state_rates(model, plan, 0, constants, state)[0]
    n = model.coordinates
    found = np.concatenate([rates[4:10], rates[JOINTS + n : JOINTS + 2 * n]])
    return model, batch, hinges, state, found, thrust, plan, constants


@pytest.mark.parametrize("links", [1, 2, 4])
def test_accelerations_are_those_of_the_dense_tree(links):
    """Two hinges a surface, some skew, all accelerating: M a = -h of the tree to 1e-10.

    The tree has a body for every turn; a skew axis is five turns about coordinate axes, four of them held.
    """
    model, batch, hinges, state, found, thrust, *_ = vacuum_rates(links, links)
    tree, motion = chain_tree(model, batch), motion_of(model, hinges, state[0])
    wrench = np.zeros((tree.bodies, 6))
    wrench[0] = thrust
    expected = forward_dynamics_crba(tree, motion, wrench, DOWN_N)
    both = np.concatenate([expected.base, expected.joint])
    np.testing.assert_allclose(found, both, rtol=0, atol=1e-10 * np.abs(both).max())


def test_accelerations_are_mujocos():
    """The same against MuJoCo's equations of that tree."""
    model, batch, hinges, state, found, thrust, *_ = vacuum_rates(7, 3)
    tree, motion = chain_tree(model, batch), motion_of(model, hinges, state[0])
    wrench = np.zeros((tree.bodies, 6))
    wrench[0] = thrust
    M, h = MujocoTree(tree, DOWN_N).equations(motion, wrench)
    expected = np.linalg.solve(M, -h)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize("links", [1, 3])
def test_torques_are_those_of_the_dense_tree(links):
    """Each hinge bears what Newton and Euler's recursion gives its turn, to 1e-10."""
    model, batch, hinges, state, _, thrust, plan, constants = vacuum_rates(10 + links, links)
    found = hinge_torques(model, plan, constants, np.repeat(state, 2, axis=0))[0]
    tree, motion = chain_tree(model, batch), motion_of(model, hinges, state[0])
    wrench = np.zeros((tree.bodies, 6))
    wrench[0] = thrust
    expected = of_hinges(model, hinge_torque(tree, motion, wrench, DOWN_N))
    assert expected.size == len(model.aircraft.hinges) == 6
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-10 * np.abs(expected).max())


@pytest.mark.parametrize("hinges", [[SWEEP, FOLD], [CANT, FOLD]], ids=["sweep and fold", "cant and fold"])
def test_a_flight_on_two_moving_hinges_is_mujocos(hinges):
    """Half a second with both hinges of each wing moving, thrust and gravity, no air.

    The step is of second order; at 0.25 ms it stays within 2e-6 rad of MuJoCo's tree.
    """
    model = small_model(hinged_wings(*hinges), airless(example_flight(), gravity=9.81), 2)
    swings = [Swing(0.05 * (3 + k), 2.0 + k) for k in range(len(model.aircraft.hinges))]
    batch = physical_guess(model)
    batch = batch.changed(stiffness_nm_rad=1e-2 * batch["stiffness_nm_rad"])
    state = np.zeros((1, model.state_rows))
    state[0, 0], state[0, 7] = 1.0, 50.0
    thrust = np.array([5.0, -20.0, 10.0, 100.0, 0.0, -3000.0])
    errors = []
    tree = chain_tree(model, batch)
    # a schedule for every turn of the tree: those of a skew axis are held
    numbers = tree_hinges(model, np.arange(len(swings))[:, None] * np.ones(3) + 100.0)
    schedules = [swings[int(row[1]) - 100] if row[1] else Hold(float(row[0])) for row in numbers]
    body = DraggedMujoco(tree, DOWN_N, (), 0.0, np.zeros(3))
    truth = fly_dragged(body, state[0], schedules, thrust, 0.5, 5e-4, every=20)
    for step_s in (1e-3, 5e-4, 2.5e-4):
        plan = plan_of(model, swings, 0.5, step_s)
        flown = fly_free(model, plan, batch, state, force_B=thrust[None, 3:], moment_B=thrust[None, :3])
        kept = flown.states[:: round(0.01 / step_s), 0]
        errors.append(np.abs(kept[:, :4] - truth[:, :4]).max())
    assert np.abs(truth[-1, :4] - truth[0, :4]).max() > 0.01
    assert 3.5 < errors[0] / errors[1] < 4.5
    assert errors[2] < 2e-6


@pytest.mark.parametrize("seed", range(3))
def test_relative_motion_is_the_sum_of_the_screws_and_its_derivative(seed):
    """Twist = sum of screws times rates; the acceleration is its difference in time."""
    rng = np.random.default_rng(seed)
    surface = many_hinges(rng).surfaces[3]
    arms, probe = surface.root_arms_B, 1e-5
    angle, rate, acceleration = rng.normal(size=(3, len(surface.hinges)))
    times = np.array([-probe, 0.0, probe])[:, None]
    angles, rates = angle + rate * times + 0.5 * acceleration * times**2, rate + acceleration * times
    twist, change = relative_motion(surface.hinges, arms, angles, rates, np.tile(acceleration, (3, 1)))
    screws = hinge_screws(surface.hinges, arms, angles)
    np.testing.assert_allclose(twist, np.einsum("kmi,km->ki", screws, rates), rtol=0, atol=1e-13)
    np.testing.assert_allclose(change[1], (twist[2] - twist[0]) / (2.0 * probe), rtol=0, atol=1e-8)


def guess_of(aircraft: Aircraft, links: int = 2):
    """The first guess of the equivalent model."""
    return physical_guess(chain_model(aircraft, example_flight(), links))


def flown(aircraft: Aircraft, schedules, model: ModelChoice, duration_s=0.5) -> Simulation:
    """A short flight."""
    return fly(
        aircraft, example_flight(), schedules, model=model, duration_s=duration_s, lattice=COARSE,
        **({"elements": 4, "step_s": 0.0025} if model == "flexible" else {"step_s": 0.005}),
    )  # fmt: skip


@pytest.mark.parametrize("kind", ["rigid", "equivalent", "flexible"])
def test_a_vector_is_the_letter_it_spells(kind):
    """[0, 0, 1] on the right and [0, 0, -1] on the left fly as z does, to the bit."""
    plain = example_aircraft()
    spelled = replace(
        plain,
        surfaces=tuple(
            replace(surface, hinges=(replace(surface.hinges[0], axis_B=(0.0, 0.0, surface.span_sign)),))
            for surface in plain.surfaces
        ),
    )
    document = on_hinges([{**SWEEP, "name": "sweep", "axis": [0.0, 0.0, 2.0]}])
    lettered = on_hinges([SWEEP])
    schedules = {"sweep_left": ConstantRate(0.0, 0.5, 0.4), "sweep_right": ConstantRate(0.0, 0.3, 0.5)}
    for one, other in ((plain, spelled), (aircraft_of(lettered), aircraft_of(document))):
        found = [
            flown(aircraft, schedules, guess_of(aircraft) if kind == "equivalent" else kind, 0.2).trajectory
            for aircraft in (one, other)
        ]
        np.testing.assert_array_equal(found[0].euler, found[1].euler)
        assert np.ptp(found[0].phi) > 1e-4


@pytest.mark.parametrize("kind", ["rigid", "equivalent", "flexible"])
def test_two_hinges_in_one_place_are_one(kind):
    """About one axis and point by a and by b is by a + b: 1e-10 rad.

    Over 0.3 s, in which what the trim's iteration leaves (1e-11 rad) has not yet grown tenfold.
    """
    again = {**CANT, "name": "more"}
    single, double = hinged_wings(CANT), hinged_wings(CANT, again)
    # their sum in 0.3 s is no whole number of the table's spacings, at which round-off would add a node
    a, b = ConstantRate(0.0, 0.29, 0.4), ConstantRate(0.0, 0.2, 0.5)
    times = np.array([0.0, 0.1, 0.2, 0.3, 0.4, 0.5])

    class Sum:
        """Both motions together."""

        def motion(self, time_s):
            one, other = a.motion(time_s), b.motion(time_s)
            return type(one)(*(getattr(one, n) + getattr(other, n) for n in vars(one)))

    assert Sum().motion(times).angle[-1] == pytest.approx(0.49)
    model = guess_of(single) if kind == "equivalent" else kind
    found = flown(double, {"cant": a, "more": b}, model, 0.3).trajectory
    expected = flown(single, {"cant": Sum()}, model, 0.3).trajectory
    assert np.ptp(expected.theta) > 1e-2
    np.testing.assert_allclose(found.euler, expected.euler, rtol=0, atol=1e-10)


KINDS = {
    "sweep": [SWEEP],
    "fold": [FOLD],
    "incidence": [{"axis": "y", "position_m": [0.05, 0.4, 0.0]}],
    "cant": [CANT],
    "sweep and fold": [SWEEP, FOLD],
}


@pytest.mark.parametrize("hinges", KINDS.values(), ids=KINDS.keys())
@pytest.mark.parametrize("kind", ["rigid", "equivalent", "flexible"])
def test_mirrored_drives_give_mirrored_flights(hinges, kind):
    """Left and right exchanged: roll and yaw change sign and pitch does not, to 1e-9 rad."""
    aircraft = hinged_wings(*hinges)
    size = 0.05 if hinges[0]["axis"] == "y" else 0.4
    slow, fast = ConstantRate(0.0, 0.6 * size, 0.5), ConstantRate(0.0, size, 0.4)
    later = ConstantRate(0.0, -0.3, 0.4, start_s=0.05)
    model = guess_of(aircraft) if kind == "equivalent" else kind
    words = list(dict.fromkeys(drive.word for drive in aircraft.drives.values()))
    given = [
        {f"{words[0]}_left": one, f"{words[0]}_right": other} for one, other in ((slow, fast), (fast, slow))
    ]
    if len(words) > 1:
        given = [each | {words[1]: later} for each in given]
    there, back = (flown(aircraft, schedules, model, 0.3).trajectory for schedules in given)
    assert np.ptp(there.phi) > 1e-3
    np.testing.assert_allclose(back.euler, there.euler * [-1.0, 1.0, -1.0], rtol=0, atol=1e-9)


@pytest.mark.parametrize("hinges", KINDS.values(), ids=KINDS.keys())
def test_half_an_aircraft_stands_for_both_sides_of_any_drive(hinges):
    """Drives that move alike on both sides fly half an aircraft, and to round-off as the whole does."""
    aircraft = hinged_wings(*hinges)
    model = small_model(aircraft, example_flight(), 2)
    schedules = [ConstantRate(0.0, 0.05, 0.2)] * len(aircraft.hinges)
    grid = time_grid(np.linspace(0.0, 0.3, 31))
    half, whole = (flight_plan(model, schedules, grid, may_halve=halve) for halve in (True, False))
    assert half.halved
    assert not whole.halved
    columns = list(model.mirror.own_hinges)
    np.testing.assert_array_equal(half.hinges, whole.hinges[:, list(model.mirror.own)])
    np.testing.assert_array_equal(half.angles, whole.angles[:, columns])
    np.testing.assert_array_equal(model.mirror.spread_hinges(half.angles), whole.angles)
    alone = [
        Hold() if hinge.drive.endswith("left") else ConstantRate(0.0, 0.05, 0.2) for hinge in aircraft.hinges
    ]
    assert not flight_plan(model, alone, grid, may_halve=True).halved


@pytest.mark.parametrize("links", [1, 3])
def test_motors_of_two_hinges_do_the_work_that_the_aircraft_gains(links):
    """In a vacuum, without damping, the power of all hinges' torques is the change of energy.

    Sweep, fold and a skew hinge a wing, all moving; trapezia over steps of 1 ms leave 1e-4.
    """
    model = small_model(hinged_wings(CANT, SWEEP, FOLD), airless(example_flight()), links)
    guess = physical_guess(model)
    batch = guess.changed(damping_nms_rad=0.0 * guess["damping_nms_rad"])
    schedules = [
        Spline(np.array([0.0, 0.3, 0.6]), np.array([0.0, 0.2, angle]))
        for angle in (0.5, 0.3, -0.4, 0.2, 0.6, -0.1)
    ]
    plan = flight_plan(model, schedules, time_grid(np.linspace(0.0, 0.6, 61), 0.001))
    rest = np.zeros((1, model.state_rows))
    rest[0, 0] = 1.0
    states = fly_free(model, plan, batch, rest).states[:, 0]
    constants = lane_constants(model, batch, plan.grid.step_s)
    constants.set_thrust(np.zeros((1, 3)), np.zeros((1, 3)))
    torques = hinge_torques(model, plan, constants, states)
    assert (np.abs(torques).max(axis=0) > 1.0).all()
    power = np.sum(torques * plan.rates, axis=1)
    work = np.concatenate([[0.0], np.cumsum(0.5 * (power[1:] + power[:-1]) * plan.grid.step_s)])
    tree = chain_tree(model, batch)
    rows = range(0, plan.grid.steps + 1, 50)
    gravity_N = np.array([0.0, 0.0, model.flight.gravity_m_s2])
    totals = []
    for row in rows:
        hinges = np.stack([plan.angles[row], plan.rates[row], plan.accelerations[row]], axis=1)
        totals.append(energy(tree, motion_of(model, hinges, states[row]), gravity_N).total)
    gained = np.array(totals) - totals[0]
    assert np.abs(gained).max() > 10.0  # J: the test is about something
    np.testing.assert_allclose(work[list(rows)], gained, rtol=0, atol=1e-4 * np.abs(gained).max())


@pytest.mark.parametrize("hinges", [[SWEEP, FOLD], [CANT]], ids=["sweep and fold", "cant"])
def test_stiff_beams_on_several_hinges_fly_as_the_rigid_model(hinges):
    """The flexible model obeys the same motion: stiff, both programs agree within 4 mrad."""
    aircraft = hinged_wings(*hinges, youngs_modulus_pa=1e12)
    words = list(dict.fromkeys(drive.word for drive in aircraft.drives.values()))
    schedules = {
        f"{words[0]}_left": ConstantRate(0.0, 0.3, 0.5),
        f"{words[0]}_right": ConstantRate(0.0, 0.5, 0.5),
    }
    schedules |= {word: ConstantRate(0.0, -0.3, 0.4) for word in words[1:]}
    beams, links = (flown(aircraft, schedules, model, 0.6).trajectory for model in ("flexible", "rigid"))
    assert np.ptp(links.theta) > 2e-2
    assert np.ptp(links.phi) > 2e-2
    np.testing.assert_allclose(beams.euler, links.euler, rtol=0, atol=4e-3)


def with_tail() -> Aircraft:
    """Wings that sweep, and a tail of two halves whose incidence can be set."""
    document = on_hinges([SWEEP])
    for wing in list(document["surfaces"]):
        sign = 1.0 if wing["side"] == "right" else -1.0
        tail = {**wing, "name": f"tail {wing['side']}", "span_m": 0.8, "flexible": False}
        tail |= {"position_m": [-2.3, 0.1 * sign, -0.3]}
        tail |= {"hinges": [{"axis": "y", "position_m": [-2.3, 0.1 * sign, -0.3], "angle_rad": -0.02}]}
        document["surfaces"].append(tail)
    return aircraft_of(document)


@pytest.mark.parametrize("kind", ["rigid", "equivalent", "flexible"])
def test_sweeping_the_wing_leaves_the_tail_alone(kind):
    """A drive that no schedule moves holds its hinges' angle, and `both` is refused where it is ambiguous."""
    aircraft = with_tail()
    model = guess_of(aircraft) if kind == "equivalent" else kind
    sweep = ConstantRate(0.0, 0.5, 0.4)
    found = flown(aircraft, {"sweep": sweep}, model, 0.2).trajectory
    assert list(found.drives) == ["sweep_right", "sweep_left", "incidence_right", "incidence_left"]
    np.testing.assert_array_equal(found.drives["incidence_left"], -0.02)
    np.testing.assert_array_equal(found.drives["incidence_right"], -0.02)
    np.testing.assert_array_equal(found.sweep_left, found.drives["sweep_left"])
    named = {"sweep": sweep, "incidence": Hold(-0.02)}
    np.testing.assert_array_equal(found.euler, flown(aircraft, named, model, 0.2).trajectory.euler)
    with pytest.raises(InvalidInput) as caught:
        flown(aircraft, {"both": sweep}, model)
    assert caught.value.pointer == "/schedules/both"
    for name in ("sweep", "incidence"):
        assert name in caught.value.hint


def test_a_hinge_is_turned_about_its_axis_by_the_right_hand():
    """A point on a skew axis stays, and any other goes round it: against the axis-angle formula."""
    surface = hinged_wings(CANT).surfaces[0]
    (hinge,) = surface.hinges
    axis, pivot = np.array(hinge.axis_B), np.array(hinge.position_m)
    R_BW, r_B = surface_pose(surface, [0.4])
    arm = np.array(surface.position_m) - pivot
    cross = np.cross(axis, arm)
    turned = arm * np.cos(0.4) + cross * np.sin(0.4) + axis * (axis @ arm) * (1.0 - np.cos(0.4))
    np.testing.assert_allclose(r_B, pivot + turned, atol=1e-14)
    np.testing.assert_allclose(R_BW @ axis, axis, atol=1e-14)
    np.testing.assert_allclose(R_BW @ R_BW.T, np.eye(3), atol=1e-14)


def test_letters_are_vectors_of_their_side():
    """x, y and z name the axes that turn mirror images alike."""
    for axis, right, left in (
        ("x", (-1, 0, 0), (1, 0, 0)),
        ("y", (0, 1, 0), (0, 1, 0)),
        ("z", (0, 0, 1), (0, 0, -1)),
    ):
        wings = [rehinged(surface, axis) for surface in example_aircraft().surfaces]
        assert [wing.hinges[0].axis_B for wing in wings] == [right, left]


def test_a_path_moves_its_drives_and_holds_the_others():
    """Angles of all hinges along the path of some drives."""
    aircraft = with_tail()
    angles = path_angles(aircraft, ("sweep_left", "sweep_right"), np.array([0.0, 0.3]))
    np.testing.assert_array_equal(angles, [[0.0, 0.0, -0.02, -0.02], [0.3, 0.3, -0.02, -0.02]])
