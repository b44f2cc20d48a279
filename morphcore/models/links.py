"""Rigid links cut from a lifting surface: mass properties, joint compliance, share of the lattice's strips.

All functions work on batches: ``edges`` (particles, n + 1) are the links' ends, distances from the root in m,
rising from 0 to the span.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from morphcore.geometry.lattice import SurfaceLattice
from morphcore.geometry.surface import Surface

Array = NDArray[np.float64]

# Gauss-Legendre: four points integrate a linearly tapered solid wing's inertia (degree six in the span)
# exactly
POINTS, WEIGHTS = np.polynomial.legendre.leggauss(4)
MASS_ROWS = 7


def link_edges(division: Array, span_m: float) -> Array:
    """Ends of the links (particles, n + 1) from the division fractions (particles, n), which sum to one."""
    edges = np.concatenate([np.zeros((division.shape[0], 1)), np.cumsum(division, axis=1)], axis=1) * span_m
    edges[:, -1] = span_m
    return edges


def link_masses(surface: Surface, edges: Array) -> Array:
    """Mass properties (particles, n, 7) of each link about its origin on the elastic axis at its inboard end.

    Mass (kg), first moments m x and m y (kg m), and the elements xx, yy, zz, xy of the inertia matrix (kg
    m^2).
    """
    start, length = edges[:, :-1, None], np.diff(edges, axis=1)[..., None]
    stations = start + length * 0.5 * (POINTS + 1)
    weight = 0.5 * length * WEIGHTS
    section = surface.section_at(stations.ravel())
    mass, ix, iy, iz = (
        value.reshape(stations.shape) * weight
        for value in (section.mass, section.inertia_x, section.inertia_y, section.inertia_z)
    )
    x = surface.mass_axis_x_m - surface.elastic_axis_x_m
    y = surface.span_sign * (stations - start)
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


def joint_stiffness(surface: Surface, edges: Array) -> Array:
    """Beam theory's guess (particles, n - 1, 3) for flap, torsion and edgewise, N m/rad.

    A joint stands for the beam between the centres of its two links: 1/k is the integral of 1/EI (of 1/GJ)
    over it, EI / l on a uniform beam.
    """
    centres = 0.5 * (edges[:, 1:] + edges[:, :-1])
    start, length = centres[:, :-1, None], np.diff(centres, axis=1)[..., None]
    stations = start + length * 0.5 * (POINTS + 1)
    weight = 0.5 * length * WEIGHTS
    section = surface.section_at(stations.ravel())
    compliance = [
        (weight / value.reshape(stations.shape)).sum(-1)
        for value in (section.ei_flap, section.gj, section.ei_edge)
    ]
    return np.asarray(1.0 / np.stack(compliance, axis=-1))


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
    """Planform area (particles, n) of each link in m^2 and the y of its centroid in link axes, m."""
    start, length = edges[:, :-1, None], np.diff(edges, axis=1)[..., None]
    stations = start + length * 0.5 * (POINTS + 1)
    chord = surface.chord_at(stations) * 0.5 * length * WEIGHTS
    area = chord.sum(-1)
    return area, surface.span_sign * (chord * (stations - start)).sum(-1) / area
