"""Loads of surfaces and specific force at points: each by an independent route, in every model."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike

from morphcore.aero.moving_lattice import acting_circulation
from morphcore.frames import rotation_from_quaternion
from morphcore.geometry.aircraft import Aircraft, Flight
from morphcore.models.equivalent import chain_model, lane_constants, physical_guess
from morphcore.models.flexible import flexible_model
from morphcore.models.kinematics import link_poses
from morphcore.models.links import link_edges, link_masses
from morphcore.multibody.beam import GAUSS, Sections
from morphcore.simulate.flexible import FlexibleFlight, FlexibleRun, set_in_motion
from morphcore.simulate.flexible_outputs import FlexibleOutputs
from morphcore.simulate.flexible_start import start_flexible
from morphcore.simulate.flight import Simulation
from morphcore.simulate.record import Outputs
from morphcore.simulate.schedule import HingeMotion, Hold
from morphcore.simulate.shape import SurfaceShape
from morphcore.simulate.torque import chain_loads, hinge_torques
from morphcore.simulate.trim import trim, trimmed_state
from morphdata.channels import CHANNELS as KNOWN
from morphdata.channels import column_parts
from morphdata.lattice import Lattice
from morphdata.points import Point
from tests.aero.link_loads import lane_loads
from tests.models.chains import (
    Swing,
    aircraft_of,
    airless,
    example_aircraft,
    example_flight,
    flight_of,
    motion_of,
)
from tests.oracles.chain_tree import chain_tree
from tests.oracles.dynamics import energy
from tests.simulate.flights import fly, fly_trimmed, plan_of, steps
from tests.simulate.tailed_aircraft import FLIGHT, document, rigid

Array = np.ndarray[Any, Any]

COARSE = Lattice(chordwise=1, spanwise=8)
MODELS = ["rigid", "equivalent", "flexible"]
SMOOTH = [Swing(0.15, 5.0), Swing(0.1, 4.0)]
# right sweep and fold, left sweep and fold, both incidences of the tail
DRIVES = [
    Swing(a, w) for a, w in ((0.1, 6.0), (0.05, 5.0), (-0.08, 4.0), (0.06, 7.0), (0.0, 1.0), (0.0, 1.0))
]
STEP_S, MIDDLE = 1e-3, 250
WIND_N = [1.0, -2.0, 0.5]
PER_SURFACE = [each.name for each in KNOWN if each.per in ("surface", "strip")]
POINTS = [
    Point(name="nose", position_m=[0.7, 0.1, -0.2]),
    Point(name="tip", surface="right", at=1.0, offset_m=[0.04, -0.02]),
    Point(name="inside", surface="left", at=0.43),
    Point(name="tail", surface="tail left", at=0.5),
]


@dataclass(frozen=True)
class Gentle:
    """Hinge motion a (1 - cos w t)^2, whose acceleration begins at zero, so that wings do not ring."""

    amplitude: float
    omega: float

    def motion(self, time_s: ArrayLike) -> HingeMotion:
        """The motion."""
        angle = self.omega * np.asarray(time_s, dtype=np.float64)
        a, w, sine, rest = self.amplitude, self.omega, np.sin(angle), 1.0 - np.cos(angle)
        return HingeMotion(
            a * rest**2, 2.0 * a * w * rest * sine, 2.0 * a * w**2 * (sine**2 + rest * np.cos(angle))
        )


@cache
def swept_aircraft() -> Aircraft:
    """Two kilograms with swept, raised wings that sweep and fold about offset hinges, and a tail.

    Axes off mid-chord, a store at one tip and camber: nothing is symmetric or in one plane.
    """
    given = document()
    for wing in given["surfaces"][:2]:
        y = 0.05 if wing["side"] == "right" else -0.05
        del wing["hinge"]
        wing |= {
            "sweep_rad": 0.25, "dihedral_rad": 0.1, "incidence_rad": 0.02, "zero_lift_rad": -0.02,
            "elastic_axis_offset_m": -0.02, "mass_axis_offset_m": 0.01,
            "hinges": [
                {"position_m": [0.02, y, 0.0], "axis": "z"},
                {"position_m": [0.0, 1.5 * y, 0.01], "axis": "x"},
            ],
        }  # fmt: skip
    store = {"mass_kg": 0.02, "surface": "right", "at": 1.0, "offset_m": [0.03, 0.0]}
    return aircraft_of({**given, "point_masses": [store]})


def model_of(kind: str, aircraft: Aircraft, flight: Flight) -> Any:
    """What `simulate` takes as the model."""
    return physical_guess(chain_model(aircraft, flight, 3)) if kind == "equivalent" else kind


@cache
def flown(kind: str) -> Simulation:
    """0.3 s of unequal sweeps and folds in a wind, with apparent mass, and the shape about its middle."""
    aircraft = swept_aircraft()
    flight = flight_of({**FLIGHT, "wind_n_m_s": WIND_N, "apparent_mass": True})
    return fly(
        aircraft, flight, DRIVES, model=model_of(kind, aircraft, flight), duration_s=0.3,
        output_step_s=STEP_S, step_s=STEP_S, lattice=COARSE, elements=6,
        channels=[each.name for each in KNOWN], points=POINTS,
        shape_times_s=[STEP_S * (MIDDLE + k) for k in (-1, 0, 1)],
    )  # fmt: skip


def at_middle(found: Simulation, *names: str, row: int = MIDDLE) -> Array:
    """Values of some columns at one row."""
    return np.array([found.trajectory.extra[name][row] for name in names])


def acceleration(positions: Array) -> Array:
    """Second difference of positions (3, ...) at three times."""
    return np.asarray((positions[2] - 2.0 * positions[1] + positions[0]) / STEP_S**2)


def gravity_N(found_in: Flight) -> Array:
    """Gravity (3,) in N."""
    return np.array([0.0, 0.0, found_in.gravity_m_s2])


def mass_points(aircraft: Aircraft, shapes: tuple[SurfaceShape, ...]) -> list[tuple[Array, Array]]:
    """Masses (m,) and their places (3 times, m, 3) in N of every surface, by trapezia between stations."""
    found = []
    for surface, shape in zip(aircraft.surfaces, shapes, strict=True):
        distance = shape.at * surface.length_m
        gaps = 0.5 * np.diff(distance)
        section = surface.section_at(distance)
        mass = np.tile(0.5 * section.mass * (np.append(gaps, 0.0) + np.append(0.0, gaps)), 2)
        # two halves at the radius of gyration, across the axis, have the section's inertia about it
        apart = np.sqrt(section.inertia_y / section.mass)[:, None] * np.array([1.0, 0.0, 0.0])
        centre = surface.mass_arm_at(distance)[:, None] * surface.chord_W
        places = np.concatenate(
            [
                shape.axis_N + np.einsum("tkij,kj->tki", shape.R_NS, centre + side * apart)
                for side in (1.0, -1.0)
            ],
            axis=1,
        )
        for each in surface.point_masses:  # at the tip
            arm = surface.point_mass_arm_W(each, surface.length_m)
            tip = shape.axis_N[:, -1] + shape.R_NS[:, -1] @ arm
            mass, places = np.append(mass, each.mass_kg), np.concatenate([places, tip[:, None]], axis=1)
        found.append((mass, places))
    return found


@pytest.mark.parametrize("kind", MODELS)
def test_air_thrust_and_weight_are_mass_times_acceleration(kind: str) -> None:
    """Lift, drag and side force of all surfaces, thrust and weight move the centre of mass.

    Its acceleration is the second difference of its place, 1 ms apart, out of the shape.
    """
    found, aircraft = flown(kind), swept_aircraft()
    assert found.shape is not None
    body = aircraft.fuselage
    total = body.mass_kg
    moment = total * (found.shape.position_N + found.shape.R_NB @ body.centre_of_mass_B)
    for mass, places in mass_points(aircraft, found.shape.surfaces):
        total += mass.sum()
        moment = moment + np.einsum("m,tmi->ti", mass, places)
    alpha, beta = at_middle(found, "alpha", "beta")
    parts = column_parts(surface.name for surface in aircraft.surfaces)
    lift, drag, side = (
        at_middle(found, *(f"surface_{name}_{part}" for part in parts)).sum()
        for name in ("lift", "drag", "side_force")
    )
    ahead = np.array([np.cos(alpha) * np.cos(beta), np.sin(beta), np.sin(alpha) * np.cos(beta)])
    down = np.array([-np.sin(alpha), 0.0, np.cos(alpha)])
    air_B = -drag * ahead + side * np.cross(down, ahead) - lift * down
    weight = total * 9.81
    force_N = found.shape.R_NB[1] @ (air_B + found.trim.force_B[0]) + [0.0, 0.0, weight]
    assert np.linalg.norm(force_N) > 0.05 * weight  # it does accelerate
    np.testing.assert_allclose(force_N, acceleration(moment), atol=1e-3 * weight)


@pytest.mark.parametrize("kind", MODELS)
def test_specific_force_at_points_includes_rotation(kind: str) -> None:
    """Second differences of the points' places, in the axes of what carries them, gravity subtracted."""
    found, aircraft = flown(kind), swept_aircraft()
    shape = found.shape
    assert shape is not None
    surfaces = {surface.name: surface for surface in aircraft.surfaces}
    fall = np.array([0.0, 0.0, 9.81])
    nose = shape.position_N + shape.R_NB @ POINTS[0].position_m
    expected = {"nose": shape.R_NB[1].T @ (acceleration(nose) - fall)}
    right, tip = surfaces["right"], shape.surfaces[0]
    arm = right.chord_W * (-0.04 - right.elastic_axis_x_m) + [0.0, 0.0, 0.02]
    expected["tip"] = tip.R_NS[1, -1].T @ (acceleration(tip.axis_N[:, -1] + tip.R_NS[:, -1] @ arm) - fall)
    for name, force in expected.items():
        values = at_middle(found, *(f"f{axis}_{name}" for axis in "xyz"))
        np.testing.assert_allclose(values, force, atol=0.01)
        assert np.abs(values - at_middle(found, "fx", "fy", "fz")).max() > 0.3
    at_tail = at_middle(found, "fx_tail", "fy_tail", "fz_tail")
    assert np.abs(at_tail - at_middle(found, "fx", "fy", "fz")).max() > 0.03
    np.testing.assert_allclose(at_middle(found, "nz_nose"), -at_middle(found, "fz_nose") / 9.81, rtol=1e-12)


