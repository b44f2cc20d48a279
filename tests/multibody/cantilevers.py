"""Beams for tests: straight and bent cantilevers along y, rooted at the origin."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from morphcore.multibody.beam import Beams, NodePoses, Section, make_beams


@dataclass(frozen=True)
class Box:
    """A solid box c x t (m) of an isotropic material; E in Pa, rho in kg/m^3."""

    length: float = 3.0
    chord: float = 0.3
    thickness: float = 0.1
    modulus: float = 2.1e9
    poisson: float = 0.3
    density: float = 500.0

    @property
    def area(self) -> float:
        """m^2."""
        return self.chord * self.thickness

    @property
    def shear(self) -> float:
        """Shear stiffness 5/6 G A, N."""
        return 5.0 / 6.0 * self.modulus / (2.0 * (1.0 + self.poisson)) * self.area

    @property
    def ei_flap(self) -> float:
        """N m^2."""
        return self.modulus * self.chord * self.thickness**3 / 12.0

    @property
    def gj(self) -> float:
        """N m^2, with 0.2633 c t^3 of the 3:1 rectangle."""
        return self.modulus / (2.0 * (1.0 + self.poisson)) * 0.2633 * self.chord * self.thickness**3

    def section(self) -> Section:
        """Stiffness and mass about the middle."""
        axial = self.modulus * self.area
        lag = self.modulus * self.thickness * self.chord**3 / 12.0
        mass = self.density * self.area
        inertia = (
            mass / 12.0 * np.array([self.thickness**2, self.chord**2 + self.thickness**2, self.chord**2])
        )
        return Section(
            np.diag([self.ei_flap, self.gj, lag, self.shear, axial, self.shear]),
            np.diag([*inertia, mass, mass, mass]),
        )


def straight(
    section: Section, length: float, elements: int, damping_s: float = 0.0
) -> tuple[Beams, NodePoses]:
    """A straight beam at rest."""
    return bent(section, [0.0, 0.0, 0.0, 0.0, length, 0.0], elements, damping_s)


def bent(
    section: Section, whole: list[float], elements: int, damping_s: float = 0.0
) -> tuple[Beams, NodePoses]:
    """A beam at rest along the helix exp(s whole), s in 0..1."""
    rest = np.tile(np.array(whole) / elements, (elements, 1))
    ends = np.stack([np.arange(elements), np.arange(1, elements + 1)], axis=1)
    beams = make_beams(ends, rest, [[section] * 3] * elements, damping_s)
    poses = NodePoses(np.tile(np.eye(3), (elements + 1, 1, 1)), np.zeros((elements + 1, 3)))
    poses.move(np.linspace(0.0, 1.0, elements + 1)[:, None] * np.array(whole))
    return beams, poses
