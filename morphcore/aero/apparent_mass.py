"""Apparent mass: the air that a wing accelerates with itself, normal to its chord.

Thin-airfoil theory of a strip of semichord b (Bisplinghoff, Ashley & Halfman 1955, section 5-6, the
non-circulatory part of Theodorsen's result): with w the normal velocity of mid-chord relative to the air and
omega the pitch rate, the air carries the kinetic energy per length

    pi rho b^2 w^2 / 2 + pi rho b^4 / 8 omega^2 / 2

and opposes the rates of change of w and omega, in axes of the wing, with the gradients of it. The other
non-circulatory terms of the theory, those of rates themselves, are part of the lattice's steady loads.

Only the component normal to the wing is accelerated. So the apparent inertia of a piece of wing is a
symmetric 3 x 3 matrix that belongs to (omega_x, omega_y, v_z), not the inertia of a body, and has neither
weight nor momentum of its own along the wing.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from morphcore.geometry.aircraft import Aircraft, Flight
from morphcore.geometry.surface import Surface
from morphdata.faults import refuse
from morphdata.telescopes import apparent_mass_fault

Array = NDArray[np.float64]

# four points integrate b^4 and b^2 y^2 of a linear taper exactly
POINTS, WEIGHTS = np.polynomial.legendre.leggauss(4)
NORMAL_MOTION = (0, 1, 5)  # omega_x, omega_y, v_z among the rows of a twist


def refuse_apparent_mass(aircraft: Aircraft, flight: Flight) -> None:
    """Refuse the apparent mass of surfaces that telescope: it would have to follow their visible span.

    Raises
    ------
    InvalidInput : the flight has apparent mass, and a surface telescopes.
    """
    names = (surface.name for surface in aircraft.surfaces if surface.mouth_m is not None)
    refuse(map(apparent_mass_fault, names if flight.apparent_mass else ()))


def apparent_inertia(
    surface: Surface, density_kg_m3: float, start: Array, end: Array, origin: Array
) -> Array:
    """Apparent inertia of pieces of a surface.

    Parameters
    ----------
    surface : Surface
    density_kg_m3 : float
        Of the air.
    start, end, origin : ndarray, shape (...)
        Ends of each piece and the point on the elastic axis where its motion is given, distances from the
        root, m.

    Returns
    -------
    ndarray, shape (..., 3, 3)
        On (omega_x, omega_y, v_z) in the axes of the wing W, kg m^2, kg m and kg.
    """
    length = (end - start)[..., None]
    distance = start[..., None] + length * 0.5 * (POINTS + 1.0)
    weight = np.pi * density_kg_m3 * 0.5 * length * WEIGHTS
    across = surface.chord_W[0]  # theory holds in planes across a swept wing's axis
    semichord = 0.5 * across * np.asarray(surface.chord_at(distance.ravel())).reshape(distance.shape)
    mass = weight * semichord**2
    own = weight * semichord**4 / 8.0
    x, aside = -surface.elastic_axis_W[:2]  # of mid-chord from the elastic axis
    y = surface.span_sign * (distance - origin[..., None]) + aside
    # w = v_z + y omega_x - x omega_y
    motion = np.stack([y, np.full_like(y, -x), np.ones_like(y)], axis=-1)
    found = np.einsum("...q,...qi,...qj->...ij", mass, motion, motion)
    found[..., 1, 1] += own.sum(-1)
    return np.asarray(found)


def spatial(normal: Array) -> Array:
    """The same as matrices (..., 6, 6) that belong to a whole twist."""
    out = np.zeros((*normal.shape[:-2], 6, 6))
    out[..., np.ix_(NORMAL_MOTION, NORMAL_MOTION)[0], np.ix_(NORMAL_MOTION, NORMAL_MOTION)[1]] = normal
    return out


def share_of_mass(surface: Surface, density_kg_m3: float) -> float:
    """Apparent mass of a surface over its own mass."""
    middles = surface.length_m * (np.arange(100) + 0.5) / 100
    semichord = 0.5 * surface.chord_W[0] * np.asarray(surface.chord_at(middles))
    apparent = np.pi * density_kg_m3 * semichord**2
    return float(apparent.sum() / surface.section_at(middles).mass.sum())
