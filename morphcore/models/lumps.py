"""Point masses in the models: shared by the links next to them, and placed on the elements of beams.

A mass near a joint would jump from one link to the next when a search moves the joint past it, and with it,
if it lies off the axis, the model's inertia. So within a short stretch about each joint a mass is shared by
both links, each with its own rigid arm to the same place. The shares sum to one: on the undeformed aircraft
mass, centre and inertia are exact for every division, and they are smooth in the division lengths.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from morphcore.frames import skew
from morphcore.geometry.surface import Surface
from morphcore.multibody.beam import GAUSS

Array = NDArray[np.float64]

STRETCH = 0.01  # of the span, either way of a joint: where the links on both sides share a mass
FLAT_ROWS = 7  # m, m x, m y, Ixx, Iyy, Izz, Ixy: what a flat link has, too
LUMP_ROWS = 10  # then m z, Ixz, Iyz
RIDES = np.concatenate([[0.0], GAUSS, [1.0]])  # places of an element that carry mass: its ends are nodes


def link_lumps(surface: Surface, edges: Array) -> Array:
    """Mass properties (particles, n, 10) of the point masses on each link, about its origin.

    Parameters
    ----------
    edges : ndarray, shape (particles, n + 1)
        Ends of the links, distances from the root, m.

    Returns
    -------
    ndarray, shape (particles, n, 10)
        Mass (kg), first moments m x and m y (kg m), elements xx, yy, zz, xy of the inertia matrix (kg m^2);
        then m z, xz and yz.
    """
    out = np.zeros((*edges[:, 1:].shape, LUMP_ROWS))
    for mass in surface.point_masses:
        share = link_shares(edges, mass.at * surface.length_m, STRETCH * surface.length_m)
        x, from_root, z = surface.point_mass_arm_W(mass)
        y = from_root - surface.span_sign * edges[:, :-1]
        m, (xx, xy, xz, _, yy, yz, _, _, zz) = mass.mass_kg, mass.inertia
        rows = [
            m + 0.0 * y,
            m * x + 0.0 * y,
            m * y,
            xx + m * (y**2 + z**2),
            yy + m * (x**2 + z**2) + 0.0 * y,
            zz + m * (x**2 + y**2),
            xy - m * x * y,
            m * z + 0.0 * y,
            xz - m * x * z + 0.0 * y,
            yz - m * y * z,
        ]
        out += share[..., None] * np.stack(rows, axis=-1)
    return out


def link_shares(edges: Array, distance_m: float, stretch_m: float) -> Array:
    """Share (particles, n) of a mass at a distance from the root that rides on each link; rows sum to one."""
    off = np.clip((edges[:, 1:-1] - distance_m) / stretch_m, -1.0, 1.0)
    inside = (
        0.5 + 0.75 * off - 0.25 * off**3
    )  # of the mass, inboard of each joint: rises smoothly from 0 to 1
    none, every = np.zeros((edges.shape[0], 1)), np.ones((edges.shape[0], 1))
    return np.asarray(np.diff(np.concatenate([none, inside, every], axis=1), axis=1))


def surface_lumps(surface: Surface) -> Array:
    """Spatial inertia (6, 6) of all point masses of an unbent surface about its root node, in W."""
    total = np.zeros((6, 6))
    for mass in surface.point_masses:
        total += mass.inertia_about(surface.point_mass_arm_W(mass))
    return total


def beam_lumps(surface: Surface, elements: int) -> tuple[Array, Array]:
    """Point masses on equal elements: on the elements' Gauss points, and on the nodes.

    A mass rides on the two of `RIDES` next to it in proportion to its nearness, with rigid arms from both.
    What that leaves out of the bend between them is of the order of h^2 / 50 times the curvature.

    Returns
    -------
    on_points : ndarray, shape (e, 3, 6, 6)
        Spatial inertia in the axes of each Gauss point, on the elastic axis.
    on_nodes : ndarray, shape (e + 1, 6, 6)
        Likewise of each node from the root. Without elements, both are empty: see `surface_lumps`.
    """
    on_points = np.zeros((elements, GAUSS.size, 6, 6))
    on_nodes = np.zeros((elements + 1, 6, 6))
    for mass in surface.point_masses if elements else ():
        place = mass.at * elements
        e = min(int(place), elements - 1)
        right = int(np.clip(np.searchsorted(RIDES, place - e), 1, RIDES.size - 1))
        part = (place - e - RIDES[right - 1]) / (RIDES[right] - RIDES[right - 1])
        for ride, share in ((right - 1, 1.0 - part), (right, part)):
            at_m = (e + RIDES[ride]) * surface.length_m / elements
            lump = share * mass.inertia_about(surface.point_mass_arm_W(mass, at_m))
            if ride in (0, RIDES.size - 1):
                on_nodes[e + (ride > 0)] += lump
            else:
                on_points[e, ride - 1] += lump
    return on_points, on_nodes


def moved_inertia(inertia: Array, arm: Array) -> Array:
    """Spatial inertia (..., 6, 6) about a point from which the former one lies at ``arm`` (..., 3), m.

    Featherstone (2008), equation 2.66.
    """
    X = np.zeros((*arm.shape[:-1], 6, 6))
    X[..., np.arange(6), np.arange(6)] = 1.0
    for at in np.ndindex(arm.shape[:-1]):
        X[(*at, slice(3, 6), slice(0, 3))] = -skew(arm[at])
    return np.asarray(np.swapaxes(X, -1, -2) @ inertia @ X)
