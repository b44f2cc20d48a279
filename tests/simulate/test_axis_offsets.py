"""Offsets of the elastic and the mass axis are counted aft of mid-chord: beams, centres of mass, MuJoCo.

What a document's positive offset does is computed here by hand: the twist of a cantilever under a torque per
length, the centre of mass of boxes, the pitch of a body that is pushed ahead of its centre of mass.
"""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

from morphcore.geometry.aircraft import Aircraft, Flight
from morphcore.models.equivalent import ChainModel, chain_model, physical_guess
from morphcore.models.flexible import flexible_model
from morphcore.simulate.flexible import FlexibleFlight, hinge_path
from morphcore.simulate.flexible_trim import trim_flexible
from morphcore.simulate.schedule import Hold
from morphcore.simulate.time_grid import TimeGrid
from morphcore.simulate.trim import trim
from morphdata.lattice import DEFAULT_LATTICE, Lattice
from tests.aero.link_loads import edge_loads
from tests.models.chains import SMALL_LATTICE, airless, example_aircraft, example_flight, instant
from tests.multibody.mujoco_flight import MujocoTree
from tests.oracles.chain_tree import chain_tree
from tests.simulate.flights import fly

Array = NDArray[np.float64]

MASS_PER_LENGTH = 15.0  # kg/m, of the example's wings: 500 kg/m^3 x 0.3 m x 0.1 m
SPAN_M = 3.0
LOAD_M_S2 = 0.5  # small: what is left out is of second order in angles of 1e-3 rad
HEAVY_KG = 1e9  # a fuselage that the wings' loads do not move


def offset_aircraft(*, elastic_m: float, mass_m: float, heavy: bool = False) -> Aircraft:
    """The example aircraft with the axes of its wings so far aft of mid-chord."""
    aircraft = example_aircraft()
    surfaces = tuple(
        replace(surface, elastic_axis_offset_m=elastic_m, mass_axis_offset_m=mass_m)
        for surface in aircraft.surfaces
    )
    fuselage = aircraft.fuselage
    if heavy:
        fuselage = replace(fuselage, mass_kg=HEAVY_KG, inertia_B=HEAVY_KG * np.eye(3))
    return replace(aircraft, fuselage=fuselage, surfaces=surfaces)


def stiffened(aircraft: Aircraft, modulus_pa: float) -> Aircraft:
    """The same with wings of another material."""
    surfaces = tuple(
        replace(surface, material=surface.material.model_copy(update={"youngs_modulus_pa": modulus_pa}))
        for surface in aircraft.surfaces
    )
    return replace(aircraft, surfaces=surfaces)


def torsional_stiffness(aircraft: Aircraft) -> float:
    """GJ of the uniform wings, N m^2."""
    return float(aircraft.surfaces[0].section_at(np.zeros(1)).gj[0])


def given(flight: Flight, *, alpha_rad: float, force_B: Array) -> Flight:
    """The flight condition with this start."""
    assert flight.start is not None
    start = replace(flight.start, alpha_rad=alpha_rad, force_B=force_B, moment_B=np.zeros(3))
    return replace(flight, start=start)


def lifted() -> Flight:
    """In a vacuum, the heavy fuselage pushed upward: the wings hang down by their inertia."""
    push = np.array([0.0, 0.0, -LOAD_M_S2 * (HEAVY_KG + 2.0 * MASS_PER_LENGTH * SPAN_M)])
    return given(airless(example_flight(), gravity=0.0), alpha_rad=0.0, force_B=push)


def chain_twists(model: ChainModel, sweep_rad: float) -> Array:
    """Tip twist (2,), nose up, of right and left wing in the given start's equilibrium, rad."""
    hinges = np.array([[sweep_rad, 0.0, 0.0]] * 2)
    found = trim(model, physical_guess(model), instant(model, hinges), start="given").require()
    # about the body's y, nose up on both sides; angles are small enough to add
    return np.asarray(found.q_joint.reshape(2, -1, 3)[:, :, 1].sum(axis=1))


def beam_twists(
    aircraft: Aircraft, flight: Flight, sweep_rad: float, lattice: Lattice = SMALL_LATTICE
) -> Array:
    """The same of the flexible model: the rotation of its tip nodes against their roots."""
    model = flexible_model(aircraft, flight, elements=10, lattice=lattice)
    path = hinge_path(model, [Hold(sweep_rad)] * 2, TimeGrid(0.0, 1e-3, 2, None))
    poses = trim_flexible(FlexibleFlight(model), path, np.zeros(3), start="given").state.poses
    turned = [poses.R[root].T @ poses.R[tip] for root, tip in zip(model.roots, model.tips, strict=True)]
    return np.array([0.5 * (R[0, 2] - R[2, 0]) for R in turned])


OFFSETS = [(0.0, 0.05), (0.05, 0.0), (-0.02, 0.03)]


@pytest.mark.parametrize("sweep_rad", [0.0, 0.5])
@pytest.mark.parametrize(("elastic_m", "mass_m"), OFFSETS)
def test_a_mass_aft_of_the_elastic_axis_twists_the_nose_up(
    elastic_m: float, mass_m: float, sweep_rad: float
) -> None:
    """A cantilever under a torque t per length twists by t L^2 / (2 GJ), on both sides, swept or not.

    The inertia m a per length acts ``mass - elastic`` aft of the axis about which the wing twists. A chain of
    any number of links has the compliance of the whole span, and its tip twists as much. Beams follow within
    0.1 per cent (angles of 1e-3 rad are not infinitely small).
    """
    aircraft = offset_aircraft(elastic_m=elastic_m, mass_m=mass_m, heavy=True)
    torque = MASS_PER_LENGTH * LOAD_M_S2 * (mass_m - elastic_m)
    expected = torque * SPAN_M**2 / (2.0 * torsional_stiffness(aircraft))
    assert expected * (mass_m - elastic_m) > 0.0
    np.testing.assert_allclose(beam_twists(aircraft, lifted(), sweep_rad), expected, rtol=1e-3)
    for links in (2, 8):
        model = chain_model(aircraft, lifted(), links, SMALL_LATTICE)
        np.testing.assert_allclose(chain_twists(model, sweep_rad), expected, rtol=1e-3)


