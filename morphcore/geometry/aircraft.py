"""The aircraft and its flight condition with all defaults resolved, in the form used by the numerics."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from morphcore.geometry.control import Control
from morphcore.geometry.hinge import Hinge
from morphcore.geometry.point_mass import masses_on, rigid_body
from morphcore.geometry.propulsion import Propulsion
from morphcore.geometry.surface import Surface
from morphcore.shown import Shown
from morphdata import aircraft as documents
from morphdata.controls import control_drives, control_names
from morphdata.drives import Drive, drives_of
from morphdata.flight import Flight as FlightDocument
from morphdata.flight import load_factor
from morphdata.inertia import inertia_matrix
from morphdata.masses import PointMass
from morphdata.trim_drives import NO_NAMES

Array = NDArray[np.float64]


@dataclass(frozen=True, repr=False)
class Fuselage(Shown):
    """A rigid body without aerodynamic force.

    ``centre_of_mass_B`` in m from the reference point; ``inertia_B`` (3, 3) in kg m^2 about the centre of
    mass.
    """

    mass_kg: float
    inertia_B: Array
    centre_of_mass_B: Array

    @classmethod
    def of(cls, document: documents.Fuselage) -> Fuselage:
        """Return the body that a document describes: a box of uniform density, or explicit numbers."""
        centre = _vector(document.centre_of_mass_m or [0.0, 0.0, 0.0])
        if document.mass_kg is not None and document.inertia_kg_m2 is not None:
            return cls(document.mass_kg, np.array(inertia_matrix(document.inertia_kg_m2)), centre)
        lx, ly, lz, density = (float(getattr(document, name)) for name in documents.BOX)
        mass = density * lx * ly * lz
        inertia = np.diag([ly**2 + lz**2, lx**2 + lz**2, lx**2 + ly**2]) * mass / 12
        return cls(mass, inertia, centre)

    def carrying(self, masses: Sequence[PointMass]) -> Fuselage:
        """The body together with those of some point masses that sit on it."""
        bodies = [
            (mass.mass_kg, mass.position_m, inertia_matrix(mass.inertia_kg_m2 or [0.0, 0.0, 0.0]))
            for mass in masses
            if mass.position_m is not None
        ]
        if not bodies:
            return self
        own = (self.mass_kg, self.centre_of_mass_B.tolist(), self.inertia_B.tolist())
        mass_kg, centre_B, inertia_B = rigid_body([own, *bodies])
        return replace(self, mass_kg=mass_kg, inertia_B=inertia_B, centre_of_mass_B=_vector(centre_B))


@dataclass(frozen=True, repr=False)
class Aircraft(Shown):
    """A rigid fuselage with lifting surfaces on prescribed hinges.

    The fuselage includes the point masses on it, each surface those that it carries. ``propulsion`` is None
    if the thrust acts along the flight path at the reference point.
    """

    name: str
    fuselage: Fuselage
    surfaces: tuple[Surface, ...]
    propulsion: Propulsion | None = None

    @classmethod
    def of(cls, document: documents.Aircraft | Mapping[str, Any]) -> Aircraft:
        """Return the aircraft that a document, or its parsed JSON, describes.

        Raises
        ------
        InvalidInput : it is neither, or invalid.
        """
        document = documents.Aircraft.parse(document, "/aircraft")
        masses, names = document.point_masses or [], control_names(document.surfaces)
        surfaces = tuple(
            replace(_named(Surface.of(surface), n, names), point_masses=masses_on(surface.name, masses))
            for n, surface in enumerate(document.surfaces)
        )
        propulsion = None if document.propulsion is None else Propulsion.of(document.propulsion)
        return cls(document.name, Fuselage.of(document.fuselage).carrying(masses), surfaces, propulsion)

    @cached_property
    def hinges(self) -> tuple[Hinge, ...]:
        """The hinges of all surfaces, surface by surface from the fuselage outward, as columns of motions."""
        return tuple(hinge for surface in self.surfaces for hinge in surface.hinges)

    @cached_property
    def hinge_columns(self) -> tuple[slice, ...]:
        """Indices into ``hinges`` for each surface."""
        ends = np.cumsum([0, *(len(surface.hinges) for surface in self.surfaces)]).tolist()
        return tuple(slice(first, last) for first, last in pairwise(ends))

    @cached_property
    def drives(self) -> dict[str, Drive]:
        """Names of the drives, in the order of the hinges, then of the controls."""
        hinges = drives_of(
            (hinge.drive, surface, (number, place), hinge)
            for number, surface in enumerate(self.surfaces)
            for place, hinge in enumerate(surface.hinges)
        )
        return hinges | control_drives(
            (control.drive, surface, (number, place), control)
            for number, surface in enumerate(self.surfaces)
            for place, control in enumerate(surface.controls)
        )

    @cached_property
    def controls(self) -> tuple[Control, ...]:
        """The controls of all surfaces, surface by surface."""
        return tuple(control for surface in self.surfaces for control in surface.controls)

    @property
    def telescoping(self) -> list[str]:
        """Names of the surfaces that telescope."""
        return [surface.name for surface in self.surfaces if surface.mouth_m is not None]

    @property
    def moved_parts(self) -> tuple[Hinge | Control, ...]:
        """What drives move, in the order of schedules: all hinges, then all controls."""
        return (*self.hinges, *self.controls)


@dataclass(frozen=True)
class Start:
    """A measured start: angle of attack (rad), constant force (N) and moment (N m) in B at its origin.

    ``bank_rad`` is the roll angle phi.
    """

    alpha_rad: float
    force_B: Array
    moment_B: Array
    bank_rad: float = 0.0


@dataclass(frozen=True, repr=False)
class Flight(Shown):
    """The flight condition: ``mach`` is None for incompressible flow, ``wind_N`` the air's velocity, m/s.

    ``trim_drive`` names the drives that balance the pitching moment in trim, ``roll_trim_drive`` and
    ``yaw_trim_drive`` those for the others; "auto" are the aircraft's own (`simulate.trim_controls`). The
    start is a steady flight: ``climb_rad`` of the path through the air, ``turn_rate_rad_s`` of the heading,
    ``sideslip_rad``, or ``rates_B`` (p, q, r), rad/s.
    """

    airspeed_m_s: float
    air_density_kg_m3: float
    gravity_m_s2: float
    altitude_m: float
    wind_N: Array
    mach: float | None
    start: Start | None
    apparent_mass: bool = False
    trim_drive: str | None = None
    climb_rad: float = 0.0
    turn_rate_rad_s: float = 0.0
    sideslip_rad: float = 0.0
    rates_B: tuple[float, ...] = (0.0, 0.0, 0.0)
    roll_trim_drive: str = "auto"
    yaw_trim_drive: str = "auto"

    @classmethod
    def of(cls, document: FlightDocument | Mapping[str, Any]) -> Flight:
        """Return the flight condition that a document, or its parsed JSON, describes.

        Raises
        ------
        InvalidInput : it is neither, or invalid.
        """
        document = FlightDocument.parse(document, "/flight")
        start = document.start
        return cls(
            airspeed_m_s=document.airspeed_m_s,
            air_density_kg_m3=document.density_kg_m3,
            gravity_m_s2=document.gravity_m_s2,
            altitude_m=document.altitude_m,
            wind_N=_vector(document.wind_n_m_s),
            mach=document.mach_number,
            start=None
            if start is None
            else Start(
                start.alpha_rad, _vector(start.force_b_n), _vector(start.moment_b_n_m), start.bank_rad
            ),
            apparent_mass=document.apparent_mass,
            trim_drive=document.trim_drive,
            climb_rad=document.climb_rad,
            turn_rate_rad_s=document.turn_rate_rad_s,
            sideslip_rad=document.sideslip_rad,
            rates_B=tuple(document.rates_rad_s or (0.0, 0.0, 0.0)),
            roll_trim_drive=document.roll_trim_drive,
            yaw_trim_drive=document.yaw_trim_drive,
        )

    @property
    def dynamic_pressure_pa(self) -> float:
        """q_dyn = rho V^2 / 2."""
        return 0.5 * self.air_density_kg_m3 * self.airspeed_m_s**2

    @property
    def load_factor(self) -> float:
        """Lift over weight in the steady flight."""
        return load_factor(self.airspeed_m_s, self.gravity_m_s2, self.climb_rad, self.turn_rate_rad_s)

    @property
    def rotates(self) -> bool:
        """Whether the aircraft rotates in its steady flight."""
        return bool(self.turn_rate_rad_s) or any(self.rates_B)

    @property
    def is_asymmetric(self) -> bool:
        """Whether the steady flight differs from its mirror image."""
        return any((self.sideslip_rad, self.turn_rate_rad_s, self.rates_B[0], self.rates_B[2]))

    @property
    def banks(self) -> bool:
        """Whether a bank angle, not a side force, balances the forces across the flight path.

        It does in asymmetric flight, and where a drive is named that trims roll or yaw.
        """
        named = {self.roll_trim_drive, self.yaw_trim_drive} - {*NO_NAMES}
        return self.is_asymmetric or bool(named)


def _named(surface: Surface, number: int, names: Mapping[tuple[int, int], str]) -> Surface:
    """A surface whose controls have the names of their drives in the whole aircraft."""
    named = tuple(
        replace(control, drive=names[number, place]) for place, control in enumerate(surface.controls)
    )
    return replace(surface, controls=named) if named else surface


def _vector(values: list[float]) -> Array:
    vector = np.array(values, dtype=np.float64)
    vector.setflags(write=False)
    return vector