def test_a_point_within_an_element_moves_with_its_helix() -> None:
    """A station of the shape that is no node: twelve stations on six elements, the point at one of them."""
    found, aircraft = flown("flexible"), swept_aircraft()
    assert found.shape is not None
    left, shape = aircraft.surfaces[1], found.shape.surfaces[1]
    at = float(shape.at[3])
    flight = flight_of({**FLIGHT, "wind_n_m_s": WIND_N, "apparent_mass": True})
    again = fly(
        aircraft, flight, DRIVES, model="flexible", duration_s=0.3, output_step_s=STEP_S, step_s=STEP_S,
        lattice=COARSE, elements=6, channels=["fx", "fy", "fz"],
        points=[Point(name="here", surface="left", at=at)],
    )  # fmt: skip
    arm = -left.elastic_axis_x_m * left.chord_W
    place = shape.axis_N[:, 3] + shape.R_NS[:, 3] @ arm
    expected = shape.R_NS[1, 3].T @ (acceleration(place) - [0.0, 0.0, 9.81])
    np.testing.assert_allclose(at_middle(again, "fx_here", "fy_here", "fz_here"), expected, atol=0.01)
    np.testing.assert_array_equal(again.trajectory.euler, found.trajectory.euler)  # requests change no flight


@pytest.mark.parametrize("kind", MODELS)
def test_roots_carry_inertia_and_weight_in_a_vacuum(kind: str) -> None:
    """Shear, bending, torsion and both hinges' torques out of second differences of every mass's place."""
    aircraft = swept_aircraft()
    start = {"alpha_rad": 0.05, "force_b_n": [0.0, 0.0, -20.0], "moment_b_n_m": [0.0, 0.0, 0.0]}
    flight = airless(flight_of({**FLIGHT, "start": start}))
    found = fly(
        aircraft, flight, DRIVES, model=model_of(kind, aircraft, flight), duration_s=0.3, start="given",
        output_step_s=STEP_S, step_s=STEP_S, lattice=COARSE, elements=6,
        channels=["hinge_torque", "root_shear", "root_bending", "root_torsion"],
        shape_times_s=[STEP_S * (MIDDLE + k) for k in (-1, 0, 1)],
    )  # fmt: skip
    assert found.shape is not None
    for number, (mass, places) in enumerate(mass_points(aircraft, found.shape.surfaces)):
        surface, shape = aircraft.surfaces[number], found.shape.surfaces[number]
        part = column_parts(each.name for each in aircraft.surfaces)[number]
        loads_N = -mass[:, None] * (acceleration(places) - [0.0, 0.0, 9.81])
        R, root = shape.R_NS[1, 0], shape.axis_N[1, 0]
        force = R.T @ loads_N.sum(axis=0)
        moment = R.T @ np.cross(places[1] - root, loads_N).sum(axis=0)
        values = at_middle(found, *(f"root_{name}_{part}" for name in ("shear", "bending", "torsion")))
        expected = np.array([-force[2], -surface.span_sign * moment[0], moment[1]])
        scale = np.array([1.0, surface.length_m, 0.1 * surface.length_m]) * mass.sum() * 9.81
        assert (np.abs(expected) / scale).max() > 0.05
        np.testing.assert_allclose(values / scale, expected / scale, atol=2e-3)


