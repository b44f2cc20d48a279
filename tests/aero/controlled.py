"""Aircraft with control surfaces, and the air's force and moment on them in each model."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
from numpy.typing import NDArray

from morphcore.geometry.aircraft import Aircraft, Flight
from morphcore.geometry.lattice import surface_pose
from morphcore.models.equivalent import chain_model, physical_guess
from morphcore.models.flexible import flexible_model
from morphcore.simulate.batch import initial_state
from morphcore.simulate.flexible import FlexibleFlight, hinge_path
from morphcore.simulate.flexible_trim import _Balance
from morphcore.simulate.hinge_schedules import followed_schedules, hinge_schedules
from morphcore.simulate.plan import flight_plan
from morphcore.simulate.schedule import Hold
from morphcore.simulate.time_grid import time_grid
from morphdata.aircraft import Aircraft as AircraftDocument
from morphdata.flight import Flight as FlightDocument
from morphdata.lattice import Lattice
from tests.aero.link_loads import lane_loads

Array = NDArray[np.float64]
Document = dict[str, Any]

SPEED, DENSITY = 20.0, 1.225
MATERIAL = {"density_kg_m3": 60.0, "youngs_modulus_pa": 7e9, "stiffness_damping_s": 0.004}
ELEVATOR = {"name": "elevator", "from": 0.0, "to": 1.0, "chord_fraction": 0.35}
AILERON = {"name": "aileron", "from": 0.5, "to": 0.9, "chord_fraction": 0.25, "mirror": "antisymmetric"}
WING, TAIL = (1.5, 0.25), (0.4, 0.15)  # semi-span and chord, m
HALF_WIDTH = 0.08  # m, of the fuselage
TAIL_ARM = 1.0  # m aft of the wing
TAIL_HEIGHT = 0.3  # m above the wing, away from its wake, whose direction differs between the models


def surface(side: str, name: str, size: tuple[float, float], x: float, **more: Any) -> Document:
    """A surface of some (semi-span, chord), whose root's mid-chord is on the plane of symmetry."""
    span, chord = size
    return {
        "name": f"{side} {name}",
        "side": side,
        "span_m": span,
        "chord_m": chord,
        "thickness_m": 0.1 * chord,
        "material": MATERIAL,
        "flexible": False,
        "position_m": [x, 0.0, 0.0],
        **more,
    }


def tailed(*, flexible: bool = False, hinged: bool = False) -> Document:
    """A tailed aircraft of 2.3 kg with ailerons on the wing and an elevator on the tail."""
    surfaces = []
    for side in ("right", "left"):
        wing = surface(side, "wing", WING, 0.0, flexible=flexible, controls=[copy.deepcopy(AILERON)])
        if hinged:
            # at the fuselage's side, so that swept wings do not overlap
            root = [0.0, HALF_WIDTH if side == "right" else -HALF_WIDTH, 0.0]
            wing |= {"hinge": {"position_m": root, "axis": "z"}, "position_m": root}
        surfaces += [wing, surface(side, "tail", TAIL, -TAIL_ARM, controls=[copy.deepcopy(ELEVATOR)])]
        surfaces[-1]["position_m"][2] = -TAIL_HEIGHT
    return {
        "name": "tailed",
        "fuselage": {
            "mass_kg": 1.6,
            "inertia_kg_m2": [0.02, 0.12, 0.13],
            "centre_of_mass_m": [0.1, 0.0, 0.0],
        },
        "surfaces": surfaces,
    }


def flight_document(**more: Any) -> FlightDocument:
    """Level flight near the ground."""
    return FlightDocument.parse({"airspeed_m_s": SPEED, "air_density_kg_m3": DENSITY, **more})


def chain_loads(
    document: Document,
    alpha: float,
    angles: dict[str, float],
    lattice: Lattice,
    wake_alpha: float | None = None,
    **flight: Any,
) -> Array:
    """Moment about the reference point and force (6,) of the air in B, from the rigid model's kernels.

    wake_alpha : of the wake, rad; None: that of the trim.
    """
    aircraft = Aircraft.of(AircraftDocument.parse(document))
    model = chain_model(aircraft, Flight.of(flight_document(**flight)), 1, lattice)
    held = {name: Hold(angle) for name, angle in angles.items()}
    schedules = hinge_schedules(aircraft, followed_schedules(aircraft, held))
    plan = flight_plan(model, schedules, time_grid(0.01 * np.arange(3)), wake_alpha=wake_alpha)
    air_B = SPEED * np.array([np.cos(alpha), 0.0, np.sin(alpha)])
    normals = np.stack([surface_pose(each)[0][:, 2] for each in aircraft.surfaces])
    lag = np.zeros((1, model.links, 3))
    lag[0, :, 0] = normals @ air_B
    state = initial_state(
        quaternion=np.array([[1.0, 0.0, 0.0, 0.0]]),
        omega_B=np.zeros((1, 3)),
        velocity_B=air_B[None],
        q_joint=np.zeros((1, 0)),
        lag_motion=lag,
    )
    loads = lane_loads(model, physical_guess(model), plan, state[0])
    total = np.zeros(6)
    for each, wrench in zip(aircraft.surfaces, loads.wrench, strict=True):
        origin = np.add(each.position_m, (each.elastic_axis_x_m, 0.0, 0.0))
        total[:3] += wrench[:3] + np.cross(origin, wrench[3:])
        total[3:] += wrench[3:]
    return total


def beam_loads(
    document: Document, alpha: float, angles: dict[str, float], lattice: Lattice, **flight: Any
) -> Array:
    """The same from the flexible model, whose surfaces must be rigid and unhinged."""
    aircraft = Aircraft.of(AircraftDocument.parse(document))
    model = flexible_model(aircraft, Flight.of(flight_document(gravity_m_s2=0.0, **flight)), lattice=lattice)
    held = {name: Hold(angle) for name, angle in angles.items()}
    schedules = hinge_schedules(aircraft, followed_schedules(aircraft, held))
    path = hinge_path(model, schedules, time_grid(0.01 * np.arange(3)))
    balance = _Balance(FlexibleFlight(model), path, np.zeros(3), "trim")
    state, demands = balance.state(np.array([alpha]))
    return -balance.total(state.poses, demands)  # without weight and motion only the air demands
