"""The equivalent model as a multibody tree, for the textbook dynamics, MuJoCo and the fresh lattice.

Built from the aircraft and the parameters alone, by routes of its own where there is a choice: masses by
fine slices and the parallel-axis theorem instead of closed moments, a hinged surface's first body at its
hinge instead of at the link's root. Whatever the lane kernels and this tree agree on has thus been derived
twice.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from morphcore.geometry.hinge import Vector
from morphcore.geometry.surface import Surface
from morphcore.models.equivalent import ChainModel, ParameterBatch
from tests.oracles.tree import FLAP, LAG, TORSION, Tree, spatial_inertia

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]

SLICES = 12  # Gauss points a link: exact to degree 23 in the span, tapered solid wings need 6


def chain_tree(model: ChainModel, batch: ParameterBatch, particle: int = 0) -> Tree:
    """The tree of one parameter set.

    Bodies: the fuselage with all fixed first links; then surface by surface a body for each turn of its
    hinges, of which the last is the first link, its origin on the last hinge, and three bodies for each
    gimbal, of which the last is the link. Prescribed coordinates are those of `tree_hinges`, free ones as in
    the lanes' state.
    """
    assert all(surface.is_upright for surface in model.aircraft.surfaces), "the tree knows no other axes"
    fuselage = model.aircraft.fuselage
    base = spatial_inertia(fuselage.mass_kg, fuselage.centre_of_mass_B, fuselage.inertia_B)
    parent, axis, sign, offset, inertia = [-1], [-1], [1.0], [np.zeros(3)], [base]
    coordinate, hinge = [-1], [-1]
    stiffness: list[float] = []
    damping: list[float] = []

    def add(on: int, about: int, turn: float, where: Array, mass: Array, free: int, prescribed: int) -> int:
        for column, value in zip(
            (parent, axis, sign, offset, inertia, coordinate, hinge),
            (on, about, turn, where, mass, free, prescribed),
            strict=True,
        ):
            column.append(value)  # type: ignore[attr-defined]
        return len(parent) - 1

    chosen = model.set_of(batch)
    for s, surface in enumerate(model.aircraft.surfaces):
        ends = link_ends(model, batch, s, particle)
        root, pivot = _root(surface), _pivot(surface)
        first = slice_inertia(surface, ends[0], ends[1], root - pivot)
        if not surface.hinges:
            inertia[0] = inertia[0] + first
        body, reached = 0, np.zeros(3)
        turns = [(each, turn) for each in surface.hinges for turn in _turns(each.axis_B)]
        for number, (each, turn) in enumerate(turns):
            at, mass = np.array(each.position_m), first if number == len(turns) - 1 else np.zeros((6, 6))
            body = add(body, turn.axis, turn.sign, at - reached, mass, -1, max(hinge) + 1)
            reached = at
        where = root - pivot
        for k in range(1, ends.size - 1):
            where = where + np.array([0.0, surface.span_sign * (ends[k] - ends[k - 1]), 0.0])
            link = slice_inertia(surface, ends[k], ends[k + 1], np.zeros(3))
            for about in (FLAP, TORSION, LAG):
                mass = link if about == LAG else np.zeros((6, 6))
                body = add(body, about, 1.0, where, mass, len(stiffness), -1)
                where = np.zeros(3)
                stiffness.append(float(batch["stiffness_nm_rad"][particle, chosen[s], k - 1, about]))
                damping.append(float(batch["damping_nms_rad"][particle, chosen[s], k - 1, about]))
    return Tree(
        parent=np.array(parent, dtype=np.int64),
        axis=np.array(axis, dtype=np.int64),
        sign=np.array(sign),
        offset_P=np.array(offset),
        inertia=np.array(inertia),
        coordinate=np.array(coordinate, dtype=np.int64),
        hinge=np.array(hinge, dtype=np.int64),
        stiffness=np.array(stiffness),
        damping=np.array(damping),
    )


@dataclass(frozen=True)
class _Turn:
    """A prescribed turn about a coordinate axis: by the angle of a hinge (``held`` is None), or held."""

    axis: int
    sign: float
    held: float | None = None


def _turns(axis_B: Vector) -> list[_Turn]:
    """Turns about coordinate axes that make up one about any axis.

    About a skew axis it is Q R_z Q^T with Q = R_z(azimuth) R_y(tilt), which takes z to the axis.
    """
    about = int(np.argmax(np.abs(axis_B)))
    if abs(axis_B[about]) == 1.0:
        return [_Turn(about, axis_B[about])]
    x, y, z = axis_B
    azimuth, tilt = float(np.arctan2(y, x)), float(np.arctan2(np.hypot(x, y), z))
    return [
        _Turn(2, 1.0, azimuth),
        _Turn(1, 1.0, tilt),
        _Turn(2, 1.0),
        _Turn(1, 1.0, -tilt),
        _Turn(2, 1.0, -azimuth),
    ]


def tree_hinges(model: ChainModel, hinges: Array) -> Array:
    """Angle, rate and acceleration (m, 3) of a tree's prescribed coordinates from those of hinges (h, 3)."""
    rows = [
        motion if turn.held is None else np.array([turn.held, 0.0, 0.0])
        for hinge, motion in zip(model.aircraft.hinges, hinges, strict=True)
        for turn in _turns(hinge.axis_B)
    ]
    return np.array(rows).reshape(-1, 3)


