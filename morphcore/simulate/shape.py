"""The shape of the flown aircraft at chosen times: poses of its surfaces' sections, and their edges.

A surface is given at stations along its span by its elastic axis, leading edge and trailing edge in N, and by
the attitude of the section there. Between two stations all three lines are straight, but for the beams'
curvature between two strips. Stations are the edges of the lattice's strips; in chains of links also both
sides of every joint, where the edges of two links meet only if the joint does not turn. Like the lattice,
surfaces are flat: camber, twist and deflected controls are slopes and move no point.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from morphcore.frames import euler_from_rotation, quaternion_from_euler
from morphcore.geometry.lattice import SurfaceLattice, chord_points
from morphcore.geometry.mirror import Mirror
from morphcore.geometry.surface import Surface
from morphcore.models.equivalent import ChainModel, ParameterBatch
from morphcore.models.kinematics import level_hinges, link_poses
from morphcore.models.links import link_edges
from morphcore.multibody.kernels.hinge import H_ORIGIN
from morphcore.shown import Shown

Array = NDArray[np.float64]
Document = dict[str, Any]

EDGES = np.array([0.0, 1.0])  # leading and trailing edge, as fractions of the chord
ACROSS = np.array([1.0, -1.0, 1.0])  # reflection about the x-z plane
LINES = ("axis_N", "leading_N", "trailing_N")


@dataclass(frozen=True, repr=False)
class SurfaceShape(Shown):
    """One surface at t times and k stations.

    name : of the surface. at : (k,) shares of the span, from the root; equal ones are the two sides of a
    joint. axis_N, leading_N, trailing_N : (t, k, 3) elastic axis and edges of the chord, m. R_NS :
    (t, k, 3, 3) section axes (forward, right, down on the undeflected surface) to N.
    """

    name: str
    at: Array
    axis_N: Array
    leading_N: Array
    trailing_N: Array
    R_NS: Array

    def to_document(self) -> Document:
        """JSON form; positions in m, north, east, down."""
        return {
            "name": self.name,
            "at": self.at.tolist(),
            "axis_n_m": self.axis_N.tolist(),
            "leading_n_m": self.leading_N.tolist(),
            "trailing_n_m": self.trailing_N.tolist(),
            "quaternion_ns": _quaternion(self.R_NS).tolist(),
        }


@dataclass(frozen=True, repr=False)
class Shape(Shown):
    """The aircraft at t times.

    time_s : (t,). position_N, R_NB : (t, 3) m and (t, 3, 3) of the fuselage. surfaces : in the aircraft's
    order.
    """

    time_s: Array
    position_N: Array
    R_NB: Array
    surfaces: tuple[SurfaceShape, ...]

    def to_document(self) -> Document:
        """JSON form, `morphdata.shape.FlownShape`."""
        return {
            "time_s": self.time_s.tolist(),
            "position_n_m": self.position_N.tolist(),
            "quaternion_nb": _quaternion(self.R_NB).tolist(),
            "surfaces": [surface.to_document() for surface in self.surfaces],
        }

    def moved(self, time_s: Array, position_N: Array, R_NB: Array) -> Shape:
        """The same shape, given in B, at times when the fuselage is at ``position_N`` with ``R_NB``."""
        surfaces = tuple(
            replace(
                surface,
                R_NS=np.einsum("tij,tkjl->tkil", R_NB, surface.R_NS),
                **{
                    line: position_N[:, None] + np.einsum("tij,tkj->tki", R_NB, getattr(surface, line))
                    for line in LINES
                },
            )
            for surface in self.surfaces
        )
        return Shape(time_s, position_N, R_NB, surfaces)


def section_arms(surface: Surface, distance_m: Array, origin_m: Array) -> Array:
    """Elastic axis, leading and trailing edge (3, k, 3) of stations in the axes of what carries them, m.

    Parameters
    ----------
    distance_m : ndarray, shape (k,)
        Of the stations from the root.
    origin_m : ndarray, shape (k,)
        Of the origins of what carries them, on the elastic axis.
    """
    carrier = np.zeros((distance_m.size, 3))
    carrier[:, 1] = surface.span_sign * origin_m
    axis = np.zeros((1, distance_m.size, 3))
    axis[0, :, 1] = surface.span_sign * distance_m
    edges = chord_points(surface, EDGES, distance_m) - surface.elastic_axis_W
    return np.asarray(np.concatenate([axis, edges]) - carrier)


def surface_shape(surface: Surface, distance_m: Array, arms: Array, R: Array, x: Array) -> SurfaceShape:
    """The shape from poses (t, k, 3, 3) and (t, k, 3) of what carries each station, and `section_arms`."""
    lines = x[None] + np.einsum("tkij,ckj->ctki", R, arms)
    axis, leading, trailing = lines
    return SurfaceShape(surface.name, distance_m / surface.length_m, axis, leading, trailing, R)


def chain_shape(model: ChainModel, batch: ParameterBatch, hinges: Array, q_joint: Array) -> Shape:
    """The shape (at t times, in B) of one parameter set of a chain, of the half that is flown or the whole.

    Parameters
    ----------
    hinges : ndarray, shape (t, s, HINGE_ROWS)
    q_joint : ndarray, shape (t, coordinates)
        rad.
    """
    times = q_joint.shape[0]
    repeated = batch.select(np.zeros(times, dtype=np.int64))
    R_WL, r_W = link_poses(model, repeated, level_hinges(model), q_joint)
    chosen, shapes = model.set_of(batch), []
    for number, (surface, part) in enumerate(
        zip(model.aircraft.surfaces, model.lattice.lattices, strict=True)
    ):
        first, count = int(model.surfaces[number, 0]), int(model.surfaces[number, 1])
        division = np.ones((1, 1)) if not surface.flexible else batch.of_set("division", chosen[number])[:1]
        distance, link, origin = link_stations(part, link_edges(division, surface.length_m)[0])
        R_BW, r_B = hinges[:, number, :9].reshape(-1, 3, 3), hinges[:, number, H_ORIGIN:]
        own = slice(first, first + count)
        R = np.einsum("tij,tkjl->tkil", R_BW, R_WL[:, own][:, link])
        x = r_B[:, None] + np.einsum("tij,tkj->tki", R_BW, r_W[:, own][:, link])
        shapes.append(surface_shape(surface, distance, section_arms(surface, distance, origin), R, x))
    return Shape(np.zeros(times), np.zeros((times, 3)), np.tile(np.eye(3), (times, 1, 1)), tuple(shapes))


def link_stations(part: SurfaceLattice, edges_m: Array) -> tuple[Array, NDArray[np.int64], Array]:
    """Stations (k,) m of a chain from the root, the link that carries each, and that link's origin, m."""
    distance, link = [], []
    for number in range(edges_m.size - 1):
        low, high = edges_m[number], edges_m[number + 1]
        inside = part.strip_edges_m[(part.strip_edges_m > low) & (part.strip_edges_m < high)]
        distance += [low, *inside, high]
        link += [number] * (inside.size + 2)
    carried = np.array(link, dtype=np.int64)
    return np.array(distance), carried, edges_m[carried]


def of_both_halves(shape: Shape, mirror: Mirror, names: Sequence[str]) -> Shape:
    """The whole aircraft's shape in B from that of one half, when both move alike; names of all surfaces."""
    found = {}
    for own, image, surface in zip(mirror.own, mirror.image, shape.surfaces, strict=True):
        found[own] = surface
        lines = {line: ACROSS * getattr(surface, line) for line in LINES}
        found[image] = replace(
            surface, name=names[image], R_NS=ACROSS[:, None] * surface.R_NS * ACROSS, **lines
        )
    return replace(shape, surfaces=tuple(found[k] for k in range(len(found))))


def _quaternion(rotation: Array) -> Array:
    """Unit quaternions (..., 4), (w, x, y, z), of rotations (..., 3, 3)."""
    return np.asarray(quaternion_from_euler(*np.moveaxis(euler_from_rotation(rotation), -1, 0)))
