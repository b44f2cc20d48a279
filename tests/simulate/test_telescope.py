"""Telescoping wings: against fixed wings of the visible span, symmetry, momentum, work of drives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from morphcore import optimise_schedule, simulate
from morphcore.aero.operator import aircraft_lattice, lattice_operator
from morphcore.frames import rotation_from_quaternion
from morphcore.geometry.aircraft import Aircraft, Flight
from morphcore.models.equivalent import chain_model, lane_constants, physical_guess
from morphcore.models.kernels.layout import JOINTS
from morphcore.models.kernels.telescope import HELD
from morphcore.models.kinematics import link_poses
from morphcore.models.links import link_edges, link_masses, segment_ends
from morphcore.models.telescope import mouth_forces
from morphcore.simulate.plan import flight_plan
from morphcore.simulate.schedule import Spline
from morphcore.simulate.time_grid import time_grid
from morphcore.simulate.torque import hinge_torques
from morphdata.lattice import Lattice
from morphdata.optimize import Limits, Morph, OptimizeResult, ScheduleSearch
from tests.models.chains import airless
from tests.simulate.flights import fly_free
from tests.simulate.telescoped import (
    FLIGHT,
    FUSELAGE,
    HIDDEN_M,
    INNER_M,
    PANEL_M,
    ROOT_M,
    SIDES,
    extended,
    panel,
    telescoped,
    with_fixed_span,
)

EXTENSIONS = (0.0, 0.3, 0.8, 1.0)
COARSE = Lattice(chordwise=2, spanwise=6)


def single_wing(extension_m):
    """The aircraft with one panel on either side, and the masses of the telescoping ones where they are."""
    span = INNER_M + PANEL_M - HIDDEN_M + extension_m
    surfaces = [panel("wing", side, span, sign * ROOT_M, thickness_m=0.08) for side, sign in SIDES]
    hidden = HIDDEN_M - extension_m
    masses = [
        {"mass_kg": 500.0 * 0.3 * 0.08 * hidden, "position_m": [0.0, sign * (ROOT_M + INNER_M), 0.0]}
        for _, sign in SIDES
        if hidden > 0.0
    ]
    return {"name": "single", "fuselage": FUSELAGE, "surfaces": surfaces, "point_masses": masses}


@pytest.mark.parametrize("extension_m", EXTENSIONS)
def test_lattice_is_that_of_a_fixed_wing_of_the_visible_span(extension_m):
    """At each extension the reduced operator is that of the same panels without hinges, to round-off."""
    slid = aircraft_lattice(Aircraft.of(telescoped()))
    fixed = aircraft_lattice(Aircraft.of(with_fixed_span(extension_m)))
    found, expected = lattice_operator(slid, [extension_m] * 2), lattice_operator(fixed, [])
    np.testing.assert_allclose(found.matrix, expected.matrix, rtol=0, atol=1e-12)


@pytest.mark.parametrize("model", ["rigid", "flexible"])
@pytest.mark.parametrize("extension_m", EXTENSIONS)
def test_trim_is_that_of_a_fixed_wing(extension_m, model):
    """Angle of attack, thrust, lift and moment at rest: the hidden part has its mass, and no air loads."""
    found = simulate(telescoped(extension_m), FLIGHT, {}, model=model, duration_s=0.05).trim
    expected = simulate(with_fixed_span(extension_m), FLIGHT, {}, model="rigid", duration_s=0.05).trim
    np.testing.assert_allclose(found.alpha, expected.alpha, rtol=0, atol=1e-8)
    np.testing.assert_allclose(found.force_B, expected.force_B, rtol=0, atol=1e-5)
    np.testing.assert_allclose(found.moment_B, expected.moment_B, rtol=0, atol=1e-5)


@pytest.mark.parametrize(("extension_m", "tolerance"), [(0.8, 1e-6), (0.5, 0.01), (0.2, 0.01)])
def test_lift_is_that_of_one_wing_of_the_whole_span(extension_m, tolerance):
    """Inner and outer panels together lift and drag like one: exactly where their strips coincide."""
    found, expected = (
        simulate(document, FLIGHT, {}, lattice=Lattice(spanwise=strips), duration_s=0.05).trim
        for document, strips in ((telescoped(extension_m), 8), (single_wing(extension_m), 16))
    )
    np.testing.assert_allclose(found.alpha, expected.alpha, rtol=tolerance)
    np.testing.assert_allclose(found.force_B[0, 0], expected.force_B[0, 0], rtol=tolerance)


@pytest.mark.parametrize("kind", ["rigid", "equivalent", "flexible"])
def test_mirrored_extensions_give_mirrored_flights(kind):
    """Roll and yaw change their sign, pitch stays, to 1e-9 rad; in every model."""
    document = telescoped(flexible=kind != "rigid")
    model = kind
    if kind == "equivalent":
        model = physical_guess(chain_model(Aircraft.of(document), Flight.of(FLIGHT), 3))
    right, left = (
        simulate(
            document,
            FLIGHT,
            {f"span_{side}": extended(0.1, 0.6)},
            model=model,
            duration_s=0.6,
            lattice=COARSE,
            elements=4,
        ).trajectory
        for side in ("right", "left")
    )
    np.testing.assert_allclose(right.euler, left.euler * [-1.0, 1.0, -1.0], rtol=0, atol=1e-9)
    assert np.abs(right.phi).max() > 0.02


def test_chains_fly_like_beams():
    """Chain and flexible model of the same panels, moved out and in again, stay within a milliradian."""
    document = telescoped(flexible=True)
    knots = {"kind": "spline", "knot_time_s": [0.1, 0.6, 1.1], "knot_extension_m": [0.1, 0.9, 0.3]}
    guess = physical_guess(chain_model(Aircraft.of(document), Flight.of(FLIGHT), 4))
    flown = [
        simulate(document, FLIGHT, {"span": knots}, model=model, duration_s=1.2, elements=6).trajectory.theta
        for model in ("flexible", guess)
    ]
    assert np.abs(flown[0] - flown[1]).max() < 1e-3
    assert np.ptp(flown[0]) > 0.02


def vacuum_flight(links):
    """A flight without air and gravity in which one panel goes out and the other one in: plan and states."""
    aircraft = Aircraft.of(telescoped(flexible=links > 1))
    flight = airless(Flight.of(FLIGHT), gravity=0.0)
    model = chain_model(aircraft, flight, links, COARSE)
    guess = physical_guess(model)
    batch = guess.changed(damping_nms_rad=0.0 * guess["damping_nms_rad"])
    times = np.array([0.0, 0.2, 0.4])
    schedules = [Spline(times, np.array([0.1, 0.5, 0.9])), Spline(times, np.array([0.8, 0.3, 0.2]))]
    plan = flight_plan(model, schedules, time_grid(np.linspace(0.0, 0.4, 401), 0.001), start="given")
    state = np.zeros((1, model.state_rows))
    state[0, 0] = 1.0
    state[0, 4:10] = [0.2, -0.1, 0.1, 20.0, 1.0, -2.0]
    return model, batch, plan, fly_free(model, plan, batch, state).states[:, 0]


def bodies(model, batch, plan, states):
    """Poses (k, b, ..) of fuselage and links in N, and their mass properties about their origins."""
    R_NB = np.stack([rotation_from_quaternion(each[:4]) for each in states])
    R, r = [R_NB], [states[:, 10:13]]
    fuselage = model.aircraft.fuselage
    inertia = [(fuselage.mass_kg, fuselage.mass_kg * fuselage.centre_of_mass_B, fuselage.inertia_B)]
    turned = states[:, JOINTS : JOINTS + model.coordinates]
    poses = [link_poses(model, batch, plan.hinges[n], turned[n : n + 1]) for n in range(len(states))]
    for link in range(model.links):
        R_BL = np.stack([each[0][0, link] for each in poses])
        r_B = np.stack([each[1][0, link] for each in poses])
        R.append(R_NB @ R_BL)
        r.append(states[:, 10:13] + np.einsum("kij,kj->ki", R_NB, r_B))
    chosen = model.set_of(batch)
    for number, surface in enumerate(model.aircraft.surfaces):
        division = batch["division"][:, chosen[number]] if surface.flexible else np.ones((1, 1))
        for row in link_masses(surface, link_edges(division, surface.length_m))[0]:
            m, mx, my, xx, yy, zz, xy = row
            inertia.append((m, np.array([mx, my, 0.0]), np.array([[xx, xy, 0], [xy, yy, 0], [0, 0, zz]])))
    return np.stack(R, axis=1), np.stack(r, axis=1), inertia


def momentum_and_energy(model, batch, plan, states):
    """Linear momentum (k, 3) and kinetic energy (k,) by differences of the poses in time."""
    R, r, inertia = bodies(model, batch, plan, states)
    step = plan.grid.step_s
    dR, v = np.gradient(R, step, axis=0, edge_order=2), np.gradient(r, step, axis=0, edge_order=2)
    spin = np.einsum("kbji,kbjl->kbil", R, dR)
    omega = np.stack([spin[..., 2, 1], spin[..., 0, 2], spin[..., 1, 0]], axis=-1)
    momentum, energy = np.zeros((len(states), 3)), np.zeros(len(states))
    for b, (mass, first, about) in enumerate(inertia):
        turning = np.einsum("kij,kj->ki", R[:, b], np.cross(omega[:, b], first))
        momentum += mass * v[:, b] + turning
        energy += 0.5 * mass * np.sum(v[:, b] ** 2, axis=1) + np.sum(v[:, b] * turning, axis=1)
        energy += 0.5 * np.einsum("ki,ij,kj->k", omega[:, b], about, omega[:, b])
    return momentum, energy


def strain_energy(model, batch, plan, states):
    """Energy (k,) of the joints, whose stiffness counts for the visible part of their segment."""
    out, joint, chosen = np.zeros(len(states)), 0, model.set_of(batch)
    for number, surface in enumerate(model.aircraft.surfaces):
        if not surface.flexible or model.links_per_wing == 1:
            continue
        edges = link_edges(batch["division"][:, chosen[number]], surface.length_m)
        ends = segment_ends(surface, edges)[0] - surface.length_m
        hidden = HIDDEN_M - plan.angles[:, number // 2] - surface.length_m
        for k in range(model.links_per_wing - 1):
            seen = np.clip(hidden, ends[k], ends[k + 1])
            share = (seen**2 - ends[k + 1] ** 2) / (ends[k] ** 2 - ends[k + 1] ** 2)
            angles = states[:, JOINTS + 3 * joint : JOINTS + 3 * joint + 3]
            stiffness = batch["stiffness_nm_rad"][0, chosen[number], k]
            out += 0.5 * np.sum(stiffness * angles**2, axis=1) / np.maximum(share, HELD)
            joint += 1
    return out


@pytest.mark.parametrize("links", [1, 3])
def test_sliding_masses_keep_the_momentum_and_drives_do_the_work(links):
    """Without air and gravity: momentum is constant, and the drives' work is the energy gained.

    Poses are differenced in steps of 1 ms.
    """
    model, batch, plan, states = vacuum_flight(links)
    momentum, energy = momentum_and_energy(model, batch, plan, states)
    energy += strain_energy(model, batch, plan, states)
    scale = np.abs(momentum).max()
    inside = slice(2, -2)  # differences at the ends are of lower order
    np.testing.assert_allclose(momentum[inside] - momentum[2], 0.0, atol=1e-6 * scale)
    constants = lane_constants(model, batch, plan.grid.step_s)
    constants.set_thrust(np.zeros((1, 3)), np.zeros((1, 3)))
    power = np.sum(hinge_torques(model, plan, constants, states) * plan.rates, axis=1)
    work = np.concatenate([[0.0], np.cumsum(0.5 * (power[1:] + power[:-1]) * plan.grid.step_s)])
    assert np.abs(work).max() > 1.0
    gained, done = energy - energy[2], work - work[2]
    np.testing.assert_allclose(done[inside], gained[inside], atol=2e-4 * np.abs(work).max())


def test_drives_feel_the_strain_energy_that_the_mouth_takes():
    """The force of a bent panel on its drive is the slope of its strain energy over the extension."""
    model, batch, plan, states = vacuum_flight(3)
    states = states[40::40].copy()
    states[:, JOINTS : JOINTS + model.coordinates] = 0.05 * np.sin(1.0 + np.arange(model.coordinates))
    constants = lane_constants(model, batch, plan.grid.step_s)
    angles = plan.angles[40::40]
    found = mouth_forces(model, constants.rows[0], angles, states)
    shift = 1e-6
    for column in range(2):
        energies = []
        for sign in (1.0, -1.0):
            moved = angles.copy()
            moved[:, column] += sign * shift
            energies.append(strain_energy(model, batch, replace(plan, angles=moved), states))
        expected = (energies[0] - energies[1]) / (2.0 * shift)
        np.testing.assert_allclose(found[:, column], expected, rtol=1e-5, atol=1e-5)
    assert found.min() < -1.0  # bent panels push themselves outward


def test_wake_warnings_and_overlap_leave_the_hidden_part_out():
    """A panel inside another one is no overlap of lifting surfaces, and a telescoped flight is quiet."""
    flown = simulate(
        telescoped(0.2), {**FLIGHT, "airspeed_m_s": 120.0}, {"span": extended(0.2, 0.5)}, duration_s=0.6
    )
    assert flown.warnings == ()


def test_point_masses_ride_on_the_panel():
    """A mass at the tip of a panel moves outward with it."""
    document = telescoped(0.0)
    document["point_masses"] = [
        {"mass_kg": 5.0, "surface": f"{side} outer", "at": 1.0, "offset_m": [0.1, 0.0]} for side, _ in SIDES
    ]
    fixed = with_fixed_span(0.7)
    masses = [
        {"mass_kg": 5.0, "surface": f"{side} outer", "at": 1.0, "offset_m": [0.1, 0.0]} for side, _ in SIDES
    ]
    fixed["point_masses"] = [*fixed["point_masses"], *masses]
    held = replace_held(document, 0.7)
    trims = [simulate(each, FLIGHT, {}, duration_s=0.05).trim for each in (held, fixed)]
    np.testing.assert_allclose(trims[0].moment_B, trims[1].moment_B, atol=1e-6)


def replace_held(document, extension_m):
    """The document with its panels held at an extension."""
    surfaces = [
        {**each, "hinges": [{**each["hinges"][0], "extension_m": extension_m}]} if "hinges" in each else each
        for each in document["surfaces"]
    ]
    return {**document, "surfaces": surfaces}


def test_a_morph_in_metres_is_optimised_under_limits_in_metres():
    """The result names extensions, rates and forces; its schedule keeps the limits and flies."""
    document = telescoped(flexible=True)
    guess = physical_guess(chain_model(Aircraft.of(document), Flight.of(FLIGHT), 2, COARSE))
    found = optimise_schedule(
        document,
        FLIGHT,
        guess,
        morph=Morph(final_m=0.5, duration_s=0.8, knots=3, settle_s=0.2),
        limits=Limits(max_rate_m_s=1.2, max_drive_force_n=1e4),
        search=ScheduleSearch(particles=2, generations=1),
        verify="none",
        lattice=COARSE,
    ).to_document()
    OptimizeResult(**found)
    assert found["schedule"]["knot_extension_m"][-1] == 0.5
    assert "knot_angle_rad" not in found["schedule"]
    assert found["limits"]["max_rate_m_s"] == 1.2
    assert 0.6 < found["reached"]["optimum"]["max_rate_m_s"] <= 1.2
    assert 0.0 < found["reached"]["optimum"]["max_drive_force_n"] < 1e4
    schedule = {"span": found["schedules"]["optimum"]}
    flown = simulate(document, FLIGHT, schedule, model=guess, duration_s=1.0, channels=["drive_force"])
    assert flown.trajectory.drives["span_left"][-1] == pytest.approx(0.5)
    assert np.abs(flown.trajectory.extra["drive_force_span_left"]).max() > 1.0
