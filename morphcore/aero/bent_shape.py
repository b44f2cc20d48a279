"""Bent surfaces on which a lattice is tabulated: straight pieces, as the links of a chain in trim lie."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from morphcore.geometry.lattice import SurfaceLattice

Array = NDArray[np.float64]


@dataclass(frozen=True)
class BentSurface:
    """A bent surface of n pieces in its own axes W, relative to its root on the elastic axis.

    edges_m : (n + 1,) distances of the pieces' ends from the root along the axis. R_WL : (n, 3, 3) piece to
    wing components. r_W : (n, 3) inner ends, m. sign : of the span.
    """

    edges_m: Array
    R_WL: Array
    r_W: Array
    sign: float

    @cached_property
    def tip_W(self) -> Array:
        """(3,) the tip relative to the root, m."""
        return np.asarray(self._axis(self.edges_m[-1:])[0])

    def placed(self, part: SurfaceLattice, axis_W: Array) -> tuple[Array, Array, Array]:
        """Put a lattice on the bent surface.

        Corners ride on the piece of their strip's edge, so that a strip with a joint in it is bent; its
        control points lie midway, on axes that are the mean of both pieces' by its widths on them.

        Parameters
        ----------
        part : of the unbent surface. axis_W : (3,) the elastic axis at the root, in W.

        Returns
        -------
        ring_corners_W, control_points_W : as of the lattice. R_WS : (spanwise, 3, 3) of its strips.
        """
        edges = part.strip_edges_m
        shares = self._shares(edges)
        R_strip = _rotations(np.einsum("jn,nab->jab", shares, self.R_WL))
        R_edge = self.R_WL[self._piece(edges)]
        at_edge = self._axis(edges)
        at_middle = 0.5 * (at_edge[1:] + at_edge[:-1])
        along = np.zeros((edges.size, 3))
        along[:, 1] = part.span_sign * edges
        middle = 0.5 * (along[1:] + along[:-1])
        return (
            axis_W + at_edge + np.einsum("jab,ijb->ija", R_edge, part.ring_corners_W - axis_W - along),
            axis_W + at_middle + np.einsum("jab,ijb->ija", R_strip, part.control_points_W - axis_W - middle),
            R_strip,
        )

    def _shares(self, edges: Array) -> Array:
        """(strips, n) share of each strip's width on each piece."""
        low = np.maximum(edges[:-1, None], self.edges_m[:-1])
        high = np.minimum(edges[1:, None], self.edges_m[1:])
        width = np.clip(high - low, 0.0, None)
        return np.asarray(width / width.sum(axis=1, keepdims=True))

    def _piece(self, distance_m: Array) -> NDArray[np.int64]:
        """Number of the piece at distances (k,) from the root, m."""
        return np.clip(np.searchsorted(self.edges_m, distance_m, "right") - 1, 0, len(self.R_WL) - 1)

    def _axis(self, distance_m: Array) -> Array:
        """Points (k, 3) of the elastic axis at distances from the root, m."""
        piece = self._piece(distance_m)
        beyond = self.sign * (distance_m - self.edges_m[piece])
        return np.asarray(self.r_W[piece] + self.R_WL[piece][:, :, 1] * beyond[:, None])


BentShape = tuple[BentSurface | None, ...]  # of all surfaces; None: straight


def largest_change(before: BentShape, after: BentShape) -> float:
    """Largest change of an axis' component, or of a place along the surface in lengths of it."""
    changes = [0.0]
    for one, other in zip(before, after, strict=True):
        if one is not None and other is not None:
            changes.append(float(np.abs(other.R_WL - one.R_WL).max()))
            changes.append(float(np.abs(other.r_W - one.r_W).max() / one.edges_m[-1]))
    return max(changes)


def _rotations(mean: Array) -> Array:
    """Rotations (k, 3, 3) nearest to means of rotations, by their polar decomposition."""
    left, _, right = np.linalg.svd(mean)
    return np.asarray(left @ right)
