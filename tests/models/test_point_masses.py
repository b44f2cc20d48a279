"""Point masses on fuselage and surfaces: the same aircraft in every model; beams and joints feel them."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import brentq

from morphcore.errors import InvalidInput
from morphcore.export.model_tables import _links
from morphcore.geometry.aircraft import Aircraft, Fuselage, Start
from morphcore.geometry.lattice import surface_pose
from morphcore.geometry.mirror import mirror_of
from morphcore.geometry.point_mass import PointMass
from morphcore.models.equivalent import ChainModel, ParameterBatch, lane_constants, physical_guess
from morphcore.models.flexible import flexible_model
from morphcore.models.links import link_edges
from morphcore.models.lumps import link_shares
from morphcore.multibody.beam import GAUSS, BeamWorkspace, NodePoses
from morphcore.multibody.kernels.articulated import L_MASS, L_UP, LINK_ROWS
from morphcore.simulate.batch import state_rates
from morphcore.simulate.flexible import FlexibleFlight, FlexibleRun, hinge_path, set_in_motion
from morphcore.simulate.flexible_trim import trim_flexible
from morphcore.simulate.schedule import Hold
from morphcore.simulate.torque import hinge_torques
from morphdata.aircraft import Aircraft as AircraftDocument
from morphdata.aircraft import load_aircraft
from morphdata.pairs import mirror_pairs
from tests.models.chains import (
    EXAMPLES,
    SMALL_LATTICE,
    aircraft_of,
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
from tests.models.test_chain import accelerations
from tests.multibody.test_beam import momentum as beam_momentum
from tests.oracles.chain_tree import chain_tree, of_hinges, slice_inertia
from tests.oracles.clamped_beams import clamped_modes
from tests.oracles.dynamics import energy, forward_dynamics_crba, hinge_torque, momentum
from tests.oracles.tree import spatial_inertia
from tests.simulate.flights import fly_free, plan_of, steps
from tests.simulate.test_step import SWINGS

Array = NDArray[np.float64]

INERTIA = [[0.5, 0.05, -0.02], [0.05, 0.7, 0.03], [-0.02, 0.03, 0.6]]


def loaded(rng: np.random.Generator) -> Aircraft:
    """The odd aircraft with three masses on each surface, all over it and out of its plane."""
    aircraft = odd_aircraft(rng)
    inertia = tuple(np.array(INERTIA).ravel().tolist())
    return replace(
        aircraft,
        surfaces=tuple(
            replace(
                surface,
                point_masses=(
                    PointMass(1.0, rng.uniform(1.0, 9.0), rng.uniform(-0.5, 0.5), 0.3, inertia),
                    PointMass(rng.uniform(0.2, 0.8), rng.uniform(1.0, 9.0), 0.2, -0.4, (0.0,) * 9),
                    PointMass(0.0, 3.0, 0.0, 0.0, inertia),
                ),
            )
            for surface in aircraft.surfaces
        ),
    )


def moved(inertia: Array, R_BX: Array, at_B: Array) -> Array:
    """Spatial inertia in B about the reference point of a body whose axes are at ``at_B``."""
    mass = inertia[3, 3]
    moment = inertia[:3, 3:]
    centre = np.array([moment[2, 1], moment[0, 2], moment[1, 0]]) / mass if mass else np.zeros(3)
    own = inertia[:3, :3] - mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    return np.asarray(spatial_inertia(mass, at_B + R_BX @ centre, R_BX @ own @ R_BX.T))


def by_hand(aircraft: Aircraft) -> Array:
    """Spatial inertia (6, 6) of the whole about the reference point, hinges at rest: slices and masses."""
    fuselage = aircraft.fuselage
    total = spatial_inertia(fuselage.mass_kg, fuselage.centre_of_mass_B, fuselage.inertia_B)
    for surface in aircraft.surfaces:
        R_BW, r_B = surface_pose(surface)
        origin_W = np.array([-surface.elastic_axis_offset_m, 0.0, 0.0])
        ends = surface.breaks_m
        for a, b in pairwise(ends):
            bare = replace(surface, point_masses=())
            from_root = np.array([0.0, surface.span_sign * a, 0.0])
            total += moved(slice_inertia(bare, a, b, origin_W + from_root), R_BW, r_B)
        for mass in surface.point_masses:
            own = np.array(mass.inertia).reshape(3, 3)
            at = mass.at * surface.length_m
            aft = mass.aft_m + float(surface.aft_at(at))
            place_W = np.array([0.0, surface.span_sign * at, -mass.up_m]) - aft * surface.chord_W
            total += moved(spatial_inertia(mass.mass_kg, place_W, own), R_BW, r_B)
    return total


def of_links(model: ChainModel, batch: ParameterBatch) -> Array:
    """The same out of the kernels' rows of a straight chain."""
    rows = lane_constants(model, batch, 0.005).rows[0, :, 0]
    fuselage = model.aircraft.fuselage
    total = spatial_inertia(fuselage.mass_kg, fuselage.centre_of_mass_B, fuselage.inertia_B)
    for number, surface in enumerate(model.aircraft.surfaces):
        first, count = model.surfaces[number, :2]
        edges = link_edges(model.on_surface(batch, number)["division"], surface.length_m)[0]
        R_BW, r_B = surface_pose(surface)
        for k in range(count):
            link = rows[6 + LINK_ROWS * (first + k) :][:LINK_ROWS]
            m, mx, my, xx, yy, zz, xy = link[L_MASS : L_MASS + 7]
            mz, xz, yz = link[L_UP : L_UP + 3]
            cross = np.array([[0.0, -mz, my], [mz, 0.0, -mx], [-my, mx, 0.0]])
            own = np.block(
                [[np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]), cross], [cross.T, m * np.eye(3)]]
            )
            at_W = surface.elastic_axis_W + np.array([0.0, surface.span_sign * edges[k], 0.0])
            total += moved(own, R_BW, r_B + R_BW @ at_W)
    return np.asarray(total)