# the independent sums at trim


@pytest.mark.parametrize("kind", ["rigid", "equivalent"])
def test_root_loads_of_a_trimmed_chain_are_air_less_weight(kind: str) -> None:
    """The links' air wrenches and weights, carried to the root one by one, to 1e-9."""
    aircraft, flight = example_aircraft(), example_flight()
    model = chain_model(aircraft, flight, 1 if kind == "rigid" else 3, COARSE)
    batch, plan = physical_guess(model), plan_of(model, [Hold(), Hold()], 0.02, 0.01)
    found = trim(model, batch, plan).require()
    state = trimmed_state(model, batch, plan, found)[0]
    air = lane_loads(model, batch, plan, state).wrench
    R_BL, r_B = (each[0] for each in link_poses(model, batch, plan.hinges[0], found.q_joint))
    down_B = rotation_from_quaternion(state[:4])[2]
    flight_of_it = fly(
        aircraft, flight, [Hold(), Hold()], model=batch if kind == "equivalent" else "rigid", lattice=COARSE,
        channels=["root_shear", "root_bending", "root_torsion"], duration_s=0.02,
    )  # fmt: skip
    for number, surface in enumerate(aircraft.surfaces):
        first, count = model.surfaces[number, :2]
        division = batch["division"][:, 0] if surface.flexible else np.ones((1, 1))
        masses = link_masses(surface, link_edges(division[:, :count], surface.length_m))[0]
        force, moment = np.zeros(3), np.zeros(3)
        for k in range(count):
            link = first + k
            m, mx, my = masses[k, :3]
            pull = flight.gravity_m_s2 * down_B
            loads = R_BL[link] @ air[link, 3:] + m * pull
            turning = R_BL[link] @ air[link, :3] + np.cross(R_BL[link] @ [mx, my, 0.0], pull)
            force += loads
            moment += turning + np.cross(r_B[link] - r_B[first], loads)
        columns = flight_of_it.trajectory.extra
        part = surface.name.replace(" ", "_")
        R = R_BL[first]
        expected = [-(R.T @ force)[2], -surface.span_sign * (R.T @ moment)[0], (R.T @ moment)[1]]
        values = [columns[f"root_{name}_{part}"][0] for name in ("shear", "bending", "torsion")]
        np.testing.assert_allclose(values, expected, rtol=1e-9)
        assert values[1] > 3000.0, "lift bends the tip up"


