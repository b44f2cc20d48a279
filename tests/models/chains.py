"""Aircraft, parameters and states to test the equivalent model with: the example's, and random ones."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from morphcore.frames import quaternion_from_euler
from morphcore.geometry.aircraft import Aircraft, Flight
from morphcore.models.equivalent import ChainModel, ParameterBatch, chain_model, physical_guess
from morphcore.simulate.batch import initial_state
from morphcore.simulate.plan import FlightPlan, flight_plan
from morphcore.simulate.schedule import HingeMotion
from morphcore.simulate.time_grid import TimeGrid
from morphdata.aircraft import Aircraft as AircraftDocument
from morphdata.aircraft import load_aircraft
from morphdata.flight import Flight as FlightDocument
from morphdata.flight import load_flight
from morphdata.lattice import Lattice
from tests.oracles.chain_tree import tree_hinges
from tests.oracles.dynamics import Motion

Array = NDArray[np.float64]

EXAMPLES = Path(__file__).parents[2] / "examples"
SMALL_LATTICE = Lattice.model_construct(chordwise=1, spanwise=3)  # where the air is not what a test is about


@dataclass(frozen=True)
class Parabola:
    """Hinge motion of constant acceleration through given values at t = 0."""

    angle: float
    rate: float
    acceleration: float

    def motion(self, time_s: ArrayLike) -> HingeMotion:
        """The motion."""
        t = np.asarray(time_s, dtype=np.float64)
        return HingeMotion(
            self.angle + self.rate * t + 0.5 * self.acceleration * t**2,
            self.rate + self.acceleration * t,
            self.acceleration + 0.0 * t,
        )


@dataclass(frozen=True)
class Swing:
    """Hinge motion a (1 - cos w t): never without acceleration for long."""

    amplitude: float
    omega: float

    def motion(self, time_s: ArrayLike) -> HingeMotion:
        """The motion."""
        angle = self.omega * np.asarray(time_s, dtype=np.float64)
        return HingeMotion(
            self.amplitude * (1.0 - np.cos(angle)),
            self.amplitude * self.omega * np.sin(angle),
            self.amplitude * self.omega**2 * np.cos(angle),
        )


def aircraft_of(document: dict[str, Any]) -> Aircraft:
    """The aircraft of a document, resolved, which a test may change beyond a document's limits."""
    return Aircraft.of(AircraftDocument.parse(document, "/aircraft"))


def flight_of(document: dict[str, Any]) -> Flight:
    """The same of a flight condition."""
    return Flight.of(FlightDocument.parse(document, "/flight"))


def example_aircraft() -> Aircraft:
    """The reference aircraft of the examples."""
    return Aircraft.of(load_aircraft(EXAMPLES / "aircraft.json"))


def example_flight() -> Flight:
    """Its flight condition."""
    return Flight.of(load_flight(EXAMPLES / "flight.json"))


def airless(flight: Flight, *, gravity: float | None = None) -> Flight:
    """The same flight condition in a vacuum, with the same gravity if none is given."""
    return replace(
        flight, air_density_kg_m3=0.0, gravity_m_s2=flight.gravity_m_s2 if gravity is None else gravity
    )


def odd_aircraft(rng: np.random.Generator) -> Aircraft:
    """Five tapered surfaces: hinged to sweep, to fold and to incline, fixed and flexible, fixed and rigid.

    Hinges lie away from the roots, elastic and mass axes away from mid-chord, the fuselage's centre of mass
    away from its reference point.
    """
    material = {
        "density_kg_m3": 500.0,
        "youngs_modulus_pa": 2.1e9,
        "poisson_ratio": 0.3,
        "stiffness_damping_s": 0.004,
    }

    def surface(name: str, side: str, axis: str | None, *, flexible: bool = True) -> dict[str, Any]:
        sign = 1.0 if side == "right" else -1.0
        chord = rng.uniform(0.3, 0.6)
        document: dict[str, Any] = {
            "name": name,
            "side": side,
            "span_m": rng.uniform(1.0, 3.0),
            "root_chord_m": chord,
            "tip_chord_m": chord * rng.uniform(0.4, 1.0),
            "thickness_m": 0.08,
            "material": material,
            "position_m": [rng.uniform(-2, 2), sign * rng.uniform(0.2, 0.5), rng.uniform(-0.5, 0.5)],
            "flexible": flexible,
            "profile_drag": rng.uniform(0.0, 0.05),
            "elastic_axis_offset_m": rng.uniform(-0.1, 0.1),
            "mass_axis_offset_m": rng.uniform(-0.1, 0.1),
        }
        if axis is not None:
            position = [rng.uniform(-2, 2), sign * rng.uniform(0.1, 0.5), rng.uniform(-0.5, 0.5)]
            document["hinge"] = {"axis": axis, "position_m": position}
        return document

    return aircraft_of(
        {
            "name": "odd",
            "fuselage": {
                "mass_kg": 800.0,
                "inertia_kg_m2": [[120.0, 5.0, -8.0], [5.0, 900.0, 3.0], [-8.0, 3.0, 950.0]],
                "centre_of_mass_m": [0.2, 0.05, -0.1],
            },
            "surfaces": [
                surface("right wing", "right", "z"),
                surface("left wing", "left", "x"),
                surface("tail", "right", None, flexible=False),
                surface("left fin", "left", "y", flexible=True),
                surface("boom", "left", None, flexible=True),
            ],
        }
    )