def of_beams(aircraft: Aircraft, elements: int) -> Array:
    """The same out of unbent beams: sections at the Gauss points, and bodies at the nodes."""
    model = flexible_model(aircraft, example_flight(), elements=elements, lattice=SMALL_LATTICE)
    beams, places, axes = model.beams, np.zeros((model.beams.nodes, 3)), [np.eye(3)] * model.beams.nodes
    for surface, root, tip in zip(aircraft.surfaces, model.roots, model.tips, strict=True):
        R_BW, r_B = surface_pose(surface)
        for node in range(root, tip + 1):
            at_W = model.rest_W[node] + surface.elastic_axis_W
            places[node], axes[node] = r_B + R_BW @ at_W, R_BW
    total = np.zeros((6, 6))
    for node, inertia in zip(beams.bodies, beams.inertia, strict=True):
        total += moved(inertia, axes[node], places[node])
    for (a, b), mass in zip(beams.ends, beams.mass, strict=True):
        for s, inertia in zip(GAUSS, mass, strict=True):
            total += moved(inertia, axes[a], (1.0 - s) * places[a] + s * places[b])
    return total


@pytest.mark.parametrize("seed", [0, 1])
def test_every_model_has_the_same_mass_centre_and_inertia(seed: int) -> None:
    """Rigid, chains of any division and beams of any number of elements: 1e-10 of what slices add up to."""
    rng = np.random.default_rng(seed)
    aircraft = loaded(rng)
    expected = by_hand(aircraft)
    bare = by_hand(replace(aircraft, surfaces=tuple(replace(s, point_masses=()) for s in aircraft.surfaces)))
    assert expected[3, 3] > bare[3, 3] + 20.0
    scale = np.abs(expected).max()
    for links in (1, 2, 3, 8):
        model = small_model(aircraft, example_flight(), links)
        for batch in (physical_guess(model), random_batch(rng, model, 1)):
            np.testing.assert_allclose(of_links(model, batch), expected, rtol=0, atol=1e-10 * scale)
    for elements in (1, 4, 10):
        np.testing.assert_allclose(of_beams(aircraft, elements), expected, rtol=0, atol=1e-10 * scale)