def test_root_loads_of_a_trimmed_beam_are_air_less_weight() -> None:
    """Every section's force and every Gauss point's weight, about the root in N, to what the trim leaves.

    The trim's residual is 1e-6 of the weight; each load is summed where it acts, not by virtual work.
    """
    aircraft, flight = example_aircraft(), example_flight()
    model = flexible_model(aircraft, flight, elements=4, lattice=COARSE)
    at = FlexibleFlight(model)
    path, found = start_flexible(at, [Hold(), Hold()], steps(0.002, 0.001), flight.wind_N, "trim")
    state, poses = found.state, found.state.poses
    at.structure(poses, state.V, state.A)
    at.lattice.deflect(path.deflection[0])
    at.place_lattice(poses, flight.wind_N, state.V)
    twists, wind_B = at.sections.twists(state.V), flight.wind_N @ poses.R[0]
    acting = acting_circulation(state.circulation, state.lag)
    forces = at.lattice.section_forces(acting, twists, wind_B)
    placed = at.sections.place(at.work, poses)
    simulation = fly(
        aircraft, flight, [Hold(), Hold()], model="flexible", lattice=COARSE, elements=4, duration_s=0.002,
        output_step_s=0.001, channels=["root_shear", "root_bending", "root_torsion"],
    )  # fmt: skip
    for number, surface in enumerate(aircraft.surfaces):
        root, R = poses.x[model.roots[number]], poses.R[model.roots[number]]
        own = slice(number * (2 * 8 + 1), (number + 1) * (2 * 8 + 1))
        force = np.einsum("kij,kj->i", placed.R[own], forces[own, 3:])
        moment = np.einsum("kij,kj->i", placed.R[own], forces[own, :3])
        moment += np.cross(placed.x[own] - root, np.einsum("kij,kj->ki", placed.R[own], forces[own, 3:])).sum(
            axis=0
        )
        for element in range(4 * number, 4 * number + 4):
            sections = Sections(model.beams, np.full(GAUSS.size, element), GAUSS).place(at.work, poses)
            for g, mass in enumerate(model.beams.mass[element]):
                weight = mass[3, 3] * gravity_N(flight)
                arm = sections.R[g] @ np.array([mass[2, 4], mass[0, 5], mass[1, 3]])  # mass times centre
                force += weight
                moment += np.cross(sections.x[g] - root, weight) + np.cross(arm, gravity_N(flight))
        expected = [-(R.T @ force)[2], -surface.span_sign * (R.T @ moment)[0], (R.T @ moment)[1]]
        part = surface.name.replace(" ", "_")
        values = [
            simulation.trajectory.extra[f"root_{name}_{part}"][0] for name in ("shear", "bending", "torsion")
        ]
        np.testing.assert_allclose(values, expected, rtol=1e-5)


