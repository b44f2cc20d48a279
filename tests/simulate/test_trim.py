"""Trim: nothing accelerates, forces and moments balance by an independent sum, wings bend as beams do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from morphcore.errors import InvalidInput, TrimNotFound
from morphcore.lanes import TOGETHER
from morphcore.models.equivalent import chain_model, lane_constants, physical_guess
from morphcore.models.kinematics import tip_positions
from morphcore.simulate.batch import state_rates
from morphcore.simulate.time_grid import STEP_S
from morphcore.simulate.trim import SLAB, trim, trimmed_state
from morphdata.lattice import Lattice, VortexCore
from tests.models.chains import (
    airless,
    example_aircraft,
    example_flight,
    instant,
    motion_of,
    random_batch,
    small_model,
)
from tests.oracles.chain_tree import chain_tree
from tests.oracles.dynamics import Acceleration, inverse_dynamics
from tests.simulate.flights import example_model

SWEPT = np.array([[0.3, 0.0, 0.0], [0.5, 0.0, 0.0]])


def start_rates(model, batch, hinges, found):
    """Rates of the trimmed state under the trim's force and moment."""
    plan = instant(model, hinges)
    constants = lane_constants(model, batch, STEP_S)
    constants.set_thrust(found.force_B, found.moment_B)
    return state_rates(model, plan, 0, constants, trimmed_state(model, batch, plan, found))


@pytest.mark.parametrize("links", [1, 2, 5, 8])
def test_nothing_accelerates(links):
    """The trimmed start has neither base nor joint accelerations, for random parameters and unlike sweeps.

    Newton's last step of 1e-11 rad leaves 1e-7 m/s^2; joints are stiffer by a thousand. The flight is
    level: the place moves along north.
    """
    rng = np.random.default_rng(links)
    model = example_model(links)
    batch = random_batch(rng, model, 4, separate_wings=True)
    found = trim(model, batch, instant(model, SWEPT)).require()
    rates = start_rates(model, batch, SWEPT, found)
    n = model.coordinates
    np.testing.assert_allclose(rates[:, 4:10], 0.0, atol=1e-6)
    np.testing.assert_allclose(rates[:, 13 + n : 13 + 2 * n], 0.0, atol=1e-3)
    np.testing.assert_allclose(rates[:, 10:13], [[model.flight.airspeed_m_s, 0.0, 0.0]] * 4, atol=1e-9)


def test_forces_balance_by_an_independent_sum():
    """Weight is borne by the air and thrust: what the trim's thrust leaves of it is the lattice's lift.

    Sum over the whole aircraft by Newton and Euler's recursion on the separately built tree, at rest, under
    gravity: the required wrench is thrust plus air. With the air's lift known from the dynamic pressure and
    the trimmed lift coefficient of flat wings, they agree.
    """
    model = example_model(3)
    batch = physical_guess(model)
    plan = instant(model, np.zeros((2, 3)))
    found = trim(model, batch, plan).require()
    tree = chain_tree(model, batch)
    motion = motion_of(model, np.zeros((2, 3)), trimmed_state(model, batch, plan, found)[0])
    requested = inverse_dynamics(
        tree, motion, Acceleration(np.zeros(6), np.zeros(tree.coordinates)), None, [0, 0, 9.81]
    )
    weight = 9.81 * (875.0 + 90.0)
    assert np.linalg.norm(requested.base_wrench_B[3:]) == pytest.approx(weight, rel=1e-12)
    # along and across the path: thrust bears the drag, the air the weight
    alpha = found.alpha[0]
    up_B = np.array([np.sin(alpha), 0.0, -np.cos(alpha)])
    lift = requested.base_wrench_B[3:] @ up_B - found.force_B[0] @ up_B
    assert lift == pytest.approx(weight, rel=1e-9)
    area_q = model.flight.dynamic_pressure_pa * 1.8
    # 0.4806 at 5 degrees for the gapless pair; twist adds to the angle, gap and curvature take a little away
    twist = found.q_joint[0, [1, 4]].sum() * 0.6
    assert lift / area_q == pytest.approx(0.4806 / np.deg2rad(5.0) * (alpha + twist), rel=0.1)


