"""Quadrature along a surface's span, piece by piece between its stations, where properties have kinks."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from morphcore.geometry.surface import Surface

Array = NDArray[np.float64]


def span_points(surface: Surface, ends: Array, points: Array, weights: Array) -> tuple[Array, Array, Array]:
    """Stations of Gauss's rule on each segment, applied to each of its smooth pieces.

    An integral is the sum over the last axis of ``value * 0.5 * length * weight``.

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
    length : ndarray, shape (..., n, g k) or (..., n, 1)
        Of the piece that each lies on, m; 0 in pieces outside the segment.
    weight : ndarray, shape (g k,)
        Of the rule.
    """
    breaks = surface.breaks_m
    if breaks.size == 2:
        start, length = ends[..., :-1, None], np.diff(ends, axis=-1)[..., None]
        return start + length * 0.5 * (points + 1), length, weights
    low = np.minimum(np.maximum(ends[..., :-1, None], breaks[:-1]), surface.length_m)
    high = np.minimum(ends[..., 1:, None], breaks[1:])
    length = np.maximum(high - low, 0.0)[..., None]
    stations = low[..., None] + length * 0.5 * (points + 1)
    whole = (*stations.shape[:-2], -1)
    every = np.broadcast_to(length, stations.shape)
    return stations.reshape(whole), every.reshape(whole), np.tile(weights, breaks.size - 1)