def test_lift_ahead_of_the_elastic_axis_twists_the_nose_up() -> None:
    """An elastic axis d further aft adds d / GJ times the root bending moment of the lift to the tip's twist.

    From the same beam theory, t(y) = d l(y). The bending moment is that of the undeformed wings, by Kutta and
    Joukowski on all edges. Beams within 2 per cent (they twist, and lift a little more for it); chains
    extrapolated in 1/n from 4 and 8 links within 5.
    """
    flight = given(replace(example_flight(), gravity_m_s2=0.0), alpha_rad=0.01, force_B=np.zeros(3))
    apart = 0.06
    stiff = [
        stiffened(offset_aircraft(elastic_m=e, mass_m=e, heavy=True), 1e11) for e in (-apart / 2, apart / 2)
    ]
    rigid = chain_model(stiff[0], flight, 1)
    speed = flight.airspeed_m_s
    velocity = np.array([0.0, 0.0, 0.0, speed * np.cos(0.01), 0.0, speed * np.sin(0.01)])
    bending = np.abs(edge_loads(rigid, np.zeros(2), velocity)[:, 0])
    expected = apart * bending / torsional_stiffness(stiff[0])
    beams = np.subtract(*(beam_twists(a, flight, 0.0, DEFAULT_LATTICE) for a in reversed(stiff)))
    np.testing.assert_allclose(beams, expected, rtol=0.02)
    four, eight = (
        np.subtract(*(chain_twists(chain_model(a, flight, n), 0.0) for a in reversed(stiff))) for n in (4, 8)
    )
    np.testing.assert_allclose(2.0 * eight - four, expected, rtol=0.05)


@pytest.mark.parametrize("sweep_rad", [0.0, 0.7])
def test_the_centre_of_mass_lies_aft(sweep_rad: float) -> None:
    """MuJoCo finds the exported aircraft's centre of mass where the boxes have it by hand."""
    aft_m = 0.06
    aircraft = offset_aircraft(elastic_m=0.03, mass_m=aft_m)
    model = chain_model(aircraft, example_flight(), 3, SMALL_LATTICE)
    shown = MujocoTree(chain_tree(model, physical_guess(model)), np.zeros(3))
    shown.data.qpos[3:7] = (1.0, 0.0, 0.0, 0.0)
    shown.data.qpos[shown.hinge_qpos] = sweep_rad
    mujoco.mj_forward(shown.model, shown.data)
    wing_kg, fuselage = MASS_PER_LENGTH * SPAN_M, aircraft.fuselage
    total = fuselage.mass_kg * fuselage.centre_of_mass_B
    for surface in aircraft.surfaces:
        (hinge,) = surface.hinges
        pivot, root = np.array(hinge.position_m), np.array(surface.position_m)
        side = 1.0 if surface.side == "right" else -1.0
        out = abs(root[1] - pivot[1]) + SPAN_M / 2.0  # from the hinge
        back = root[0] - pivot[0] - aft_m
        turned = np.array(
            [
                back * np.cos(sweep_rad) - out * np.sin(sweep_rad),
                side * (out * np.cos(sweep_rad) + back * np.sin(sweep_rad)),
                root[2] - pivot[2],
            ]
        )
        total = total + wing_kg * (pivot + turned)
    expected = total / (fuselage.mass_kg + 2.0 * wing_kg)
    np.testing.assert_allclose(shown.data.subtree_com[1], expected, atol=1e-12)


@pytest.mark.parametrize("model", ["rigid", "flexible"])
def test_a_push_ahead_of_the_centre_of_mass_pitches_up(model: str) -> None:
    """Pushed upward at the reference point, with the wings' mass aft of it, the nose rises: q' = F d / I.

    The flexible model's wings are so stiff that nothing bends.
    """
    aft_m, force = 0.08, 2000.0
    aircraft = stiffened(offset_aircraft(elastic_m=-0.04, mass_m=aft_m), 2e12)
    flight = given(
        airless(example_flight(), gravity=0.0), alpha_rad=0.0, force_B=np.array([0.0, 0.0, -force])
    )
    wing_kg, fuselage = 2.0 * MASS_PER_LENGTH * SPAN_M, aircraft.fuselage
    root_x = aircraft.surfaces[0].position_m[0]
    assert root_x == fuselage.centre_of_mass_B[0] == 0.0
    whole = fuselage.mass_kg + wing_kg
    behind = wing_kg * aft_m / whole
    inertia = (
        fuselage.inertia_B[1, 1]
        + fuselage.mass_kg * (behind**2 + fuselage.centre_of_mass_B[2] ** 2)
        + wing_kg * ((0.3**2 + 0.1**2) / 12.0 + (aft_m - behind) ** 2)
    )
    flown = fly(
        aircraft, flight, [Hold(), Hold()], model=model, duration_s=0.05, output_step_s=0.01,  # type: ignore[arg-type]
        step_s=1e-3, start="given", lattice=SMALL_LATTICE,
    ).trajectory  # fmt: skip
    expected = force * behind / inertia * flown.time_s
    np.testing.assert_allclose(flown.extra["q"], expected, rtol=1e-3, atol=1e-9)
    assert flown.extra["q"][-1] > 1e-4