# drives


def test_hinge_torque_is_what_the_limit_of_optimisations_sees() -> None:
    """The channel and the torques along a plan are one computation."""
    aircraft, flight = example_aircraft(), example_flight()
    model = chain_model(aircraft, flight, 3, COARSE)
    batch, plan = physical_guess(model), plan_of(model, SMOOTH, 0.2, 0.01)
    whole = fly_trimmed(model, plan, batch)
    assert whole.trim is not None
    constants = lane_constants(model, batch, 0.01)
    constants.set_thrust(whole.trim.force_B, whole.trim.moment_B)
    expected = hinge_torques(model, plan, constants, whole.states[:, 0])
    found = fly(
        aircraft, flight, SMOOTH, model=batch, duration_s=0.2, step_s=0.01, lattice=COARSE,
        channels=["hinge_torque"],
    ).trajectory  # fmt: skip
    values = np.stack([found.extra[f"hinge_torque_sweep_{side}"] for side in ("right", "left")], axis=1)
    np.testing.assert_allclose(values, expected, rtol=1e-9)


@pytest.mark.parametrize("links", [1, 3])
def test_drives_of_chains_do_the_work_that_energy_and_air_do_not(links: int) -> None:
    """In air: power of the motors = rate of the energy + losses in joints - power of air and thrust.

    The energy is that of the textbook tree, its rate a central difference over 1 ms.
    """
    aircraft, flight = example_aircraft(), example_flight()
    model = chain_model(aircraft, flight, links, COARSE)
    batch, plan = physical_guess(model), plan_of(model, SMOOTH, 0.2, 5e-4)
    whole = fly_trimmed(model, plan, batch)
    assert whole.trim is not None
    constants = lane_constants(model, batch, 5e-4)
    constants.set_thrust(whole.trim.force_B, whole.trim.moment_B)
    rows, states = np.array([339, 340, 341]), whole.states[339:342, 0]
    loads = chain_loads(model, plan.instants(rows), constants, states, every_body=True)
    tree, energies = chain_tree(model, batch), []
    for row, state in zip(rows, states, strict=True):
        hinges = np.stack([plan.angles[row], plan.rates[row], plan.accelerations[row]], axis=1)
        energies.append(energy(tree, motion_of(model, hinges, state), gravity_N(flight)).total)
    rate = (energies[2] - energies[0]) / 1e-3
    joint_rates = states[1, 13 + model.coordinates : 13 + 2 * model.coordinates]
    air = float(np.sum(loads.air_L[1] * loads.twist_L[1]))  # still air: twists are those over ground
    thrust = float(whole.trim.moment_B[0] @ states[1, 4:7] + whole.trim.force_B[0] @ states[1, 7:10])
    expected = rate + float(joint_rates @ (tree.damping * joint_rates)) - air - thrust
    motors = float(loads.torque[1] @ plan.rates[340])
    assert abs(motors) > 10.0
    assert motors == pytest.approx(expected, abs=1e-5 * max(abs(rate), abs(air)))


