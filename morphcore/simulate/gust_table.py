"""The gust at every strip along a flight, for the kernels."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from morphcore.aero.environment import MovingAir
from morphcore.aero.gust_lag import Lag
from morphcore.aero.operator import AircraftLattice
from morphcore.geometry.hinge import hinge_arms, hinged_pose
from morphcore.shown import Shown

Array = NDArray[np.float64]

PIECE = 1000  # times


@dataclass(frozen=True, repr=False)
class GustTable(Shown):
    """Gust and turbulence at the strips of a lattice, evaluated where it is needed.

    A strip meets the air at its leading edge, where the unbent surface has it at its hinge angles: ahead of
    the reference point by the distance along the flight path, which has the angle of attack ``alpha``, rad.

    lattice : with m strips. lag : from the gust to what goes into the circulation. times_s : (k,). angles :
    (k, h) of all hinges, rad.
    """

    air: MovingAir
    lattice: AircraftLattice
    alpha: float
    lag: Lag
    times_s: Array
    angles: Array

    def at(self, rows: slice | NDArray[np.int64]) -> GustTable:
        """The table at some of the times."""
        return replace(self, times_s=self.times_s[rows], angles=self.angles[rows])

    def between(self, first: int, last: int) -> Array:
        """Rows (k, 6 m) of the times first..last - 1.

        For each strip the gust (3) in N, m/s, and the same (3) as the circulation follows it.
        """
        part = slice(first, last)
        ahead, right = self.leading_edges(self.angles[part])
        along = self.air.airspeed_m_s * self.times_s[part, None] + ahead
        semichords = np.concatenate([0.5 * lattice.strip_chord_m for lattice in self.lattice.lattices])
        gust = self.air.velocity(along, right)
        followed = self.air.followed(self.lag, semichords, along, right)
        return np.ascontiguousarray(np.concatenate([gust, followed], axis=2).reshape(along.shape[0], -1))

    def every(self) -> Array:
        """All rows (k, 6 m), a piece at a time to bound the memory."""
        count = self.times_s.size
        out = np.empty((count, 6 * self.lattice.strips))
        for first in range(0, count, PIECE):
            out[first : first + PIECE] = self.between(first, first + PIECE)
        return out

    def leading_edges(self, angles: Array) -> tuple[Array, Array]:
        """Places (k, m) of the strips' leading edges ahead of the reference point, and right of it, m."""
        ahead, right = [], []
        path_B = np.array([np.cos(self.alpha), 0.0, np.sin(self.alpha)])
        aircraft = self.lattice.aircraft
        for surface, own, lattice in zip(
            aircraft.surfaces, aircraft.hinge_columns, self.lattice.lattices, strict=True
        ):
            edge = lattice.panel_corners_W[0]
            middle_W = 0.5 * (edge[1:] + edge[:-1])
            arms = hinge_arms(surface.hinges, np.array(surface.position_m))
            R_BW, r_B = hinged_pose(surface.hinges, arms, angles[:, own], surface.rest_R_BW)
            places_B = r_B[:, None] + np.einsum("kij,mj->kmi", R_BW, middle_W)
            ahead.append(places_B @ path_B)
            right.append(places_B[..., 1])
        return np.concatenate(ahead, axis=1), np.concatenate(right, axis=1)


def air_rows(wind_N: Array, gusts: GustTable | None, first: int, last: int) -> Array:
    """Rows of the air for the kernels at the times first..last - 1.

    They hold the uniform wind (3), of ``wind_N`` (k, 3), then what `GustTable.between` gives.
    """
    own = wind_N[first:last]
    return own if gusts is None else np.concatenate([own, gusts.between(first, last)], axis=1)