def test_given_start_settles_the_joints_only():
    """With angle of attack, force and moment given, the joints rest; the base goes where the forces want."""
    model = example_model(3)
    batch = physical_guess(model)
    found = trim(model, batch, instant(model, np.zeros((2, 3))), start="given").require()
    start = model.flight.start
    assert found.alpha[0] == start.alpha_rad
    np.testing.assert_array_equal(found.force_B[0], start.force_B)
    rates = start_rates(model, batch, np.zeros((2, 3)), found)
    n = model.coordinates
    np.testing.assert_allclose(rates[0, 13 + n : 13 + 2 * n], 0.0, atol=1e-3)
    assert 0.01 < np.abs(rates[0, 4:10]).max() < 2.0  # the truth's trim is nearly this model's


@pytest.mark.parametrize(("law", "low", "high"), [("line", 0.09, 0.12), ("smoothed", 0.0, 0.02)])
def test_the_samples_trim_is_that_of_a_smoothed_core(law, low, high):
    """The sample flights' angle of attack, 0.0623 rad, is the trim with a smoothed core, not with a thin one.

    The example's wings with eight links: 0.0635 rad with the smoothed core, within 2 per cent of the
    flight's start; 0.0692 rad with the thin one, 11 per cent above it. More links take another per cent off.
    """
    flight = example_flight()
    chosen = Lattice(core=VortexCore(law=law))
    model = chain_model(example_aircraft(), flight, 8, chosen)
    found = trim(model, physical_guess(model), instant(model, np.zeros((2, 3)))).require()
    assert low < found.alpha[0] / flight.start.alpha_rad - 1 < high


def test_given_start_needs_a_start():
    """The error points to the field that is missing."""
    model = chain_model(example_aircraft(), replace(example_flight(), start=None), 2)
    with pytest.raises(InvalidInput) as caught:
        trim(model, physical_guess(model), instant(model, np.zeros((2, 3))), start="given")
    assert caught.value.pointer == "/flight/start"


def test_no_trim_in_a_vacuum():
    """Without air there is no level flight: an error with its residual, not a number."""
    model = small_model(example_aircraft(), airless(example_flight()), 2)
    with pytest.raises(TrimNotFound) as caught:
        trim(model, physical_guess(model), instant(model, np.zeros((2, 3)))).require()
    assert caught.value.iterations > 0


def test_one_hopeless_particle_does_not_spoil_the_others():
    """Trim reports for each particle; slabs of many particles give what each gives alone."""
    rng = np.random.default_rng(0)
    model = small_model(example_aircraft(), example_flight(), 2)
    batch = random_batch(rng, model, SLAB + 3)
    batch["lift_factor"][5] = 1e-9  # nothing carries it
    found = trim(model, batch, instant(model, SWEPT))
    assert not found.converged[5]
    good = np.arange(SLAB + 3) != 5
    assert found.converged[good].all()
    alone = trim(model, batch.select(np.array([SLAB + 2])), instant(model, SWEPT))
    np.testing.assert_allclose(found.q_joint[-1], alone.q_joint[0], rtol=0, atol=1e-12)


def test_a_trim_does_not_depend_on_who_shares_its_slab():
    """Blocks of lanes trimmed together or on their own give the same numbers, to the bit.

    Among 96 random models some arrive an iteration later than others; one of them flies nowhere at all.
    """
    model = example_model(3)
    batch = random_batch(np.random.default_rng(11), model, 96)
    batch["lift_factor"][40] = 1e-12
    plan = instant(model, SWEPT)
    together = trim(model, batch, plan)
    for low in range(0, 96, TOGETHER):
        part = slice(low, low + TOGETHER)
        alone = trim(model, batch.select(part), plan)
        for name in ("alpha", "force_B", "moment_B", "q_joint", "converged", "residual"):
            np.testing.assert_array_equal(getattr(alone, name), getattr(together, name)[part])


