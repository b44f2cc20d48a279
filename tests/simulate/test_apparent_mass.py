"""Apparent mass against thin-airfoil theory, and alike in every model."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import eigh

from morphcore.aero.apparent_mass import apparent_inertia, share_of_mass
from morphcore.geometry.aircraft import Aircraft, Flight
from morphcore.models.equivalent import chain_model, physical_guess
from morphcore.models.flexible import flexible_model
from morphcore.multibody.beam import NodePoses
from morphcore.simulate.flexible import FlexibleFlight
from morphcore.simulate.flight import simulate
from morphcore.simulate.schedule import Spline
from morphdata.aircraft import Aircraft as AircraftDocument
from morphdata.flight import Flight as FlightDocument
from morphdata.lattice import Lattice

Array = NDArray[np.float64]

DENSITY = 1.225
MASS = 0.75  # kg/m
CHORD = 1.0
SPAN = 16.0
EI = 2e4
SMALL = Lattice(chordwise=2, spanwise=6)


def light_wings(
    axis: str = "x",
    *,
    flexible: bool = True,
    elastic_m: float = 0.0,
    span_m: float = SPAN,
) -> AircraftDocument:
    """Two light wings of 1 m chord on a fuselage, each on a hinge."""

    def wing(side: str, y_m: float) -> dict[str, object]:
        return {
            "name": side,
            "side": side,
            "span_m": span_m,
            "chord_m": CHORD,
            "thickness_m": 0.1,
            "material": {"density_kg_m3": 100.0, "youngs_modulus_pa": 1e9, "stiffness_damping_s": 1e-3},
            "section": {
                "ei_flap_n_m2": EI,
                "ei_edge_n_m2": 4e6,
                "gj_n_m2": 1e4,
                "mass_per_length_kg_m": MASS,
                "inertia_per_length_kg_m": [0.05, 0.1, 0.05],
            },
            "elastic_axis_offset_m": elastic_m,
            "mass_axis_offset_m": elastic_m,
            "flexible": flexible,
            "hinge": {"position_m": [0.0, y_m, 0.0], "axis": axis},
        }

    return AircraftDocument.parse(
        {
            "fuselage": {
                "mass_kg": 50.0,
                "inertia_kg_m2": [50.0, 50.0, 50.0],
            },
            "surfaces": [wing("right", 0.5), wing("left", -0.5)],
        }
    )


def air(
    *, apparent: bool = True, wind: tuple[float, float, float] = (0.0, 0.0, 0.0), gravity: float = 0.0
) -> FlightDocument:
    """Dense air, nearly still, so that other loads are small; nothing holds the aircraft."""
    return FlightDocument.parse(
        {
            "airspeed_m_s": 0.5,
            "air_density_kg_m3": DENSITY,
            "gravity_m_s2": gravity,
            "apparent_mass": apparent,
            "wind_n_m_s": list(wind),
            "start": {"alpha_rad": 0.0},
        }
    )


def clamped_frequencies(aircraft: AircraftDocument, flight: FlightDocument, elements: int) -> Array:
    """Natural frequencies of the right wing of the flexible model on a clamped root, rad/s."""
    model = flexible_model(Aircraft.of(aircraft), Flight.of(flight), elements=elements, lattice=SMALL)
    flown = FlexibleFlight(model)
    nodes = model.beams.nodes
    poses = NodePoses(np.tile(np.eye(3), (nodes, 1, 1)), model.rest_W.copy())
    zero = np.zeros((nodes, 6))
    free = np.arange(model.roots[0] + 1, model.tips[0] + 1)
    size = 6 * free.size
    mass, stiffness = np.empty((size, size)), np.empty((size, size))
    for column in range(size):
        unit = np.zeros((nodes, 6))
        unit[free[column // 6], column % 6] = 1.0
        mass[:, column] = flown.structure(poses, zero, unit)[free].ravel()
        moved = poses.copy()
        moved.move(1e-6 * unit)
        stiffness[:, column] = flown.structure(moved, zero, zero)[free].ravel() / 1e-6
    return np.sqrt(eigh(0.5 * (stiffness + stiffness.T), mass, eigvals_only=True))


@pytest.mark.parametrize("apparent", [False, True])
def test_a_clamped_wing_flaps_slower_in_air(apparent: bool) -> None:  # noqa: FBT001
    """The first bending frequency is that of a uniform beam with the mass of the air added to its own."""
    found = clamped_frequencies(light_wings(), air(apparent=apparent), 12)[0]
    mass = MASS + (np.pi * DENSITY * 0.25 * CHORD**2 if apparent else 0.0)
    assert found == pytest.approx(1.875104**2 * np.sqrt(EI / (mass * SPAN**4)), rel=2e-3)


def test_the_matrix_is_that_of_a_flat_plate() -> None:
    """A piece of uniform wing: mass pi rho b^2 at mid-chord, and pi rho b^4 / 8 about it, by hand."""
    surface = replace(Aircraft.of(light_wings()).surfaces[1], elastic_axis_offset_m=0.2)
    found = apparent_inertia(surface, DENSITY, np.array(2.0), np.array(5.0), np.array(2.0))
    m, own = np.pi * DENSITY * 0.25, np.pi * DENSITY * 0.0625 / 8.0
    # mid-chord lies 0.2 m ahead of the elastic axis; the left wing runs to -y
    expected = np.array(
        [
            [m * 9.0, m * 0.2 * 4.5, -m * 4.5],
            [m * 0.2 * 4.5, 3.0 * (m * 0.04 + own), -m * 0.2 * 3.0],
            [-m * 4.5, -m * 0.2 * 3.0, 3.0 * m],
        ]
    )
    np.testing.assert_allclose(found, expected, rtol=1e-13)
    assert share_of_mass(surface, DENSITY) == pytest.approx(m / MASS, rel=1e-12)


@pytest.mark.parametrize("axis", ["x", "y"])
@pytest.mark.parametrize("wind", [(0.0, 0.0, 0.0), (3.0, -2.0, 1.0)])
def test_chain_and_beams_carry_the_same_air(axis: str, wind: tuple[float, float, float]) -> None:
    """A rigid light aircraft answers a hinge's turn alike in both models, in wind too."""
    aircraft = light_wings(axis, flexible=False, elastic_m=0.1, span_m=4.0)
    drive = {"x": "fold_right", "y": "incidence_right"}[axis]

    def attitude(model: Literal["rigid", "flexible"], *, apparent: bool) -> Array:
        flown = simulate(
            aircraft,
            air(apparent=apparent, wind=wind),
            {drive: Spline(np.array([0.0, 0.15, 0.3]), np.array([0.0, 0.1, 0.0]))},
            model=model,
            duration_s=0.3,
            step_s=0.001,
            start="given",
            lattice=SMALL,
        ).trajectory
        return np.stack([flown.phi, flown.theta, flown.psi])

    def effect(model: Literal["rigid", "flexible"]) -> Array:
        return attitude(model, apparent=True) - attitude(model, apparent=False)

    chain, beams = effect("rigid"), effect("flexible")
    apart, matters = np.abs(chain - beams).max(), np.abs(chain).max()
    print(f"{axis} {wind}: {apart:.2e} rad between the models of {matters:.2e}")
    assert apart < 0.01 * matters


@pytest.mark.parametrize("model", ["rigid", "flexible", "chain"])
def test_air_has_no_weight(model: str) -> None:
    """Let go at rest, the aircraft falls with the share of gravity that its mass has in all that moves."""
    document = light_wings(flexible=model != "rigid", span_m=4.0)
    flight = air(gravity=9.81)
    chain = chain_model(Aircraft.of(document), Flight.of(flight), 3, SMALL)
    chosen = physical_guess(chain) if model == "chain" else model
    flown = simulate(
        document,
        flight,
        {},
        model=chosen,  # type: ignore[arg-type]
        duration_s=0.03,
        step_s=0.001,
        start="given",
        lattice=SMALL,
        channels=["nz"],
    ).trajectory
    mass, of_air = 50.0 + 8.0 * MASS, 8.0 * np.pi * DENSITY * 0.25
    print(model, flown.channels["nz"][0], of_air / (mass + of_air))
    assert flown.channels["nz"][0] == pytest.approx(of_air / (mass + of_air), rel=2e-3)
