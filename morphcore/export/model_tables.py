"""A model as arrays: the contents of the formats ``npz`` and ``mat``.

Groups of arrays (s surfaces, l links, j joints, h hinges, f flexible surfaces, n links each), SI units and
radians. B : body axes, forward, right, down, from the reference point. Link axes: origin on the elastic axis
at the link's inboard end, parallel to B with all hinges and joints at zero. Arrays named ``..._index`` count
from 0 here (in MATLAB files from 1).

``origin``
    ``notice``, ``morphid_version``, ``model_id`` and, as JSON text, ``fit`` and ``verdict``.
``documents``
    ``aircraft``, ``flight`` and ``model`` as JSON text, in the form used by requests.
``parameters``
    By their names, ``division`` (f, n), ``stiffness_nm_rad`` and ``damping_nms_rad`` (f, n - 1, 3) of flap,
    torsion and edgewise, others (f,), or () for the whole aircraft; ``surface_index`` (f,). Where numbers of
    links differ, n is the largest, and the rows of other surfaces end in zeros.
``surfaces``
    ``name``, ``side`` (s,); ``root_m`` (s, 3) origin of the first link in B; ``rotation`` (s, 3, 3) of the
    surface's axes to B with all hinges at zero; ``first_link_index``, ``links``, ``lift_factor`` (s,).
``links``
    ``surface_index`` (l,); ``length_m`` (l,); ``origin_m`` (l, 3) from the origin of the link before, in its
    axes (of a first link from the reference point, in B); ``mass_kg`` (l,); ``centre_of_mass_m`` (l, 3) and
    ``inertia_kg_m2`` (l, 3, 3) about it, in link axes; ``apparent_inertia`` (l, 3, 3) of the air on the rates
    of (omega_x, omega_y, v_z) at the origin, kg m^2, kg m and kg; zero if the flight leaves it out.
``joints``
    ``inboard_link_index``, ``outboard_link_index`` (j,): three revolutes in turn, flap about x, torsion about
    y, edgewise about z, at the outboard link's origin; ``stiffness_nm_rad``, ``damping_nms_rad`` (j, 3).
``hinges``
    ``surface_index`` (h,); ``drive`` (h,) name of what moves it; ``position_m`` (h, 3) and ``axis`` (h, 3)
    unit vector of a positive angle's right-handed rotation, in B; ``min_rad``, ``max_rad`` (h,). Only of an
    aircraft with prismatic hinges: ``slides`` (h,), for which the axis is the direction of a positive
    extension, and range and ``hinge_rad`` are in m.
``controls``
    Only of an aircraft with control surfaces: ``surface_index`` (c,); ``drive`` (c,); ``from``, ``to`` (c,)
    shares of the span; ``chord_fraction`` (c,); ``sign`` (c,), 1 if a positive angle moves the trailing edge
    down; ``min_rad``, ``max_rad``; ``angle_rad`` (c,) held in the reference trim.
``fuselage``
    ``mass_kg`` (), ``centre_of_mass_m`` (3,), ``inertia_kg_m2`` (3, 3) about it, in B.
``trim``
    ``airspeed_m_s``, ``air_density_kg_m3``, ``gravity_m_s2``, ``alpha_rad`` (); ``force_n``, ``moment_nm``
    (3,) constant, in B at the reference point, thrust included; ``joint_rad`` (j, 3); ``hinge_rad`` (h,). Of
    a flight that is not level also ``phi_rad``, ``theta_rad`` (); ``omega_b_rad_s`` and
    ``air_velocity_b_m_s`` (3,), rates and velocity through the air in B.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from morphcore.aero.apparent_mass import apparent_inertia
from morphcore.geometry.aircraft import Aircraft, Flight
from morphcore.geometry.obstacle import naming_obstacles
from morphcore.geometry.surface import Surface
from morphcore.models.equivalent import ChainModel, ParameterBatch
from morphcore.models.links import link_edges, link_masses
from morphcore.models.lumps import FLAT_ROWS, link_lumps
from morphcore.models.parameter_batch import together
from morphcore.models.soft_joints import chain_obstacle
from morphcore.simulate.plan import FlightPlan, flight_plan
from morphcore.simulate.schedule import Hold
from morphcore.simulate.steady import air_velocity_B, pitch, rates_B
from morphcore.simulate.time_grid import STEP_S, time_grid
from morphcore.simulate.trim import StartMode, Trim, trim
from morphdata.export import ModelFile

Array = NDArray[Any]
Table = dict[str, Array]
Tables = Mapping[str, Table]


def reference_trim(chain: ChainModel, batch: ParameterBatch, start: StartMode) -> Trim:
    """Trim with every hinge at the angle that it holds without a history.

    Raises
    ------
    TrimNotFound
        There is no such flight.
    """
    plan = _reference_plan(chain, start)
    with naming_obstacles(lambda: chain_obstacle(chain, batch)):
        return trim(chain, batch, plan, start=start).require(chain.flight)


def _reference_plan(chain: ChainModel, start: StartMode) -> FlightPlan:
    held = [Hold(hinge.angle_rad) for hinge in chain.aircraft.hinges]
    return flight_plan(chain, held, time_grid(STEP_S * np.arange(3)), start=start)


def model_tables(file: ModelFile, chain: ChainModel, batch: ParameterBatch, found: Trim) -> Tables:
    """Arrays of one parameter set, in groups: see the module's own description."""
    return {
        "origin": _origin(file),
        "documents": {
            name: np.array(_json(getattr(file, name).model_dump(exclude_none=True)))
            for name in ("aircraft", "flight", "model")
        },
        "parameters": _parameters(chain, batch),
        "surfaces": _surfaces(chain, batch),
        "links": _links(chain, batch),
        "joints": _joints(chain, batch),
        "hinges": _hinges(chain.aircraft),
        **({"controls": _controls(chain.aircraft)} if chain.aircraft.controls else {}),
        "fuselage": {
            "mass_kg": np.array(chain.aircraft.fuselage.mass_kg),
            "centre_of_mass_m": np.array(chain.aircraft.fuselage.centre_of_mass_B),
            "inertia_kg_m2": np.array(chain.aircraft.fuselage.inertia_B),
        },
        "trim": _trim(chain, found, _reference_plan(chain, file.model.start or "trim").angles[0]),
    }


