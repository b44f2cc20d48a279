"""Loads of the lifting surfaces along a flight: at their roots, of the air, and of their sections."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from morphcore.geometry.lattice import SurfaceLattice
from morphcore.geometry.mirror import Mirror

Array = NDArray[np.float64]

REFLECTED_FORCE = np.array([1.0, -1.0, 1.0])  # of the mirror image, in body or wing axes
REFLECTED_WRENCH = np.concatenate([-REFLECTED_FORCE, REFLECTED_FORCE])  # moment first


@dataclass(frozen=True)
class SurfaceLoads:
    """Loads at k times (s surfaces).

    root_W : (k, s, 6) moment and force that the fuselage, through the hinges, exerts on each surface at the
    root of its elastic axis, in W, N m and N. air_B : (k, s, 3) force of the air, apparent mass included, in
    B, N. section_lift, section_cl : for each surface (k, strips) lift per length of span, N/m, and lift
    coefficient of its strips, from the root.
    """

    root_W: Array
    air_B: Array
    section_lift: tuple[Array, ...]
    section_cl: tuple[Array, ...]

    def of_both_halves(self, mirror: Mirror) -> SurfaceLoads:
        """Loads of the whole aircraft from those of the half that was flown, when both move alike."""
        count = 2 * len(mirror.own)
        root_W, air_B = np.empty((self.root_W.shape[0], count, 6)), np.empty((self.air_B.shape[0], count, 3))
        root_W[:, mirror.own], root_W[:, mirror.image] = self.root_W, REFLECTED_WRENCH * self.root_W
        air_B[:, mirror.own], air_B[:, mirror.image] = self.air_B, REFLECTED_FORCE * self.air_B
        place = np.argsort([*mirror.own, *mirror.image])
        lift, cl = (tuple((2 * values)[k] for k in place) for values in (self.section_lift, self.section_cl))
        return SurfaceLoads(root_W, air_B, lift, cl)


def section_loads(
    lattices: Sequence[SurfaceLattice], circulation: Array, velocity: Array, density: float
) -> tuple[tuple[Array, ...], tuple[Array, ...]]:
    """Lift per length of span, N/m, and lift coefficient of all strips, by surface.

    By Kutta and Joukowski the lift is density times speed times circulation, normal to the motion of the
    section; the span is measured across the chords.

    Parameters
    ----------
    circulation : ndarray, shape (k, strips)
        Bound circulation of the strips of all surfaces, m^2/s, positive for lift towards -z of W.
    velocity : ndarray, shape (k, strips, 2)
        Of the sections through the air, in their own planes, m/s.
    density : float
        kg/m^3.
    """
    speed = np.hypot(velocity[..., 0], velocity[..., 1])
    lift, coefficient, first = [], [], 0
    for part in lattices:
        own = slice(first, first + part.spanwise)
        lift.append(density * speed[:, own] * circulation[:, own])
        swept = speed[:, own] * part.strip_chord_m
        none = np.zeros_like(swept)  # where nothing moves through the air
        coefficient.append(np.divide(2.0 * circulation[:, own], swept, out=none, where=swept > 0.0))
        first = own.stop
    return tuple(lift), tuple(coefficient)