@pytest.mark.parametrize("links", [1, 3, 8])
def test_links_with_masses_accelerate_as_the_textbook_says(links: int) -> None:
    """The lanes' accelerations are those of M a = -h with masses beside the joints and out of the planes."""
    rng = np.random.default_rng(links)
    flight = airless(example_flight())
    model = small_model(loaded(rng), flight, links)
    batch = random_batch(rng, model, 3)
    hinges, state = random_hinges(rng, model), random_state(rng, model, 3, speed=30.0)
    found = accelerations(
        state_rates(model, instant(model, hinges), 0, lane_constants(model, batch, 0.005), state), model
    )
    for p in range(3):
        tree = chain_tree(model, batch, p)
        expected = forward_dynamics_crba(
            tree, motion_of(model, hinges, state[p]), np.zeros((tree.bodies, 6)), [0, 0, flight.gravity_m_s2]
        )
        both = np.concatenate([expected.base, expected.joint])
        np.testing.assert_allclose(found[p], both, rtol=0, atol=1e-10 * np.abs(both).max())


@pytest.mark.parametrize("links", [1, 3])
def test_hinge_motors_feel_the_masses(links: int) -> None:
    """Torques of the hinges are those of Newton and Euler's recursion over the tree, to 1e-10."""
    rng = np.random.default_rng(links)
    flight = airless(example_flight())
    model = small_model(loaded(rng), flight, links)
    batch = random_batch(rng, model, 1)
    hinges, state = random_hinges(rng, model), random_state(rng, model, 1, speed=30.0)
    constants = lane_constants(model, batch, 0.005)
    found = hinge_torques(model, instant(model, hinges), constants, np.repeat(state, 2, axis=0))[0]
    tree, motion = chain_tree(model, batch), motion_of(model, hinges, state[0])
    none = np.zeros((tree.bodies, 6))
    prescribed = hinge_torque(tree, motion, none, [0.0, 0.0, flight.gravity_m_s2])
    expected = of_hinges(model, prescribed) if prescribed.size != found.size else prescribed
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-10 * np.abs(expected).max())


def test_shares_are_smooth_in_the_division() -> None:
    """A joint that passes a mass takes it over within 2 per cent of the span, without a step or a kink."""
    joints = np.linspace(1.4, 1.6, 4001)
    edges = np.stack([0.0 * joints, joints, 0.0 * joints + 3.0], axis=1)
    shares = link_shares(edges, 1.5, 0.03)
    np.testing.assert_allclose(shares.sum(axis=1), 1.0, atol=1e-15)
    assert shares.min() >= 0.0
    slope = np.gradient(shares[:, 0], joints)
    assert shares[0, 0] == 0.0
    assert shares[-1, 0] == 1.0
    assert np.abs(np.diff(slope)).max() < 0.01 * slope.max()


def example_with(*masses: dict[str, Any], **changes: Any) -> Aircraft:
    """The example's aircraft with these masses."""
    document = load_aircraft(EXAMPLES / "aircraft.json").model_dump(exclude_none=True)
    for surface in document["surfaces"]:
        surface.update(changes)
    return aircraft_of(document | {"point_masses": list(masses)})


def drifts(step_s: float) -> Array:
    """Relative drifts of linear and angular momentum over half a second of a morph with tip masses."""
    tips = [
        {"surface": name, "at": 1.0, "mass_kg": 12.0, "offset_m": [0.1, -0.2], "inertia_kg_m2": INERTIA}
        for name in ("right wing", "left wing")
    ]
    inboard = {"surface": "right wing", "at": 0.37, "mass_kg": 8.0, "offset_m": [-0.1, 0.1]}
    model = small_model(example_with(*tips, inboard), airless(example_flight(), gravity=0.0), 3)
    guess = physical_guess(model)
    batch = guess.changed(stiffness_nm_rad=1e-2 * guess["stiffness_nm_rad"])
    state = random_state(np.random.default_rng(0), model, 1, speed=10.0)
    state[:, 13 : 13 + model.coordinates] *= 0.2
    plan = plan_of(model, SWINGS, 0.5, step_s)
    states = fly_free(model, plan, batch, state).states[:, 0]
    tree = chain_tree(model, batch)
    linear, angular = [], []
    for i in range(0, states.shape[0], round(0.025 / step_s)):
        hinges = np.stack([plan.angles[i], plan.rates[i], plan.accelerations[i]], axis=1)
        found = momentum(tree, motion_of(model, hinges, states[i]))
        linear.append(found.linear_N)
        angular.append(found.angular_centre_N)
    return np.array([np.abs(np.array(v) - v[0]).max() / np.linalg.norm(v[0]) for v in (linear, angular)])


def test_momentum_holds_while_wings_with_tip_masses_sweep() -> None:
    """Without air, linear and angular momentum drift with the square of the step, towards nothing."""
    coarse, fine = drifts(5e-4), drifts(2.5e-4)
    np.testing.assert_allclose(coarse / fine, 4.0, rtol=0.15)
    assert fine.max() < 2e-5


