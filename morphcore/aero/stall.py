"""Limits of the sections' lift, from the documents to the kernels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

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


@dataclass(frozen=True)
class StallRecord:
    """How near sections came to the limits of their lift, at k times.

    ratio : (k,) the largest ratio of a section's lift to its limit, as if it did not stall. surface, at,
    limit : (k,) of that section: number of its surface, share of the span, and the limiting lift coefficient.
    """

    names: tuple[str, ...]
    ratio: Array
    surface: NDArray[np.int64]
    at: Array
    limit: Array

    def worst(self, row: int) -> tuple[str, float, float, float]:
        """Name of the surface, share of the span, lift coefficient and its limit at one of the times."""
        limit = float(self.limit[row])
        name = self.names[int(self.surface[row])]
        return name, float(self.at[row]), float(self.ratio[row]) * limit, limit


def stall_record(lift: Array, surfaces: Sequence[Surface], lattices: Sequence[SurfaceLattice]) -> StallRecord:
    """The record for lift coefficients (k, strips) of all strips, as if none stalled."""
    limits = lift_limits(surfaces, lattices)
    share = lift / np.where(lift > 0.0, limits[:, 1], limits[:, 0])
    rows, worst = np.arange(lift.shape[0]), np.argmax(share, axis=1)
    return record_of(share[rows, worst], worst, lift[rows, worst] > 0.0, surfaces, lattices)


def record_of(
    ratio: Array,
    strip: NDArray[np.int64],
    upper: NDArray[np.bool_],
    surfaces: Sequence[Surface],
    lattices: Sequence[SurfaceLattice],
) -> StallRecord:
    """The record for the largest ratios, their strips, and whether of the upper limit, (k,) each."""
    limits = lift_limits(surfaces, lattices)
    number = np.concatenate([np.full(each.spanwise, k) for k, each in enumerate(lattices)])
    middles = [
        0.5 * (each.strip_edges_m[1:] + each.strip_edges_m[:-1]) / surface.length_m
        for surface, each in zip(surfaces, lattices, strict=True)
    ]
    names = tuple(surface.name for surface in surfaces)
    limit = limits[strip, np.asarray(upper, dtype=np.int64)]
    return StallRecord(names, ratio, number[strip], np.concatenate(middles)[strip], limit)