def test_drives_of_beams_do_the_work_that_energy_and_air_do_not() -> None:
    """In air: power of the motors = rate of the energy + losses in the material - power of air and thrust."""
    aircraft = swept_aircraft()
    flight = flight_of(FLIGHT)
    model = flexible_model(aircraft, flight, elements=3, lattice=COARSE)
    grid, at = steps(0.2, 5e-4), FlexibleFlight(model)
    path, found = start_flexible(at, DRIVES, grid, flight.wind_N, "trim")
    at.thrust = np.concatenate([found.moment_B + found.thrust_moment_B, found.force_B])
    wind_N = np.zeros((grid.steps + 1, 3))
    run = FlexibleRun(at, path, grid, wind_N, set_in_motion(at, path, wind_N[0], found.state))
    outputs = FlexibleOutputs(model, path, wind_N, Outputs(frozenset({"surfaces"})))
    other, energies, power = FlexibleFlight(model), [], 0.0
    for row in (339, 340, 341):
        run.fly_to(row)
        state = run.state
        demands = other.structure(state.poses, state.V, state.A)
        energies.append(_energy(other, state))
        if row != 340:
            continue
        outputs.evaluate(state, row, 0)
        other.place_lattice(state.poses, wind_N[row], state.V)
        twists = other.sections.twists(state.V)
        acting = acting_circulation(state.circulation, state.lag)
        forces = other.lattice.section_forces(acting, twists, wind_N[row])
        beams, rates = model.beams, other.work.rates
        lost = np.einsum("e,ei,eij,ej->", beams.damping, rates, beams.stiffness, rates)
        power = float(lost - np.sum(forces * twists) - at.thrust @ state.V[0])
        assert demands.shape == state.V.shape
    rate = (energies[2] - energies[0]) / (2.0 * grid.step_s)
    hinge_rates = np.array([schedule.motion(340 * grid.step_s).rate for schedule in DRIVES])
    motors = float(outputs.found.torque[0] @ hinge_rates)
    assert abs(motors) > 1.0
    assert motors == pytest.approx(rate + power, abs=2e-3 * max(abs(rate), abs(power)))


def _energy(at: FlexibleFlight, state: Any) -> float:
    """Kinetic, potential and strain energy at the strains of the last `structure`, J."""
    beams = at.model.beams
    strain = at.work.strains - beams.rest
    total = 0.5 * float(np.einsum("ei,eij,ej->", strain, beams.stiffness, strain))

    def of_body(R: Array, x: Array, twist: Array, mass: Array) -> float:
        centre = np.array([mass[2, 4], mass[0, 5], mass[1, 3]])  # times the mass
        height = mass[3, 3] * x[2] + (R @ centre)[2]
        return float(0.5 * twist @ mass @ twist - at.gravity_N[2] * height)

    for node, inertia in zip(beams.bodies, beams.inertia, strict=True):
        total += of_body(state.poses.R[node], state.poses.x[node], state.V[node], inertia)
    for element in range(beams.elements):
        sections = Sections(beams, np.full(GAUSS.size, element), GAUSS)
        placed, twists = sections.place(at.work, state.poses), sections.twists(state.V)
        for g, mass in enumerate(beams.mass[element]):
            total += of_body(placed.R[g], placed.x[g], twists[g], mass)
    return total


# models against each other, and mirrored


def test_fine_chains_carry_the_loads_of_beams() -> None:
    """Eight links: air, shear and bending within 0.5 per cent of the beams', torsion and motors within 3."""
    aircraft, flight = example_aircraft(), example_flight()
    names = ["root_shear", "root_bending", "root_torsion", "surface_lift", "surface_drag", "hinge_torque"]
    chain, beams = (
        fly(
            aircraft, flight, [Gentle(0.1, 5.0), Gentle(0.06, 4.0)], model=model, channels=names,
            duration_s=0.3, lattice=COARSE,
        ).trajectory.extra
        for model in (physical_guess(chain_model(aircraft, flight, 8)), "flexible")
    )  # fmt: skip
    for name, column in beams.items():
        share = 0.03 if name.startswith(("hinge", "root_torsion")) else 0.005
        scale = float(np.abs(column).max())
        np.testing.assert_allclose(chain[name], column, atol=share * scale, err_msg=name)


