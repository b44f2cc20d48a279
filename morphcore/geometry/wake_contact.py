"""Surfaces that lie in the wake of others, where loads depend on exactly where the wake passes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from morphcore.geometry.aircraft import Aircraft
from morphcore.geometry.lattice import chord_points, surface_pose

Array = NDArray[np.float64]

LEGS, POINTS = 33, 9  # along the span: of a trailing edge, and of the surface behind it


def surfaces_in_wakes(
    aircraft: Aircraft, angles: Array, alpha_rad: float, sideslip_rad: float = 0.0
) -> list[tuple[int, int, float]]:
    """Pairs of surfaces of which the second lies behind the first, and how near to its wake it comes.

    Parameters
    ----------
    angles : ndarray, shape (h,)
        Of all hinges, rad.
    alpha_rad, sideslip_rad : float
        Angles of the stream, along which the wake leaves.

    Returns
    -------
    list of (int, int, float)
        Number of the surface ahead, of the one at least a chord behind it, and the least distance from the
        wake over the mean chord of the surface ahead.
    """
    ahead, aside = np.cos(sideslip_rad), np.sin(sideslip_rad)
    stream = -np.array([ahead * np.cos(alpha_rad), aside, ahead * np.sin(alpha_rad)])
    edges, points = [], []
    for surface, own in zip(aircraft.surfaces, aircraft.hinge_columns, strict=True):
        R_BW, r_B = surface_pose(surface, angles[own])
        along = surface.length_m * np.linspace(0.0, 1.0, LEGS)
        edges.append(chord_points(surface, np.ones(1), along)[0] @ R_BW.T + r_B)
        every = chord_points(surface, np.linspace(0.0, 1.0, 3), along[:: (LEGS - 1) // (POINTS - 1)])
        points.append(every.reshape(-1, 3) @ R_BW.T + r_B)
    found = []
    for first, surface in enumerate(aircraft.surfaces):
        chord = surface.mean_chord_m
        for second in range(len(aircraft.surfaces)):
            arm = points[second][:, None] - edges[first]
            behind = arm @ stream
            across = np.linalg.norm(arm - behind[..., None] * stream, axis=2)
            near = np.where(behind > chord, across, np.inf).min()
            if second != first and np.isfinite(near):
                found.append((first, second, float(near) / chord))
    return found
