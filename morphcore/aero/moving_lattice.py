"""Air loads of a lattice that rides on moving sections, with Jones' lag on every circulation.

The lattice is placed on the sections (`place`), which recomputes its influence. It then gives the forces for
any velocities of the sections (`section_forces`): in the iterations of a time step only these change.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lu_factor, lu_solve

from morphcore.aero.kernels.lattice_forces import (
    blocked_flow,
    deflect,
    place_lattice,
    section_forces,
)
from morphcore.aero.kernels.lattice_gusts import add_gust_forces, limit_circulation
from morphcore.aero.kernels.lattice_place import LatticeParts, lattice_place
from morphcore.aero.kernels.loads import JONES_A1, JONES_A2
from morphcore.aero.vlm import RingTable, prandtl_glauert
from morphdata.lattice import VortexCore

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]

NO_GUST: Array = np.zeros(0)
LEVEL: Array = np.eye(3)


# the parts of a lattice that change as it slides along its surfaces
SEATED = (
    "line_core",
    "line_width4",
    "line_chord2",
    "corner_arm",
    "control_arm",
    "drag_arm",
    "drag_area",
    "moment_area",
    "slope",
)


@dataclass(frozen=True)
class Riders:
    """Which parts of a lattice ride on which section (k sections, c ring corners, r panels, t strips).

    corner, control, drag : (c,), (r,), (t,) the section that carries each ring corner, control point and
    strip's drag. corner_arm, control_arm, drag_arm : (.., 3) their positions in section axes, m. drag_area :
    (t,) profile drag coefficient times area, m^2. moment_area : (t,) cm0 times the integral of the chord
    squared, m^3. control_chord, drag_chord : (r, 2), (t, 2) x and y of the unit vector of the chord, forward,
    in section axes, at control points and strips. slope : (r,) of the mean line, nose up (twist less
    zero-lift angle). lag_time : (2, r) both time constants of Jones' function, s. control_slope : (c, r)
    slopes of the panels per unit deflection of each control; None: no control. limits : (t, 2) as in
    `LatticeParts`; None: no section stalls.
    """

    sections: int
    corner: IntArray
    corner_arm: Array
    control: IntArray
    control_arm: Array
    drag: IntArray
    drag_arm: Array
    drag_area: Array
    moment_area: Array
    control_chord: Array
    drag_chord: Array
    slope: Array
    lag_time: Array
    control_slope: Array | None = None
    limits: Array | None = None


class MovingLattice:
    """A lattice on its sections; stores the normal influence of its last place.

    Parameters
    ----------
    table, riders, core : the lattice. density : kg/m^3. mach : of the free stream.

    Raises
    ------
    UnsupportedRegime : the Mach number is beyond 0.7.
    """

    def __init__(
        self, table: RingTable, riders: Riders, core: VortexCore, density: float, mach: float
    ) -> None:
        self.parts = lattice_parts(table, riders, core, density, mach)
        self.at = lattice_place(self.parts, riders.sections, table.corners)
        self.at.slope[:] = riders.slope
        self._density, self._mach = density, mach
        self._rings = table.rings
        self._factors: Any = None  # of `lu_factor`, computed on first use in this place

    def place(self, R_BS: Array, x_B: Array, stream_B: Array) -> None:
        """Put the lattice on its sections: R_BS (k, 3, 3) to B, x_B (k, 3) m; wake along stream_B (3,)."""
        self.at.R_BS[:], self.at.x_B[:] = R_BS, x_B
        place_lattice(self.parts, self.at, stream_B)
        self._factors = None

    def reseat(self, table: RingTable, riders: Riders, core: VortexCore) -> None:
        """Take the sizes and arms of a lattice of the same panels, which has slid along its surfaces."""
        seated = lattice_parts(table, riders, core, self._density, self._mach)
        for name in SEATED:
            getattr(self.parts, name)[:] = getattr(seated, name)

    def deflect(self, deflection: Array) -> None:
        """Set the deflections (c,) of all control surfaces, trailing edge down, rad."""
        deflect(self.parts, self.at, deflection)

    def circulation(self, twists: Array, wind_B: Array) -> Array:
        """Circulations (r,), m^2/s, without lag, for twists (k, 6) of the sections in their own axes."""
        right = np.empty(self._rings)
        blocked_flow(self.parts, self.at, twists, wind_B, right)
        if self._factors is None:
            self._factors = lu_factor(self.at.influence[: self._rings].T, check_finite=False)
        return np.asarray(lu_solve(self._factors, right, check_finite=False))

    def section_forces(
        self, lagged: Array, twists: Array, wind_B: Array, gust: Array = NO_GUST, R_NB: Array = LEVEL
    ) -> Array:
        """Force vectors (k, 6) on the sections, in their axes, for the acting circulations (r,).

        Beyond the limits of their sections these are cut off. gust, R_NB : as in `lattice_gusts`.
        """
        out = np.empty((self.at.R_BS.shape[0], 6))
        lagged, _ = self.limited(lagged, twists, wind_B, gust, R_NB)
        section_forces(self.parts, self.at, lagged, twists, wind_B, 0.0, out)
        if gust.size:
            add_gust_forces(self.parts, self.at, R_NB, gust, twists, wind_B, out)
        return out

    def limited(
        self, lagged: Array, twists: Array, wind_B: Array, gust: Array = NO_GUST, R_NB: Array = LEVEL
    ) -> tuple[Array, Array]:
        """Circulations (r,) within the limits of their sections.

        And the worst section before (3,), `lattice_gusts.limit_circulation`; zeros without limits.
        """
        acting, worst = np.array(lagged, dtype=np.float64), np.zeros(3)
        if self.parts.limits.size:
            limit_circulation(self.parts, self.at, R_NB, gust, twists, wind_B, acting, worst)
        return acting, worst


def lattice_parts(
    table: RingTable, riders: Riders, core: VortexCore, density: float, mach: float
) -> LatticeParts:
    """The constant parts of a riding lattice, in the form that its kernels take."""
    radius = table.core_radius_m(core)
    ring = (
        np.concatenate([table.edge_plus, table.leg_plus]),
        np.concatenate([table.edge_minus, table.leg_minus]),
    )
    plus, minus = (np.where(rings < 0, table.rings, rings) for rings in ring)
    surface = np.concatenate([table.edge_surface, table.leg_surface])
    return LatticeParts(
        line_start=np.concatenate([table.edge_start, table.leg_start]),
        line_end=np.concatenate([table.edge_end, np.full(table.leg_start.size, -1)]),
        line_plus=plus,
        line_minus=minus,
        line_core=radius[surface] ** (2 if core.law == "smoothed" else 4),
        line_width4=np.concatenate([np.zeros(table.edges), table.leg_width_m**4]),
        line_chord2=table.mean_chord_m[surface] ** 2,
        ring_corner=table.ring_corner.copy(),
        panel_side=np.array(table.panel_side, dtype=np.float64),
        corner=riders.corner,
        corner_arm=riders.corner_arm,
        control=riders.control,
        control_arm=riders.control_arm,
        drag=riders.drag,
        drag_arm=riders.drag_arm,
        drag_area=riders.drag_area,
        moment_area=riders.moment_area / prandtl_glauert(mach),
        control_chord=riders.control_chord,
        drag_chord=riders.drag_chord,
        slope=riders.slope,
        smoothed=core.law == "smoothed",
        stretch=1.0 / prandtl_glauert(mach),
        density=float(density),
        control_slope=np.zeros((0, table.rings)) if riders.control_slope is None else riders.control_slope,
        ring_strip=_ring_strips(table),
        limits=np.zeros((0, 2)) if riders.limits is None else riders.limits,
    )


def _ring_strips(table: RingTable) -> IntArray:
    """The strip (r,) of each ring, numbered through all surfaces."""
    out, strips = np.zeros(table.rings, dtype=np.int64), 0
    for surface in range(int(table.panel_surface.max()) + 1):
        own = np.flatnonzero(table.panel_surface == surface)
        spanwise = int((table.panel_row[own] == 0).sum())
        out[own] = strips + np.arange(own.size) % spanwise
        strips += spanwise
    return out


def acting_circulation(circulation: Array, lag: Array) -> Array:
    """Circulations (r,) after Jones' lag, with both lag states (2, r)."""
    return np.asarray((1.0 - JONES_A1 - JONES_A2) * circulation + JONES_A1 * lag[0] + JONES_A2 * lag[1])
