"""Quadrature along a surface's span, piece by piece between its stations, where properties have kinks."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from morphcore.geometry.surface import Surface

Array = NDArray[np.float64]


def span_points(surface: Surface, ends: Array, points: Array, weights: Array) -> tuple[Array, Array]:
    """Stations and weights of Gauss's rule on each segment, applied to each of its smooth pieces.

    Parameters
    ----------
    ends : ndarray, shape (..., n + 1)
        Ends of n segments, increasing distances from the root, m.
    points, weights : ndarray, shape (g,)
        Of the rule on -1..1.

    Returns
    -------
    stations : ndarray, shape (..., n, g k)
        Distances from the root, m, for k pieces of the surface.
    weight : ndarray, shape (..., n, g k)
        Length that each stands for, m; 0 in pieces outside the segment.
    """
    breaks = surface.breaks_m
    if breaks.size == 2:
        start, length = ends[..., :-1, None], np.diff(ends, axis=-1)[..., None]
        return start + length * 0.5 * (points + 1), 0.5 * length * weights
    low = np.maximum(ends[..., :-1, None], breaks[:-1])
    high = np.minimum(ends[..., 1:, None], breaks[1:])
    length = np.maximum(high - low, 0.0)[..., None]
    low = np.minimum(low, surface.length_m)[..., None]
    stations, weight = low + length * 0.5 * (points + 1), 0.5 * length * weights
    whole = (*stations.shape[:-2], -1)
    return stations.reshape(whole), np.broadcast_to(weight, stations.shape).reshape(whole)
