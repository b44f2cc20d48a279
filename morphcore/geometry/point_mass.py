"""Point masses: on the fuselage part of its rigid body, on a surface carried by what is there of it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from morphcore.frames import skew
from morphdata import masses as documents
from morphdata.inertia import Matrix3, inertia_matrix

Array = NDArray[np.float64]
Body = tuple[float, Sequence[float], Matrix3]  # mass, centre, inertia about it


@dataclass(frozen=True, order=True)
class PointMass:
    """A mass on a surface.

    at : share of the span. aft_m, up_m : of mid-chord there, along the surface's own axes. inertia : its nine
    elements row by row, kg m^2, about its own centre in W.
    """

    at: float
    mass_kg: float
    aft_m: float
    up_m: float
    inertia: tuple[float, ...]

    @property
    def reflection(self) -> PointMass:
        """The same on the surface's mirror image: products of inertia with y change their sign."""
        xx, xy, xz, yx, yy, yz, zx, zy, zz = self.inertia
        return replace(self, inertia=(xx, -xy, xz, -yx, yy, -yz, zx, -zy, zz))

    def inertia_about(self, arm: Array) -> Array:
        """Spatial inertia (6, 6) about a point from which the mass's centre lies at ``arm`` (3,), m, in W.

        Featherstone (2008), equation 2.63.
        """
        c = skew(arm)
        out = np.zeros((6, 6))
        out[:3, :3] = np.array(self.inertia).reshape(3, 3) + self.mass_kg * c @ c.T
        out[:3, 3:] = self.mass_kg * c
        out[3:, :3] = self.mass_kg * c.T
        out[3:, 3:] = self.mass_kg * np.eye(3)
        return out


def masses_on(surface: str, masses: Sequence[documents.PointMass]) -> tuple[PointMass, ...]:
    """The masses that a surface carries, sorted, so that their order in a document does not matter."""
    found = []
    for mass in masses:
        if mass.surface == surface and mass.at is not None:
            aft, up = mass.offset_m or [0.0, 0.0]
            rows = inertia_matrix(mass.inertia_kg_m2 or [0.0, 0.0, 0.0])
            inertia = tuple(float(term) for row in rows for term in row)
            found.append(PointMass(mass.at, mass.mass_kg, aft, up, inertia))
    return tuple(sorted(found))


def rigid_body(bodies: Sequence[Body]) -> tuple[float, list[float], Array]:
    """Mass (kg), centre of mass (m) and inertia (3, 3) about it of several bodies together.

    Sums are rounded once (`math.fsum`): bodies that are mirror images leave exact zeros, by which a symmetric
    aircraft is known.
    """
    mass_kg = math.fsum(m for m, _, _ in bodies)
    centre = [math.fsum(m * at[i] for m, at, _ in bodies) / mass_kg for i in range(3)]
    inertia = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            terms = []
            for m, at, own in bodies:
                arm = [x - c for x, c in zip(at, centre, strict=True)]
                steiner = sum(x * x for x in arm) if i == j else 0.0
                terms += [own[i][j], m * (steiner - arm[i] * arm[j])]
            inertia[i, j] = math.fsum(terms)
    return mass_kg, centre, inertia
