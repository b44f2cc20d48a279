"""Mirror symmetry of an aircraft about its x-z plane: which surfaces are each other's image.

A symmetric aircraft whose hinges move alike flies straight on: its left half does what its right half does.
Then one half is flown, which stands for both (models/equivalent.py), and nothing is lost.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from morphcore.geometry.aircraft import Aircraft, Flight, Fuselage
from morphcore.geometry.surface import Surface
from morphdata.vehicle import paired_by_reflection

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Mirror:
    """Indices of an aircraft's surfaces: ``own`` of one half, ``image`` of their images in the same order."""

    own: tuple[int, ...]
    image: tuple[int, ...]

    def spread(self, values: Array) -> Array:
        """Columns (k, s) of all surfaces from those of one half, (k, s / 2), where both sides are alike."""
        out = np.empty((values.shape[0], 2 * values.shape[1]))
        out[:, self.own] = out[:, self.image] = values
        return out


def mirror_groups(surfaces: Sequence[Surface]) -> tuple[tuple[int, ...], ...]:
    """Indices of the surfaces by mirror pair, in order of first appearance.

    Parameters
    ----------
    surfaces : sequence of Surface
        Two are a pair if all values of one are those of the other, mirrored.

    Returns
    -------
    tuple of tuples of int
        Groups (first, image) and (first,): every surface is in one of them.
    """
    nameless = [replace(surface, name="") for surface in surfaces]
    return paired_by_reflection(nameless, [_reflection(surface) for surface in nameless])


def mirror_of(aircraft: Aircraft, flight: Flight) -> Mirror | None:
    """The symmetry of an aircraft in a flight condition; None where anything differs at all.

    Wind does not count: a uniform one carries the aircraft along.
    """
    groups = mirror_groups(aircraft.surfaces)
    paired = all(len(group) > 1 for group in groups)
    if not (paired and _is_symmetric(aircraft.fuselage) and _starts_straight(flight)):
        return None
    return Mirror(tuple(group[0] for group in groups), tuple(group[1] for group in groups))


def _reflection(surface: Surface) -> Surface:
    """The surface on the other side; hinge coordinates are alike on both sides."""
    (x, y, z), hinge = surface.position_m, surface.hinge
    if hinge is not None:
        forward, right, down = hinge.position_m
        hinge = hinge.model_copy(update={"position_m": [forward, -right, down]})
    return replace(
        surface, side="left" if surface.side == "right" else "right", position_m=(x, -y, z), hinge=hinge
    )


def _is_symmetric(fuselage: Fuselage) -> bool:
    ixy, iyz = fuselage.inertia_B[0, 1], fuselage.inertia_B[1, 2]
    return bool(fuselage.centre_of_mass_B[1] == ixy == iyz == 0.0)


def _starts_straight(flight: Flight) -> bool:
    start = flight.start
    return start is None or bool(start.force_B[1] == start.moment_B[0] == start.moment_B[2] == 0.0)
