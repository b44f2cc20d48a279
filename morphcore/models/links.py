"""Rigid links cut from a lifting surface: mass properties, joint compliance, share of the lattice's strips.

All functions work on batches: ``edges`` (particles, n + 1) are the links' ends as distances from the root, m,
increasing from 0 to the length of the elastic axis (the span, unless swept).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from morphcore.geometry.lattice import SurfaceLattice
from morphcore.geometry.surface import Surface
from morphcore.models.span_quadrature import span_points

Array = NDArray[np.float64]

# Gauss-Legendre: four points integrate the inertia of a linearly tapered solid wing (degree six in the span)
# exactly
POINTS, WEIGHTS = np.polynomial.legendre.leggauss(4)
MASS_ROWS = 7
# eight integrate 1 / EI of a wing of taper 0.2 to 1e-6
BEAM_POINTS, BEAM_WEIGHTS = np.polynomial.legendre.leggauss(8)


def link_edges(division: Array, length_m: float) -> Array:
    """Ends of the links (particles, n + 1) from the division fractions (particles, n), which sum to one."""
    edges = np.concatenate([np.zeros((division.shape[0], 1)), np.cumsum(division, axis=1)], axis=1) * length_m
    edges[:, -1] = length_m
    return edges


def link_masses(surface: Surface, edges: Array) -> Array:
    """Mass properties (particles, n, 7) of each link about its origin on the elastic axis at its inboard end.

    Mass (kg), first moments m x and m y (kg m), and the elements xx, yy, zz, xy of the inertia matrix (kg
    m^2).
    """
    start = edges[:, :-1, None]
    stations, length, rule = span_points(surface, edges, POINTS, WEIGHTS)
    weight = 0.5 * length * rule
    section = surface.section_at(stations.ravel())
    mass, ix, iy, iz = (
        value.reshape(stations.shape) * weight
        for value in (section.mass, section.inertia_x, section.inertia_y, section.inertia_z)
    )
    ahead = surface.mass_arm_at(stations)
    x, y = ahead * surface.chord_W[0], surface.span_sign * (stations - start) + ahead * surface.chord_W[1]
    return np.stack(
        [
            mass.sum(-1),
            (mass * x).sum(-1),
            (mass * y).sum(-1),
            (ix + mass * y**2).sum(-1),
            (iy + mass * x**2).sum(-1),
            (iz + mass * (x**2 + y**2)).sum(-1),
            -(mass * x * y).sum(-1),
        ],
        axis=-1,
    )


def beam_division(surface: Surface, links: int) -> Array:
    """Division (n,) of the chain of n links that represents the whole beam; the shares sum to one.

    The span is divided into n - 1 equal segments. The joint of each is placed where a hinge bends the wing as
    the segment does: at the centre of its curvature under a moment that falls linearly to the tip, like that
    of a tip force or the torque of a uniform load. This replaces the integral over the segment by one-point
    Gauss quadrature (see `joint_stiffness`).
    """
    if links == 1:
        return np.ones(1)
    ends = np.linspace(0.0, surface.length_m, links)
    stations, curvature = _segment_compliance(surface, ends[None])
    flap = curvature[0, 0]
    joints = (flap * stations[0]).sum(-1) / flap.sum(-1)
    return np.asarray(np.diff(joints, prepend=0.0, append=surface.length_m) / surface.length_m)


def joint_stiffness(surface: Surface, edges: Array) -> Array:
    """Guess from beam theory (particles, n - 1, 3) for flap, torsion and edgewise, N m/rad.

    Each joint represents a segment of the beam, and the segments together the whole beam: the first begins at
    the root, the last ends at the tip, and the links between two joints are divided as in `beam_division`.
    Under a moment (or torque) that falls linearly to the tip, a joint turns by the angle by which its segment
    bends (or twists)

        1 / k = integral of (L - y) / EI over the segment / (L - y_joint)

    With the joints of `beam_division` the chain is exact in slope and deflection of its tip under a force at
    the tip, in its slope under a distributed load (on a uniform beam), and in its twist under a distributed
    torque. Its deflection under a distributed load is too small by 11 per cent with two links on a uniform
    beam, 4 with three, and 0.3 with eight.
    """
    if edges.shape[1] == 2:
        return np.zeros((edges.shape[0], 0, 3))
    _, compliance = _segment_compliance(surface, segment_ends(surface, edges))
    arms = surface.length_m - edges[:, 1:-1]
    return np.asarray(arms[..., None] / np.moveaxis(compliance.sum(-1), 0, -1))


def segment_ends(surface: Surface, edges: Array) -> Array:
    """Ends (particles, n) of the n - 1 segments of the beam for which the joints stand, m from the root."""
    links, span = edges.shape[1] - 1, surface.length_m
    if links == 1:
        return np.zeros((edges.shape[0], 1))
    own = link_edges(beam_division(surface, links)[None], span)[0, 1:-1]
    cut = (np.linspace(0.0, span, links)[1:-1] - own[:-1]) / np.diff(own)
    joints = edges[:, 1:-1]
    ends = np.zeros((edges.shape[0], links))
    ends[:, 1:-1] = joints[:, :-1] + cut * np.diff(joints, axis=1)
    ends[:, -1] = span
    return ends


def _segment_compliance(surface: Surface, ends: Array) -> tuple[Array, Array]:
    """Compliance of a surface's segments under the moment L - y, which falls linearly to the tip.

    Parameters
    ----------
    ends : ndarray, shape (p, n)
        Ends of n - 1 segments, distances from the root in m.

    Returns
    -------
    stations : ndarray, shape (p, n - 1, points)
        Of the quadrature, m.
    compliance : ndarray, shape (3, p, n - 1, points)
        Flap, torsion, edgewise: weight times (L - y) over EI or GJ; the sum over points is the integral.
    """
    stations, length, rule = span_points(surface, ends, BEAM_POINTS, BEAM_WEIGHTS)
    moment = 0.5 * length * rule * (surface.length_m - stations)
    section = surface.section_at(stations.ravel())
    stiffness = np.stack([section.ei_flap, section.gj, section.ei_edge]).reshape(3, *stations.shape)
    return stations, moment / stiffness


def twist_slopes(surface: Surface, edges: Array) -> Array:
    """Rows L_SLOPE to L_TURN_Y (particles, n, 4) of links whose sections are twisted (see `sloped`)."""
    growth = surface.span_sign * surface.twist_rad / surface.length_m  # along y
    length = surface.span_sign * np.diff(edges, axis=1)
    start = surface.twist_at(edges[:, :-1])
    return np.stack(
        [
            start,
            np.full_like(start, growth),
            surface.chord_W[0] * growth * length**2 / 6.0,
            -surface.chord_W[0] * (start + growth * length),
        ],
        axis=-1,
    )


def strip_overlap(surface: Surface, lattice: SurfaceLattice, edges: Array) -> tuple[Array, Array]:
    """Share of each strip that lies on each link, and the middle of that share.

    Returns
    -------
    weight : (particles, strips, n), rows sum to one over the links.
    middle_y : (particles, strips, n), y of the share's middle in link axes, m; 0 where there is none.
    """
    inboard, outboard = lattice.strip_edges_m[:-1, None], lattice.strip_edges_m[1:, None]
    low = np.maximum(inboard, edges[:, None, :-1])
    high = np.minimum(outboard, edges[:, None, 1:])
    weight = np.maximum(high - low, 0.0) / (outboard - inboard)
    middle = surface.span_sign * (0.5 * (low + high) - edges[:, None, :-1])
    return weight, np.where(weight > 0.0, middle, 0.0)


def drag_areas(surface: Surface, edges: Array) -> tuple[Array, Array]:
    """Planform area (particles, n) of each link in m^2 and the y of its centroid in link axes, m.

    Where the profile drag varies along the span, the area is weighted by it (`Surface.drag_share_at`).
    """
    start = edges[:, :-1, None]
    stations, length, rule = span_points(surface, edges, POINTS, WEIGHTS)
    chord = (
        surface.chord_at(stations)
        * surface.chord_W[0]
        * 0.5
        * length
        * rule
        * surface.drag_share_at(stations)
    )
    area = chord.sum(-1)
    return area, surface.span_sign * (chord * (stations - start)).sum(-1) / area


def moment_areas(surface: Surface, edges: Array) -> tuple[Array, Array]:
    """Integral of the chord squared (particles, n) over each link in m^3, and the y of its centroid, m."""
    start = edges[:, :-1, None]
    stations, length, rule = span_points(surface, edges, POINTS, WEIGHTS)
    squared = surface.chord_at(stations) ** 2 * surface.chord_W[0] * 0.5 * length * rule
    total = squared.sum(-1)
    return total, surface.span_sign * (squared * (stations - start)).sum(-1) / total