@pytest.mark.parametrize("wind_N", [(0.0, 0.0, 0.0), (8.0, -5.0, 2.0)])
def test_wind_carries_the_trimmed_aircraft(wind_N):
    """Level flight through the air: in wind the same trim, the place drifting with the air."""
    flight = replace(example_flight(), wind_N=np.array(wind_N))
    model = chain_model(example_aircraft(), flight, 2)
    batch = physical_guess(model)
    found = trim(model, batch, instant(model, SWEPT)).require()
    calm = trim(example_model(2), batch, instant(model, SWEPT)).require()
    np.testing.assert_allclose(found.alpha, calm.alpha, rtol=1e-9)
    rates = start_rates(model, batch, SWEPT, found)
    np.testing.assert_allclose(rates[0, 4:10], 0.0, atol=1e-6)
    np.testing.assert_allclose(rates[0, 10:13], np.array([150.0, 0.0, 0.0]) + wind_N, atol=1e-9)


def uniformly_loaded(links, *, load, axis):
    """Tips (2, 3) on a very heavy fuselage that accelerates at ``load`` m/s^2 along an axis; the model."""
    aircraft, flight = example_aircraft(), airless(example_flight(), gravity=0.0)
    heavy = replace(aircraft.fuselage, mass_kg=1e9, inertia_B=1e9 * np.eye(3))
    push = np.zeros(3)
    push[axis] = load * (1e9 + 90.0)
    start = replace(flight.start, alpha_rad=0.0, force_B=push, moment_B=np.zeros(3))
    model = small_model(replace(aircraft, fuselage=heavy), replace(flight, start=start), links)
    batch = physical_guess(model)
    plan = instant(model, np.zeros((2, 3)))
    found = trim(model, batch, plan, start="given").require()
    return tip_positions(model, batch, plan.hinges[0], found.q_joint)[0], model


@pytest.mark.parametrize(("axis", "sign"), [(2, 1.0), (0, -1.0)])
@pytest.mark.parametrize("links", [2, 4, 8])
def test_tip_under_a_uniform_load(links, axis, sign):
    """Under its own inertia a wing bends as a cantilever, q L^4 / (8 EI) at the tip, less what joints miss.

    The chain has m = n - 1 equal segments, numbered from the tip, and each bends by its integral
    of (L - y) / EI at 2/3 (3 i^2 + 3 i + 1) / (2 i + 1) segments from the tip. The factor tends to one.
    Loads are small enough for small angles: what remains is of second order in 9e-3 rad.
    """
    load = 0.5 if axis == 2 else 2.0
    tips, model = uniformly_loaded(links, load=-sign * load, axis=axis)
    wing = model.aircraft.surfaces[0]
    section = wing.section_at(np.zeros(1))
    rigidity = float((section.ei_flap if axis == 2 else section.ei_edge)[0])
    beam = 15.0 * load * 3.0**4 / (8.0 * rigidity)
    i = np.arange(links - 1)
    factor = 8.0 / 9.0 * np.sum((3 * i**2 + 3 * i + 1) ** 2 / (2 * i + 1)) / (links - 1) ** 4
    expected = sign * beam * factor
    np.testing.assert_allclose(tips[:, axis], expected, rtol=1e-4)
    np.testing.assert_allclose(tips[:, 1], [3.0, -3.0], atol=1e-5)


def test_chains_tend_to_the_beam():
    """Extrapolated in 1 / (n - 1)^2 from 4 and 8 links, the tip is the beam's within 0.1 per cent."""
    four, eight = (uniformly_loaded(links, load=-0.5, axis=2)[0][0, 2] for links in (4, 8))
    wing = example_aircraft().surfaces[0]
    beam = 15.0 * 0.5 * 3.0**4 / (8.0 * float(wing.section_at(np.zeros(1)).ei_flap[0]))
    assert (49.0 * eight - 9.0 * four) / 40.0 == pytest.approx(beam, rel=1e-3)
