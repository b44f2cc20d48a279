"""Limits of the sections' lift, from the documents to the kernels."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from morphcore.geometry.lattice import SurfaceLattice
from morphcore.geometry.surface import Surface

Array = NDArray[np.float64]

NO_LIMIT = 1e9  # a lift coefficient that no section has


def stalls(surfaces: Sequence[Surface]) -> bool:
    """Whether any surface gives a limit of its sections' lift."""
    return any(surface.cl_max is not None or surface.cl_min is not None for surface in surfaces)


def lift_limits(surfaces: Sequence[Surface], lattices: Sequence[SurfaceLattice]) -> Array:
    """Smallest and largest lift coefficient (strips, 2) of all strips; (0, 2) if no surface gives any."""
    if not stalls(surfaces):
        return np.zeros((0, 2))
    rows = []
    for surface, lattice in zip(surfaces, lattices, strict=True):
        low = -NO_LIMIT if surface.cl_min is None else surface.cl_min
        high = NO_LIMIT if surface.cl_max is None else surface.cl_max
        rows.append(np.tile([low, high], (lattice.spanwise, 1)))
    return np.concatenate(rows)


def strip_half_areas(lattices: Sequence[SurfaceLattice]) -> Array:
    """Half the area (strips,) of all strips, m^2."""
    return np.concatenate([0.5 * lattice.panel_area_m2.sum(axis=0) for lattice in lattices])


def strip_name(
    surfaces: Sequence[Surface], lattices: Sequence[SurfaceLattice], strip: int
) -> tuple[int, float]:
    """The surface of a strip, and the strip's middle as a share of its span."""
    number = 0
    while strip >= lattices[number].spanwise:
        strip -= lattices[number].spanwise
        number += 1
    edges = lattices[number].strip_edges_m
    return number, float(0.5 * (edges[strip] + edges[strip + 1]) / surfaces[number].length_m)
