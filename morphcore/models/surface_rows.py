"""A surface cut into links, and the kernel constants into which identifiable parameters are written."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from morphcore.aero.apparent_mass import apparent_inertia
from morphcore.geometry.aircraft import Flight
from morphcore.geometry.lattice import SurfaceLattice
from morphcore.geometry.surface import Surface
from morphcore.models.links import link_edges
from morphcore.multibody.kernels.articulated import L_APPARENT

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]


@dataclass(frozen=True)
class CutSurface:
    """A surface in its flight condition, cut into links.

    Attributes
    ----------
    surface : Surface
    flight : Flight
    division : ndarray, shape (p, n)
        Shares of the span of the links of p models, which sum to one.
    """

    surface: Surface
    flight: Flight
    division: Array

    @property
    def edges(self) -> Array:
        """Ends of the links (p, n + 1), distances from the root in m."""
        return link_edges(self.division, self.surface.length_m)


@dataclass
class SurfaceRows:
    """The kernel constants of one surface's links, into which parameters are written.

    Attributes
    ----------
    surface : Surface
    part : SurfaceLattice
    step_s : float
        Time step, s.
    links : ndarray, shape (p, n, LINK_ROWS)
        Rows as named in articulated.py and loads.py (``L_...``).
    stiffness, damping : ndarray, shape (p, 3 (n - 1))
        Of flap, torsion and edgewise of each gimbal, N m/rad and N m s/rad.
    overlap : ndarray, shape (p, 2 strips n)
        For each strip and link, the share of the strip and the middle of that share in link axes, m.
    touched : ndarray of int, shape (p, n, 2)
        First strip of each link, and the one after its last.
    """

    surface: Surface
    part: SurfaceLattice
    step_s: float
    links: Array
    stiffness: Array
    damping: Array
    overlap: Array
    touched: IntArray

    def add_apparent_mass(self, edges: Array, flight: Flight) -> None:
        """Write the apparent inertia of links with these ends (p, n + 1), m."""
        start, end = edges[:, :-1], edges[:, 1:]
        found = apparent_inertia(self.surface, flight.air_density_kg_m3, start, end, start)
        rows, columns = np.triu_indices(3)
        self.links[:, :, L_APPARENT : L_APPARENT + 6] = found[..., rows, columns]