def random_batch(
    rng: np.random.Generator, model: ChainModel, particles: int, *, separate_wings: bool = False
) -> ParameterBatch:
    """Uneven divisions, stiffness and damping about the physical guess, corrections away from neutral."""
    n = model.links_per_wing
    division = rng.dirichlet(
        np.full(n, 8.0), size=(particles, len(model.sets(separate_wings=separate_wings)))
    )
    guess = physical_guess(model, division, separate_wings=separate_wings)
    return guess.changed(
        stiffness_nm_rad=guess["stiffness_nm_rad"]
        * np.exp(rng.uniform(-1.5, 1.5, size=guess["stiffness_nm_rad"].shape)),
        damping_nms_rad=guess["damping_nms_rad"]
        * np.exp(rng.uniform(-1.5, 1.5, size=guess["stiffness_nm_rad"].shape)),
        lift_factor=rng.uniform(0.8, 1.2, size=particles),
        ac_offset_m=rng.uniform(-0.03, 0.03, size=particles),
        profile_drag=rng.uniform(0.0, 0.05, size=guess["profile_drag"].shape),
        lag_s=guess["lag_s"] * np.exp(rng.uniform(-1.0, 1.0, size=particles)),
    )


def random_state(rng: np.random.Generator, model: ChainModel, particles: int, *, speed: float = 1.0) -> Array:
    """States (p, state_rows) of order one in attitude, rates and joints, moving at about ``speed`` m/s."""
    n = model.coordinates
    state = initial_state(
        quaternion=quaternion_from_euler(*rng.uniform(-1.2, 1.2, size=(3, particles))),
        omega_B=rng.normal(size=(particles, 3)),
        velocity_B=speed * np.array([1.0, 0.0, 0.05]) + rng.normal(size=(particles, 3)),
        position_N=rng.normal(size=(particles, 3)),
        q_joint=rng.uniform(-0.8, 0.8, size=(particles, n)),
        lag_motion=rng.normal(size=(particles, model.links, 3)),
    )
    state[:, 13 + n : 13 + 2 * n] = rng.normal(size=(particles, n))
    return state


def instant(
    model: ChainModel, hinges: ArrayLike, *, step_s: float = 0.005, wake_alpha: float | None = None
) -> FlightPlan:
    """A plan of one step at whose start the hinges have given (angle, rate, acceleration), (h, 3)."""
    schedules = [Parabola(*row) for row in np.asarray(hinges, dtype=np.float64)]
    return flight_plan(model, schedules, TimeGrid(0.0, step_s, 1, None), wake_alpha=wake_alpha)


def random_hinges(rng: np.random.Generator, model: ChainModel) -> Array:
    """Angle, rate and acceleration (h, 3) of every hinge."""
    return rng.normal(size=(len(model.aircraft.hinges), 3)) * np.array([0.5, 1.0, 3.0])


def motion_of(model: ChainModel, hinges: Array, state: Array) -> Motion:
    """One state row in the terms of the textbook dynamics, for the tree of models/tree.py."""
    n = model.coordinates
    angle, rate, acceleration = tree_hinges(model, hinges).T
    return Motion(
        state[:4],
        state[4:10],
        state[13 : 13 + n],
        state[13 + n : 13 + 2 * n],
        angle,
        rate,
        acceleration,
        state[10:13],
    )


def small_model(aircraft: Aircraft, flight: Flight, links: int) -> ChainModel:
    """A chain model whose lattice is not looked at."""
    return chain_model(aircraft, flight, links, SMALL_LATTICE)