def _json(value: Any) -> str:
    return json.dumps(value, sort_keys=True, allow_nan=False)


def _origin(file: ModelFile) -> Table:
    return {
        "notice": np.array(file.notice),
        "morphid_version": np.array(file.morphid_version),
        "model_id": np.array(file.origin.id or ""),
        "fit": np.array(_json(file.origin.fit)),
        "verdict": np.array(_json(file.origin.verdict)),
    }


def _parameters(chain: ChainModel, batch: ParameterBatch) -> Table:
    table: Table = {"surface_index": np.array(chain.flexible, dtype=np.int64)}
    own = [chain.on_surface(batch, k) for k in chain.flexible]
    for parameter in chain.parameters:
        if parameter.scope == "aircraft":
            table[parameter.name] = np.array(batch.of_aircraft(parameter.name)[0])
        else:
            table[parameter.name] = together([values[parameter.name][:1] for values in own])[0]
    return table


def _root(surface: Surface) -> Array:
    """Origin of the first link in B with all hinges at zero, m."""
    return np.asarray(np.add(surface.position_m, surface.rest_R_BW @ surface.elastic_axis_W))


def _surfaces(chain: ChainModel, batch: ParameterBatch) -> Table:
    surfaces = chain.aircraft.surfaces
    factors = [chain.on_surface(batch, number)["lift_factor"][0] for number in range(len(surfaces))]
    return {
        "name": np.array([surface.name for surface in surfaces]),
        "side": np.array([surface.side for surface in surfaces]),
        "root_m": np.stack([_root(surface) for surface in surfaces]),
        "rotation": np.stack([surface.rest_R_BW for surface in surfaces]),
        "first_link_index": chain.surfaces[:, 0].copy(),
        "links": chain.surfaces[:, 1].copy(),
        "lift_factor": np.array(factors),
    }


