"""Mirror symmetry of an aircraft about its x-z plane: which surfaces are images of each other.

A symmetric aircraft whose hinges move alike flies straight ahead, and both halves move alike. Then only one
half is computed, without loss of accuracy (models/equivalent.py).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from morphcore.geometry.aircraft import Aircraft, Flight, Fuselage
from morphcore.geometry.surface import Surface
from morphdata.pairs import paired_by_reflection

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Mirror:
    """Indices of an aircraft's surfaces: ``own`` of one half, ``image`` of their images in the same order.

    ``own_hinges`` and ``image_hinges`` are indices of their hinges among all hinges of the aircraft, and
    ``own_controls`` and ``image_controls`` those of their controls among all controls.
    """

    own: tuple[int, ...]
    image: tuple[int, ...]
    own_hinges: tuple[int, ...]
    image_hinges: tuple[int, ...]
    own_controls: tuple[int, ...] = ()
    image_controls: tuple[int, ...] = ()

    def spread(self, values: Array) -> Array:
        """Columns (k, s) of all surfaces from those of one half, (k, s / 2), when both sides move alike."""
        return _spread(values, self.own, self.image)

    def spread_hinges(self, values: Array) -> Array:
        """Columns (k, h) of all hinges from those of one half, (k, h / 2), when both sides move alike."""
        return _spread(values, self.own_hinges, self.image_hinges)


def _spread(values: Array, own: tuple[int, ...], image: tuple[int, ...]) -> Array:
    out = np.empty((values.shape[0], 2 * values.shape[1]))
    out[:, own] = out[:, image] = values
    return out


def mirror_groups(surfaces: Sequence[Surface]) -> tuple[tuple[int, ...], ...]:
    """Indices of the surfaces by mirror pair, in order of first appearance.

    Parameters
    ----------
    surfaces : sequence of Surface
        Two surfaces are a pair if all values of one are the mirrored values of the other.

    Returns
    -------
    tuple of tuples of int
        Groups (first, image) and (first,); every surface is in exactly one.
    """
    nameless = [replace(surface, name="") for surface in surfaces]
    return paired_by_reflection(nameless, [_reflection(surface) for surface in nameless])


def mirror_of(aircraft: Aircraft, flight: Flight) -> Mirror | None:
    """The symmetry of an aircraft in a flight condition; None if anything differs.

    Wind does not matter: uniform wind carries the aircraft along.
    """
    groups = mirror_groups(aircraft.surfaces)
    paired = all(len(group) > 1 for group in groups)
    if not (paired and _is_symmetric(aircraft.fuselage) and _starts_straight(flight)):
        return None
    if aircraft.propulsion is not None and not aircraft.propulsion.is_symmetric:
        return None
    own, image = (tuple(group[side] for group in groups) for side in (0, 1))
    columns = aircraft.hinge_columns
    first = np.cumsum([0, *(len(surface.controls) for surface in aircraft.surfaces)]).tolist()
    return Mirror(
        own,
        image,
        *(
            tuple(k for number in side for k in range(columns[number].start, columns[number].stop))
            for side in (own, image)
        ),
        *(
            tuple(k for number in side for k in range(first[number], first[number + 1]))
            for side in (own, image)
        ),
    )


def _reflection(surface: Surface) -> Surface:
    """The surface mirrored to the other side; hinge angles are the same on both sides."""
    x, y, z = surface.position_m
    return replace(
        surface,
        side="left" if surface.side == "right" else "right",
        position_m=(x, -y, z),
        hinges=tuple(hinge.reflection for hinge in surface.hinges),
        point_masses=tuple(sorted(mass.reflection for mass in surface.point_masses)),
    )


def _is_symmetric(fuselage: Fuselage) -> bool:
    ixy, iyz = fuselage.inertia_B[0, 1], fuselage.inertia_B[1, 2]
    return bool(fuselage.centre_of_mass_B[1] == ixy == iyz == 0.0)


def _starts_straight(flight: Flight) -> bool:
    if flight.banks:
        return False
    start = flight.start
    return start is None or bool(
        start.force_B[1] == start.moment_B[0] == start.moment_B[2] == start.bank_rad == 0.0
    )