def flexible_drift(step_s: float) -> Array:
    """The same of the flexible model over a tenth of a second, both wings sweeping, each by itself."""
    tips = [
        {"surface": name, "at": 1.0, "mass_kg": 12.0, "offset_m": [0.1, -0.2], "inertia_kg_m2": INERTIA}
        for name in ("right wing", "left wing")
    ]
    inboard = {"surface": "right wing", "at": 0.37, "mass_kg": 8.0, "offset_m": [-0.1, 0.1]}
    start = Start(0.0, np.zeros(3), np.zeros(3))
    empty = replace(
        example_flight(), air_density_kg_m3=1e-9, gravity_m_s2=0.0, airspeed_m_s=10.0, start=start
    )
    model = flexible_model(example_with(*tips, inboard), empty, elements=4, lattice=SMALL_LATTICE)
    flight, grid, calm = FlexibleFlight(model), steps(0.1, step_s), np.zeros(3)
    path = hinge_path(model, SWINGS, grid)
    begin = set_in_motion(flight, path, calm, trim_flexible(flight, path, calm, start="given").state)
    run = FlexibleRun(flight, path, grid, np.zeros((grid.steps + 1, 3)), begin)
    found, work = [], BeamWorkspace(model.beams)
    for row in range(0, grid.steps + 1, grid.steps // 10):
        run.fly_to(row)
        state = run._state
        poses = NodePoses(state.R.copy(), state.x.copy())
        poses.x -= np.array([10.0 * grid.times_s[row], 0.0, 0.0])
        total = beam_momentum(model.beams, work, poses, state.V)
        for node, inertia in zip(model.beams.bodies, model.beams.inertia, strict=True):
            h = inertia @ state.V[node]
            linear = poses.R[node] @ h[3:]
            moment = poses.R[node] @ h[:3] + np.cross(poses.x[node], linear)
            total += np.concatenate([moment, linear])
        found.append(total)
    moved = np.abs(np.array(found) - found[0])
    # of the momentum of a wing that sweeps, about 50 kg at 1 m/s
    return np.array([moved[:, 3:].max() / 50.0, moved[:, :3].max() / 100.0])


def test_momentum_of_sweeping_beams_with_masses() -> None:
    """Without air, momentum of beams and bodies drifts with the square of the step, towards nothing."""
    coarse, fine = flexible_drift(1e-3), flexible_drift(5e-4)
    assert np.all(fine < 0.35 * coarse)
    assert fine.max() < 1e-4


def test_an_export_holds_the_masses() -> None:
    """The exported links weigh what the kernels' do, their centres lie below the wing where pods hang."""
    aircraft = example_with(pods("right"), pods("left"))
    model = small_model(aircraft, example_flight(), 3)
    table = _links(model, physical_guess(model))
    expected = of_links(model, physical_guess(model))
    assert table["mass_kg"].sum() + aircraft.fuselage.mass_kg == pytest.approx(expected[3, 3], rel=1e-14)
    below = table["mass_kg"] * table["centre_of_mass_m"][:, 2]
    assert below.sum() == pytest.approx(2.0 * 7.0 * 0.3, rel=1e-12)
    for inertia in table["inertia_kg_m2"]:
        principal = np.linalg.eigvalsh(inertia)
        assert principal[0] > 0.0
        assert principal[2] < principal[0] + principal[1]


def test_energy_of_a_rigid_aircraft_with_masses() -> None:
    """Without joints nothing limits the accuracy but the step, 0.05 ms here: 2e-11 of energy are lost."""
    rng = np.random.default_rng(3)
    model = small_model(loaded(rng), airless(example_flight(), gravity=0.0), 1)
    batch, state = physical_guess(model), random_state(rng, model, 1, speed=10.0)
    plan = plan_of(model, [Hold(0.2)] * len(model.aircraft.hinges), 0.25, 5e-5)
    states = fly_free(model, plan, batch, state).states[:, 0]
    tree = chain_tree(model, batch)
    hinges = np.stack([plan.angles[0], plan.rates[0], plan.accelerations[0]], axis=1)
    first, last = (energy(tree, motion_of(model, hinges, states[i])).total for i in (0, -1))
    assert abs(last / first - 1.0) < 5e-11


SLENDER = {"thickness_m": 0.02}  # shear and rotary inertia do not matter


def beam_frequency(ei: float, mass: float, length: float, tip_kg: float, at: float) -> float:
    """First bending frequency, rad/s, of a clamped Euler beam with a mass at a share of its length.

    By transfer matrices: the state (w, w', w'', w''') is carried through both parts by the beam's general
    solution, and the mass adds M omega^2 w / EI to w''' between.
    """

    def fundamental(b: float, s: float) -> Array:
        x = b * s
        C, S = 0.5 * (np.cosh(x) + np.cos(x)), 0.5 * (np.sinh(x) + np.sin(x)) / b
        c, z = 0.5 * (np.cosh(x) - np.cos(x)) / b**2, 0.5 * (np.sinh(x) - np.sin(x)) / b**3
        return np.array(
            [
                [C, S, c, z],
                [b**4 * z, C, S, c],
                [b**4 * c, b**4 * z, C, S],
                [b**4 * S, b**4 * c, b**4 * z, C],
            ]
        )

    def free_end(b: float) -> float:
        lump = np.eye(4)
        lump[3, 0] = tip_kg / mass * b**4
        whole = fundamental(b, (1.0 - at) * length) @ lump @ fundamental(b, at * length)
        return float(np.linalg.det(whole[2:, 2:]))

    grid = np.linspace(0.05, 1.9, 400) / length
    values = [free_end(b) for b in grid]
    k = next(i for i in range(399) if values[i] * values[i + 1] < 0.0)
    b = brentq(free_end, grid[k], grid[k + 1], xtol=1e-14)
    return float(b**2 * np.sqrt(ei / mass))


@pytest.mark.parametrize("at", [1.0, 0.57, 0.25])
def test_a_mass_lowers_the_first_bending_frequency_of_the_beam(at: float) -> None:
    """Ten elements: 0.1 per cent of Euler's beam with the mass, at the tip, between nodes or near one."""
    mass_kg = 5.0
    found = []
    for masses in ((), ({"surface": "right wing", "at": at, "mass_kg": mass_kg},)):
        aircraft = example_with(*masses, **SLENDER)
        wing = aircraft.surfaces[0]
        section = wing.section_at(np.zeros(1))
        alone = replace(aircraft, surfaces=(wing,))
        beams = flexible_model(alone, example_flight(), elements=10, lattice=SMALL_LATTICE).beams
        found.append(2.0 * np.pi * float(clamped_modes(beams, 1)[0][0]))
        expected = beam_frequency(
            float(section.ei_flap[0]), float(section.mass[0]), wing.span_m, mass_kg if masses else 0.0, at
        )
        assert found[-1] == pytest.approx(expected, rel=1e-3)
    assert found[1] < 0.99 * found[0] if at > 0.5 else found[1] < found[0]


@pytest.mark.parametrize("at", [1.0, 0.57])
def test_a_mass_lowers_the_first_frequency_of_a_chain(at: float) -> None:
    """Eight links, linearised out of the kernels on a fuselage that does not move: within 2 per cent."""
    mass_kg = 5.0
    for masses in ((), ({"surface": "right wing", "at": at, "mass_kg": mass_kg},)):
        aircraft = example_with(*masses, **SLENDER)
        heavy = Fuselage(1e9, 1e9 * np.eye(3), np.zeros(3))
        wing = aircraft.surfaces[0]
        alone = replace(aircraft, fuselage=heavy, surfaces=(wing,))
        model = small_model(alone, airless(example_flight(), gravity=0.0), 8)
        guess = physical_guess(model)
        n, probe = model.coordinates, 1e-6
        state = np.zeros((n, model.state_rows))
        state[:, 0] = 1.0
        state[:, 13 : 13 + n] = probe * np.eye(n)
        batch = guess.select(np.zeros(n, dtype=np.int64))
        rates = state_rates(
            model, instant(model, np.zeros((1, 3))), 0, lane_constants(model, batch, 0.005), state
        )
        stiffness = -rates[:, 13 + n : 13 + 2 * n].T / probe
        found = float(np.sqrt(np.linalg.eigvals(stiffness).real.min()))
        section = wing.section_at(np.zeros(1))
        expected = beam_frequency(
            float(section.ei_flap[0]), float(section.mass[0]), wing.span_m, mass_kg if masses else 0.0, at
        )
        assert found == pytest.approx(expected, rel=0.02)


def pods(side: str, **changes: Any) -> dict[str, Any]:
    """A pod under a wing, mirrored to its side."""
    sign = 1.0 if side == "right" else -1.0
    inertia = [[0.5, sign * 0.05, -0.02], [sign * 0.05, 0.7, sign * 0.03], [-0.02, sign * 0.03, 0.6]]
    return {
        "surface": f"{side} wing", "at": 0.6, "mass_kg": 7.0, "offset_m": [-0.2, -0.3],
        "inertia_kg_m2": inertia, **changes,
    }  # fmt: skip


def test_masses_on_one_side_make_the_aircraft_asymmetric() -> None:
    """Pods on both sides leave the mirror; one pod, or an inertia that is not mirrored, breaks it."""
    flight = example_flight()
    boxes = [{"position_m": [0.3, y, 0.2], "mass_kg": 0.1 * 7} for y in (-0.1, 0.1)]
    both = [pods("right"), pods("left")]
    for masses, is_symmetric in (
        (both, True),
        (both + boxes, True),
        (both + boxes[:1], False),
        (both[:1], False),
        ([pods("right"), pods("left", inertia_kg_m2=pods("right")["inertia_kg_m2"])], False),
        ([pods("right"), pods("left", at=0.61)], False),
    ):
        aircraft = example_with(*masses)
        assert (mirror_of(aircraft, flight) is not None) is is_symmetric
        on_wings = [mass for mass in masses if "surface" in mass]
        document = load_aircraft(EXAMPLES / "aircraft.json").model_dump(exclude_none=True)
        pairs = mirror_pairs(AircraftDocument.parse(document | {"point_masses": on_wings}))
        is_pair = mirror_of(example_with(*on_wings), flight) is not None
        assert len(pairs) == (1 if is_pair else 2)


@pytest.mark.parametrize(
    ("mass", "code", "pointer"),
    [
        ({"mass_kg": 1.0}, "missing", "/aircraft/point_masses/0/position_m"),
        ({"mass_kg": 1.0, "at": 0.5}, "surface_missing", "/aircraft/point_masses/0/at"),
        ({"mass_kg": 1.0, "surface": "right wing"}, "missing", "/aircraft/point_masses/0/at"),
        (
            {"mass_kg": 1.0, "surface": "right wing", "at": 0.5, "position_m": [0, 0, 0]},
            "given_twice",
            "/aircraft/point_masses/0/position_m",
        ),
        (
            {"mass_kg": 1.0, "surface": "fin", "at": 0.5},
            "surface_unknown",
            "/aircraft/point_masses/0/surface",
        ),
        (
            {"mass_kg": 1.0, "position_m": [0, 0, 0], "inertia_kg_m2": [1.0, 1.0, 3.0]},
            "inertia_not_physical",
            "/aircraft/point_masses/0/inertia_kg_m2",
        ),
    ],
)
def test_a_mass_without_a_place_is_refused(mass: dict[str, Any], code: str, pointer: str) -> None:
    """Each mistake names its field and what to do."""
    with pytest.raises(InvalidInput) as caught:
        example_with(mass)
    (fault,) = caught.value.faults
    assert (fault.code, fault.pointer) == (code, pointer)
    assert fault.hint


def test_masses_on_the_fuselage_are_part_of_it() -> None:
    """Two bodies become one by the parallel-axis theorem."""
    plain = example_aircraft().fuselage
    place = np.array([0.5, 0.1, -0.2])
    found = example_with(
        {"name": "battery", "position_m": place.tolist(), "mass_kg": 30.0, "inertia_kg_m2": [1.0, 2.0, 2.5]}
    ).fuselage
    whole = plain.mass_kg + 30.0
    centre = 30.0 * place / whole
    expected = spatial_inertia(plain.mass_kg, np.zeros(3), plain.inertia_B)
    expected = expected + spatial_inertia(30.0, place, np.diag([1.0, 2.0, 2.5]))
    assert found.mass_kg == pytest.approx(whole, rel=1e-15)
    np.testing.assert_allclose(found.centre_of_mass_B, centre, rtol=1e-14)
    np.testing.assert_allclose(
        spatial_inertia(found.mass_kg, found.centre_of_mass_B, found.inertia_B), expected, atol=1e-11
    )