def _links(chain: ChainModel, batch: ParameterBatch) -> Table:
    lengths, origins, rows, apparent = [], [], [], []
    density = chain.flight.air_density_kg_m3 if chain.flight.apparent_mass else 0.0
    for number, surface in enumerate(chain.aircraft.surfaces):
        edges = link_edges(chain.on_surface(batch, number)["division"], surface.length_m)
        length = np.diff(edges, axis=1)[0]
        origin = np.zeros((length.size, 3))
        origin[0] = _root(surface)
        origin[1:, 1] = surface.span_sign * length[:-1]
        lengths.append(length)
        origins.append(origin)
        lumps = link_lumps(surface, edges)[0]
        lumps[:, :FLAT_ROWS] += link_masses(surface, edges)[0]
        rows.append(lumps)
        apparent.append(apparent_inertia(surface, density, edges[0, :-1], edges[0, 1:], edges[0, :-1]))
    mass, mx, my, xx, yy, zz, xy, mz, xz, yz = np.concatenate(rows).T
    centre = np.stack([mx, my, mz], axis=1) / mass[:, None]
    about_origin = np.zeros((mass.size, 3, 3))
    about_origin[:, 0, 0], about_origin[:, 1, 1], about_origin[:, 2, 2] = xx, yy, zz
    about_origin[:, 0, 1] = about_origin[:, 1, 0] = xy
    about_origin[:, 0, 2] = about_origin[:, 2, 0] = xz
    about_origin[:, 1, 2] = about_origin[:, 2, 1] = yz
    # Steiner's theorem: m (|c|^2 1 - c c^T) from the origin to the centre of mass
    steiner = np.sum(centre**2, axis=1)[:, None, None] * np.eye(3) - centre[:, :, None] * centre[:, None]
    return {
        "surface_index": np.repeat(np.arange(len(lengths)), chain.surfaces[:, 1]),
        "length_m": np.concatenate(lengths),
        "origin_m": np.concatenate(origins),
        "mass_kg": mass,
        "centre_of_mass_m": centre,
        "inertia_kg_m2": about_origin - mass[:, None, None] * steiner,
        "apparent_inertia": np.concatenate(apparent),
    }


def _joints(chain: ChainModel, batch: ParameterBatch) -> Table:
    every = [chain.on_surface(batch, number) for number in range(len(chain.aircraft.surfaces))]
    inboard = [first + np.arange(count - 1) for first, count in chain.surfaces[:, :2]]
    table = {
        name: np.concatenate([values[name][0].reshape(-1, 3) for values in every])
        for name in ("stiffness_nm_rad", "damping_nms_rad")
    }
    index = np.concatenate(inboard).astype(np.int64)
    return {"inboard_link_index": index, "outboard_link_index": index + 1, **table}


def _hinges(aircraft: Aircraft) -> Table:
    """Hinges of each surface from the fuselage outward; each carries the following ones and the surface."""
    hinges = aircraft.hinges
    counts = [len(surface.hinges) for surface in aircraft.surfaces]
    slides = np.array([hinge.prismatic for hinge in hinges], dtype=np.bool_)
    return {
        "surface_index": np.repeat(np.arange(len(counts)), counts),
        "drive": np.array([hinge.drive for hinge in hinges], dtype=np.str_),
        "position_m": np.array([hinge.position_m for hinge in hinges]).reshape(-1, 3),
        "axis": np.array([hinge.axis_B for hinge in hinges]).reshape(-1, 3),
        "min_rad": np.array([hinge.min_rad for hinge in hinges]),
        "max_rad": np.array([hinge.max_rad for hinge in hinges]),
        **({"slides": slides} if slides.any() else {}),
    }


def _controls(aircraft: Aircraft) -> Table:
    controls = aircraft.controls
    counts = [len(surface.controls) for surface in aircraft.surfaces]
    columns = {
        "from": "start",
        "to": "stop",
        **{name: name for name in ("chord_fraction", "sign", "min_rad", "max_rad", "angle_rad")},
    }
    return {
        "surface_index": np.repeat(np.arange(len(counts)), counts),
        "drive": np.array([control.drive for control in controls], dtype=np.str_),
        **{name: np.array([getattr(control, own) for control in controls]) for name, own in columns.items()},
    }


def _steady(flight: Flight, found: Trim) -> Table:
    """Attitude, rates and motion through the air of a flight that is not level; nothing of one that is."""
    theta, steady = pitch(flight, found.alpha, found.bank), air_velocity_B(flight, found.alpha)
    if not (flight.climb_rad or flight.rotates or found.bank[0] or flight.sideslip_rad):
        return {}
    return {
        "phi_rad": np.array(found.bank[0]),
        "theta_rad": np.array(theta[0]),
        "omega_b_rad_s": rates_B(flight, theta, found.bank)[0],
        "air_velocity_b_m_s": steady[0],
    }


def _trim(chain: ChainModel, found: Trim, angles: Array) -> Table:
    flight = chain.flight
    force_B, moment_B = found.acting_B
    return {
        "airspeed_m_s": np.array(flight.airspeed_m_s),
        "air_density_kg_m3": np.array(flight.air_density_kg_m3),
        "gravity_m_s2": np.array(flight.gravity_m_s2),
        "alpha_rad": np.array(found.alpha[0]),
        **_steady(flight, found),
        "force_n": force_B[0],
        "moment_nm": moment_B[0],
        "joint_rad": found.q_joint[0].reshape(-1, 3),
        "hinge_rad": angles.copy(),
    }
