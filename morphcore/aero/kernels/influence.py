"""Velocities induced by all vortex rings of a lattice and by their straight wake.

Every edge of the lattice is computed once and added to the one or two rings it belongs to. The last row's aft
edge and the wake's first edge cancel exactly and are omitted: a ring of the last row with its wake is a
horseshoe of three edges and two legs. The point index is innermost and contiguous.
"""

from __future__ import annotations

from morphcore.aero.kernels.vortex import (
    leg_velocity,
    segment_velocity,
    smoothed_leg_velocity,
    smoothed_segment_velocity,
)
from morphcore.jit import entry_kernel, kernel


@entry_kernel
def ring_influence(
    points,
    corners,
    edge_start,
    edge_end,
    edge_plus,
    edge_minus,
    edge_core,
    leg_start,
    leg_plus,
    leg_minus,
    leg_core,
    leg_width,
    leg_chord,
    smoothed,
    wake,
    scratch,
    out,
) -> None:
    """Induced velocity of every ring of unit circulation, wake included, at every point.

    Parameters (p points, c corners, e edges, l legs, r rings)
    ----------
    points : (3, p) m. corners : (c, 3) ring corners, m.
    edge_start, edge_end : (e,) corner indices. edge_core : (e,) core radius, m.
    edge_plus, edge_minus : (e,) ring whose circulation runs along the edge, and ring whose circulation runs
    against it; -1 for none.
    leg_start : (l,) corner index on the trailing edge; leg_plus, leg_minus, leg_core : (l,) as for edges.
    leg_width, leg_chord : (l,) width of the strips beside a leg and mean chord, m: see `vortex.grown_core`.
    smoothed : True for the core law "smoothed", False for "line".
    wake : (3,) unit vector of the free stream. scratch : (3, p).
    out : (3, r, p) velocity, 1/m.
    """
    count = points.shape[1]
    out[:] = 0.0
    x, y, z = points[0], points[1], points[2]
    u, v, w = scratch[0], scratch[1], scratch[2]
    # bound edges
    for edge in range(edge_start.size):
        start, end = edge_start[edge], edge_end[edge]
        px, py, pz = corners[start, 0], corners[start, 1], corners[start, 2]
        ex, ey, ez = corners[end, 0] - px, corners[end, 1] - py, corners[end, 2] - pz
        # the law is chosen outside the loops over the points, to keep them free of branches
        if smoothed:
            core2 = edge_core[edge] ** 2
            for p in range(count):
                u[p], v[p], w[p] = smoothed_segment_velocity(
                    px - x[p], py - y[p], pz - z[p], ex, ey, ez, core2
                )
        else:
            core4 = edge_core[edge] ** 4
            for p in range(count):
                u[p], v[p], w[p] = segment_velocity(px - x[p], py - y[p], pz - z[p], ex, ey, ez, core4)
        _gather(scratch, edge_plus[edge], edge_minus[edge], out)
    # wake legs
    ux, uy, uz = wake[0], wake[1], wake[2]
    for leg in range(leg_start.size):
        start = leg_start[leg]
        px, py, pz = corners[start, 0], corners[start, 1], corners[start, 2]
        if smoothed:
            core2 = leg_core[leg] ** 2
            for p in range(count):
                u[p], v[p], w[p] = smoothed_leg_velocity(px - x[p], py - y[p], pz - z[p], ux, uy, uz, core2)
        else:
            core4, width4, chord2 = leg_core[leg] ** 4, leg_width[leg] ** 4, leg_chord[leg] ** 2
            for p in range(count):
                u[p], v[p], w[p] = leg_velocity(
                    px - x[p], py - y[p], pz - z[p], ux, uy, uz, core4, width4, chord2
                )
        _gather(scratch, leg_plus[leg], leg_minus[leg], out)


@kernel
def _gather(velocity, plus, minus, out):
    """Add one edge's velocities (3, p) to the ring along it, subtract them from the ring against it."""
    for axis in range(3):
        source = velocity[axis]
        if plus >= 0:
            target = out[axis, plus]
            for p in range(source.size):
                target[p] += source[p]
        if minus >= 0:
            target = out[axis, minus]
            for p in range(source.size):
                target[p] -= source[p]