def test_strips_add_up_to_the_lift() -> None:
    """Lift of the strips times their widths is the wing's at trim, and their coefficients are its own."""
    aircraft, flight = example_aircraft(), example_flight()
    for model in MODELS:
        found = fly(
            aircraft, flight, [Hold(), Hold()], model=model_of(model, aircraft, flight), duration_s=0.02,
            channels=["section_lift", "section_cl", "surface_lift"], elements=4,
        )  # fmt: skip
        first = {name: column[0] for name, column in found.trajectory.extra.items()}
        strips = found.strips[0]
        numbers = range(1, strips.at.size + 1)
        lift = np.array([first[f"section_lift_right_wing_{n}"] for n in numbers])
        assert lift @ strips.width_m == pytest.approx(first["surface_lift_right_wing"], rel=0.01)
        cl = np.array([first[f"section_cl_right_wing_{n}"] for n in numbers])
        np.testing.assert_allclose(cl * strips.chord_m * flight.dynamic_pressure_pa, lift, rtol=1e-3)


@pytest.mark.parametrize("kind", MODELS)
def test_mirrored_flights_give_mirrored_loads(kind: str) -> None:
    """Swapped sweeps swap the columns of both sides, and turn the sign of side forces, to 1e-9."""
    aircraft, flight = example_aircraft(), example_flight()
    points = [
        Point(name="near_right", position_m=[0.5, 0.2, 0.1]),
        Point(name="near_left", position_m=[0.5, -0.2, 0.1]),
        Point(name="tip_right", surface="right wing", at=0.9),
        Point(name="tip_left", surface="left wing", at=0.9),
    ]
    one, other = (
        fly(
            aircraft, flight, sweeps, model=model_of(kind, aircraft, flight), duration_s=0.2, lattice=COARSE,
            elements=4, channels=[*PER_SURFACE, "hinge_torque", "fx", "fy", "fz"], points=points,
        ).trajectory.extra
        for sweeps in (SMOOTH, SMOOTH[::-1])
    )  # fmt: skip
    for name, column in one.items():
        sides = ("right", "left") if "right" in name else ("left", "right")
        mirrored = name.replace(*sides)
        sign = -1.0 if "side_force" in name or name.startswith("fy") else 1.0
        scale = max(1.0, float(np.abs(column).max()))
        np.testing.assert_allclose(sign * other[mirrored], column, rtol=0.0, atol=1e-9 * scale, err_msg=name)


def test_one_half_gives_points_and_loads_of_both() -> None:
    """Even sweeps are flown as one half: points of the other wing are its image's, side forces opposite."""
    aircraft, flight = example_aircraft(), example_flight()
    points = [Point(name=f"tip_{side}", surface=f"{side} wing", at=0.8) for side in ("right", "left")]
    columns = fly(
        aircraft, flight, [SMOOTH[0], SMOOTH[0]], model=model_of("equivalent", aircraft, flight),
        duration_s=0.1, lattice=COARSE, channels=["fy", "fz", "surface_side_force"], points=points,
    ).trajectory.extra  # fmt: skip
    np.testing.assert_array_equal(columns["fz_tip_right"], columns["fz_tip_left"])
    np.testing.assert_array_equal(columns["fy_tip_right"], -columns["fy_tip_left"])
    np.testing.assert_array_equal(
        columns["surface_side_force_right_wing"], -columns["surface_side_force_left_wing"]
    )


def test_an_all_rigid_aircraft_has_the_same_loads_in_beams_and_chains() -> None:
    """Rigid wings of the flexible model: roots, air and motors are the rigid model's within 0.5 per cent."""
    aircraft = rigid(swept_aircraft())
    flight = flight_of(FLIGHT)
    one, other = (
        fly(
            aircraft, flight, DRIVES, model=model, duration_s=0.2, lattice=COARSE,
            channels=["root_shear", "root_bending", "root_torsion", "surface_lift", "hinge_torque"],
        ).trajectory.extra
        for model in ("rigid", "flexible")
    )  # fmt: skip
    for name, column in one.items():
        if "tail" not in name and "incidence" not in name:  # the tail of the rigid model feels no wake move
            # in-plane forces, most of the torque of a sweep, are averaged over the chord in the rigid model
            scale = float(np.abs(column).max()) * (4.0 if "sweep" in name else 1.0)
            np.testing.assert_allclose(other[name][2:], column[2:], atol=0.005 * scale, err_msg=name)