def of_hinges(model: ChainModel, prescribed: Array) -> Array:
    """Of values (m,) of a tree's prescribed coordinates, those of the hinges (h,)."""
    turns = [turn for hinge in model.aircraft.hinges for turn in _turns(hinge.axis_B)]
    return np.asarray(prescribed[[turn.held is None for turn in turns]])


def link_bodies(model: ChainModel) -> tuple[IntArray, Array]:
    """Where the links are in the tree: body and origin of each.

    Returns ------- bodies : (links,), whose axes are the link's. origins : (links, 3) of the links from
    their bodies' origins, m.
    """
    bodies, origins, body = [], [], 0
    for surface, row in zip(model.aircraft.surfaces, model.surfaces, strict=True):
        body += sum(len(_turns(hinge.axis_B)) for hinge in surface.hinges)
        bodies.append(body if surface.hinges else 0)
        origins.append(_root(surface) - _pivot(surface))
        for _ in range(int(row[1]) - 1):
            body += 3
            bodies.append(body)
            origins.append(np.zeros(3))
    return np.array(bodies, dtype=np.int64), np.array(origins)


def link_ends(model: ChainModel, batch: ParameterBatch, surface: int, particle: int = 0) -> Array:
    """Ends of one surface's links, (n + 1,) distances from its root in m."""
    of = model.aircraft.surfaces[surface]
    if not of.flexible:
        return np.array([0.0, of.span_m])
    division = batch["division"][particle, model.set_of(batch)[surface]]
    inboard: Array = of.span_m * (np.cumsum(division) - division)
    return np.append(inboard, of.span_m)


def slice_inertia(surface: Surface, start_m: float, end_m: float, origin_W: Array) -> Array:
    """Spatial inertia (6, 6) of the surface between two distances from its root, in its axes.

    ``origin_W`` (3,) is where the elastic axis at ``start_m`` lies from the point to which the inertia
    refers, m.
    """
    points, weights = np.polynomial.legendre.leggauss(SLICES)
    stations = start_m + 0.5 * (end_m - start_m) * (points + 1.0)
    lengths = 0.5 * (end_m - start_m) * weights
    section = surface.section_at(stations)
    from_axis = surface.mass_arm_at(stations)
    about_centres = np.stack([section.inertia_x, section.inertia_y, section.inertia_z], axis=1)
    total: Array = np.zeros((6, 6))
    for i in range(SLICES):
        centre = origin_W + np.array([from_axis[i], surface.span_sign * (stations[i] - start_m), 0.0])
        total += lengths[i] * spatial_inertia(float(section.mass[i]), centre, np.diag(about_centres[i]))
    return np.asarray(total + carried_inertia(surface, start_m, end_m, origin_W))


def carried_inertia(surface: Surface, start_m: float, end_m: float, origin_W: Array) -> Array:
    """Spatial inertia (6, 6) of the point masses between two distances, as in `slice_inertia`.

    A mass near a joint counts on both sides of it, by the area under the parabola 3/4 (1 - u^2), u = -1..1
    over 1 per cent of the span either way, that lies on each side.
    """
    total: Array = np.zeros((6, 6))
    for mass in surface.point_masses:
        at = mass.at * surface.span_m
        low, high = ((end - at) / (0.01 * surface.span_m) for end in (start_m, end_m))
        low = -1.0 if start_m == 0.0 else min(max(low, -1.0), 1.0)
        high = 1.0 if end_m == surface.span_m else min(max(high, -1.0), 1.0)
        area = 0.75 * (high - low) - 0.25 * (high**3 - low**3)
        arm = np.array(
            [
                surface.elastic_axis_offset_m - mass.aft_m - float(surface.aft_at(at)),
                surface.span_sign * (at - start_m),
                -mass.up_m,
            ]
        )
        inertia = np.array(mass.inertia).reshape(3, 3)
        total += area * spatial_inertia(mass.mass_kg, origin_W + arm, inertia)
    return total


def _root(surface: Surface) -> Array:
    """The elastic axis at the undeflected surface's root, (3,) in B, m."""
    x, y, z = surface.position_m
    return np.array([x + surface.elastic_axis_x_m, y, z])


def _pivot(surface: Surface) -> Array:
    """The origin of the first link's body: the last hinge, or the fuselage reference point."""
    return np.array(surface.hinges[-1].position_m) if surface.hinges else np.zeros(3)
