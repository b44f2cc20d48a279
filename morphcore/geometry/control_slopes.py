"""The slopes that control surfaces give to a lattice.

A deflection turns the normals of the panels behind the hinge line (linearised): the normal velocity that the
circulation must induce there grows by the structure's velocity along the chord, forward positive, times a
slope. Geometry and influence stay as they are. The slope of a control in a strip is its deflection times
the share of the strip's width that it covers, times weights of the strip's rows of panels.

With a few panels along the chord, weights that only say how much of a panel is behind the hinge line are in
error by tens of per cent. These weights are the nearest to them (least squares) with which the same lattice
in two dimensions has exactly the lift and the moment of thin-airfoil theory (Glauert 1926; Katz & Plotkin
2001, section 5.4), whatever the number of rows; a single row has the lift alone. They are continuous in
chord fraction and ends.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from morphcore.geometry.control import Control
from morphcore.geometry.lattice import CONTROL_POINT, RING_FRONT, SurfaceLattice

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]


@dataclass(frozen=True)
class ControlSlopes:
    """Slopes of a lattice per unit deflection, trailing edge down (m parts: one control in one strip each).

    control : (m,) number of the control among all of the aircraft. strip : (m,) number of the strip among
    all. slope : (m, rows) of the strip's panels from the leading edge.
    """

    control: IntArray
    strip: IntArray
    slope: Array

    @property
    def parts(self) -> int:
        """Number m of parts."""
        return int(self.control.size)


def control_slopes(
    controls: Sequence[Sequence[Control]], lattices: Sequence[SurfaceLattice], strip0: Sequence[int]
) -> ControlSlopes:
    """Slopes of the controls of every surface on its lattice, whose first strip is ``strip0`` among all."""
    number, of, strips, slopes = 0, [], [], []
    for own, lattice, first in zip(controls, lattices, strip0, strict=True):
        edges = lattice.strip_edges_m / lattice.strip_edges_m[-1]
        for control in own:
            covered = np.minimum(edges[1:], control.stop) - np.maximum(edges[:-1], control.start)
            share = np.clip(covered / np.diff(edges), 0.0, 1.0)
            weights = flap_weights(lattice.chordwise, control.chord_fraction)
            for strip in np.flatnonzero(share > 0.0):
                of.append(number)
                strips.append(first + int(strip))
                slopes.append(share[strip] * weights)
            number += 1
    rows = lattices[0].chordwise if lattices else 1
    return ControlSlopes(
        np.array(of, dtype=np.int64), np.array(strips, dtype=np.int64), np.array(slopes).reshape(-1, rows)
    )


def panel_slopes(slopes: ControlSlopes, controls: int, lattices: Sequence[SurfaceLattice]) -> Array:
    """Slopes (controls, r) of all panels, numbered as rings, per unit deflection of each control."""
    out = np.zeros((controls, sum(lattice.rings for lattice in lattices)))
    strip0 = np.cumsum([0] + [lattice.spanwise for lattice in lattices])
    ring0 = np.cumsum([0] + [lattice.rings for lattice in lattices])
    for control, strip, slope in zip(slopes.control, slopes.strip, slopes.slope, strict=True):
        surface = int(np.searchsorted(strip0, strip, side="right")) - 1
        spanwise = lattices[surface].spanwise
        out[control, ring0[surface] + strip - strip0[surface] + spanwise * np.arange(slope.size)] += slope
    return out


def flap_effectiveness(chord_fraction: float) -> tuple[float, float]:
    """Lift and quarter-chord moment slope of a plain flap, 1/rad, by thin-airfoil theory (Glauert 1926)."""
    hinge = np.arccos(2.0 * chord_fraction - 1.0)  # x_h / c = (1 - cos theta_h) / 2
    lift = 2.0 * (np.pi - hinge + np.sin(hinge))
    return float(lift), float(-0.5 * np.sin(hinge) * (1.0 - np.cos(hinge)))


@cache
def _two_dimensional(rows: int) -> Array:
    """Lift and quarter-chord moment (2, rows), nose up, per slope of each panel of a strip, chord 1."""
    vortex = (np.arange(rows) + RING_FRONT) / rows
    point = (np.arange(rows) + CONTROL_POINT) / rows
    # w = gamma / (2 pi d) behind a vortex; the flow of speed 1 must follow the slope
    gamma = np.linalg.inv(1.0 / (2.0 * np.pi * (point[:, None] - vortex)))
    return np.stack([2.0 * gamma.sum(axis=0), 2.0 * ((0.25 - vortex) @ gamma)])


def flap_weights(rows: int, chord_fraction: float) -> Array:
    """Slopes (rows,) of a strip's panels per unit deflection of a plain flap, from the leading edge.

    See the module's own description.
    """
    hinge = 1.0 - chord_fraction
    share = np.clip((np.arange(1, rows + 1) / rows - hinge) * rows, 0.0, 1.0)
    wanted = np.array(flap_effectiveness(chord_fraction))
    moments = _two_dimensional(rows)
    kept = slice(0, 1 if rows == 1 else 2)
    off = wanted[kept] - moments[kept] @ share
    change = moments[kept].T @ np.linalg.solve(moments[kept] @ moments[kept].T, off)
    return np.asarray(share + change)
