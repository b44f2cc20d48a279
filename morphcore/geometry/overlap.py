"""Overlap of lifting surfaces: intersecting lattices give meaningless loads.

Mid-surfaces are flat trapezia. Two nearly parallel surfaces overlap if their outlines do and their distance
is less than their mean thickness; two surfaces at an angle overlap if one cuts through the other. Both are
tested by separating axes (Gottschalk, Lin & Manocha 1996): convex bodies are apart if their projections onto
some axis are.
"""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import ArrayLike, NDArray

from morphcore.geometry.aircraft import Aircraft
from morphcore.geometry.lattice import chord_points, surface_pose
from morphcore.geometry.surface import Surface

Array = NDArray[np.float64]

PARALLEL = 0.985  # cosine of ten degrees between the normals
DEPTH_CHORDS = 0.02  # of the smaller mean chord: surfaces that meet at an edge do not overlap
SHAPES = 9  # shapes of a flight that are checked


def overlapping_surfaces(aircraft: Aircraft, angles: Array) -> list[tuple[int, int, int]]:
    """Pairs of surfaces that overlap at any of some hinge angles.

    Parameters
    ----------
    angles : (k, h) of all hinges over a flight, rad. Of the rows
        SHAPES are used, evenly spaced and including both ends, and those where each angle is smallest and
        largest.

    Returns
    -------
    (first, second, row) of each pair, where row is the first of ``angles`` at which they overlap.
    """
    spread = np.linspace(0, angles.shape[0] - 1, SHAPES).round().astype(np.int64)
    rows = np.unique(np.concatenate([spread, angles.argmin(axis=0), angles.argmax(axis=0)]))
    found: dict[tuple[int, int], int] = {}
    for row in rows:
        outlines = [
            panels_B(surface, angles[row, own])
            for surface, own in zip(aircraft.surfaces, aircraft.hinge_columns, strict=True)
        ]
        for first, second in itertools.combinations(range(len(outlines)), 2):
            pair = aircraft.surfaces[first], aircraft.surfaces[second]
            if (first, second) not in found and any(
                _overlap(*pair, one, other)
                for one, other in itertools.product(outlines[first], outlines[second])
            ):
                found[first, second] = int(row)
    return [(first, second, row) for (first, second), row in found.items()]


def panels_B(surface: Surface, hinge_rad: ArrayLike) -> list[Array]:
    """Trapezia that make up an undeformed surface's mid-plane: the whole, or one between two stations each.

    Corners (4, 3) in B, around it from the inner leading edge, m. hinge_rad : (m,) of its hinges.
    """
    R_BW, r_B = surface_pose(surface, hinge_rad)
    ends = surface.breaks_m
    hidden = surface.hidden_m(hinge_rad)
    if hidden > 0.0:  # in another panel, from whose mouth the surface slides
        ends = np.concatenate([[hidden], ends[ends > hidden]])
    front, aft = chord_points(surface, np.array([0.0, 1.0]), ends) @ R_BW.T + r_B
    return [np.stack([front[a], front[a + 1], aft[a + 1], aft[a]]) for a in range(front.shape[0] - 1)]


def _overlap(first: Surface, second: Surface, one_B: Array, other_B: Array) -> bool:
    depth = DEPTH_CHORDS * min(first.mean_chord_m, second.mean_chord_m)
    edges = [np.roll(corners, -1, axis=0) - corners for corners in (one_B, other_B)]
    normals = [_unit(np.cross(own[0], own[1])) for own in edges]
    if abs(float(normals[0] @ normals[1])) > PARALLEL:
        height = (other_B - one_B[0]) @ normals[0]
        gap = max(height.min(), -height.max(), 0.0)
        axes = np.cross(normals[0], np.concatenate(edges))
        if gap >= 0.5 * (first.thickness_m + second.thickness_m):
            return False
    else:
        crossed = np.cross(edges[0][:, None], edges[1][None]).reshape(-1, 3)
        axes = np.concatenate([normals, crossed])
    lengths = np.linalg.norm(axes, axis=1)
    axes = axes[lengths > 1e-9 * lengths.max()]
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    one, other = one_B @ axes.T, other_B @ axes.T
    common = np.minimum(one.max(axis=0) - other.min(axis=0), other.max(axis=0) - one.min(axis=0))
    return bool(common.min() > depth)


def _unit(vector: Array) -> Array:
    return np.asarray(vector / np.linalg.norm(vector))
