"""Lifting surfaces with all defaults resolved, in the form used by the numerics."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from morphcore.geometry.hinge import Hinge, hinge_arms
from morphcore.geometry.section import SectionProperties, given_section, solid_box
from morphcore.shown import Shown
from morphdata import aircraft as documents
from morphdata.aircraft import Material, Section

Array = NDArray[np.float64]
Side = Literal["right", "left"]

VERTICAL_RAD = 1e-5  # a dihedral this close to pi / 2 is a vertical fin, exactly
SHEAR_FACTOR = 5.0 / 6.0  # of a rectangle, Timoshenko


@dataclass(frozen=True, repr=False)
class Surface(Shown):
    """A flat lifting surface on hinges: straight mid-chord line along its own y, linear taper.

    Wing axes W: origin at the root's mid-chord, y along the mid-chord line, the right surface spanning +y
    and the left one -y, z normal to the surface (down without dihedral), x forward. With all hinges at rest
    they are the body axes turned by the dihedral about x, then the incidence about y, then the sweep about z
    (``rest_R_BW``). Chords are parallel to the root's, hence oblique in W if swept (``chord_W``); the length
    of the mid-chord line is ``length_m`` = span / cos(sweep), and "distance from the root" is measured along
    it. Section properties are per length of that line; a section is perpendicular to it, the solid box
    chord cos(sweep) wide.

    As in documents, ``elastic_axis_offset_m`` and ``mass_axis_offset_m`` are the distances of the elastic
    axis and of the line of centres of mass aft of mid-chord (negative: forward), along the chord;
    ``elastic_axis_x_m`` and ``mass_axis_x_m`` are the same, positive forward. Both lines are parallel to y
    and begin at the root chord. ``hinges`` carry the surface, from the fuselage outward; a fixed surface has
    none. The lattice stays flat: ``twist_rad`` (of the tip against the root, nose up) and ``zero_lift_rad``
    are slopes of the mean line in its boundary condition.
    """

    name: str
    side: Side
    span_m: float
    root_chord_m: float
    tip_chord_m: float
    sweep_rad: float
    dihedral_rad: float
    incidence_rad: float
    thickness_m: float
    material: Material
    hinges: tuple[Hinge, ...]
    position_m: tuple[float, float, float]
    flexible: bool
    profile_drag: float
    zero_lift_rad: float
    cm0: float
    twist_rad: float
    section: Section | None
    elastic_axis_offset_m: float
    mass_axis_offset_m: float

    @classmethod
    def of(cls, document: documents.Surface) -> Surface:
        """Return the surface that a document describes."""
        root, tip = document.root_and_tip_chord_m
        x, y, z = document.root_m
        return cls(
            name=document.name,
            side=document.side,
            span_m=document.span_m,
            root_chord_m=root,
            tip_chord_m=tip,
            sweep_rad=document.sweep_rad,
            dihedral_rad=document.dihedral_rad,
            incidence_rad=document.incidence_rad,
            thickness_m=document.thickness_m,
            material=document.material,
            hinges=tuple(Hinge.of(hinge, document.side) for hinge in document.all_hinges),
            position_m=(x, y, z),
            flexible=document.flexible,
            profile_drag=document.profile_drag,
            zero_lift_rad=document.zero_lift_rad,
            cm0=document.cm0,
            twist_rad=document.twist_rad,
            section=document.section,
            elastic_axis_offset_m=document.elastic_axis_offset_m,
            mass_axis_offset_m=document.mass_axis_offset_m,
        )

    @property
    def span_sign(self) -> float:
        """+1 for a right surface (spans +y), -1 for a left one."""
        return 1.0 if self.side == "right" else -1.0

    @property
    def length_m(self) -> float:
        """Length of the mid-chord line, and of the elastic axis."""
        return self.span_m / math.cos(self.sweep_rad)

    @property
    def chord_W(self) -> Array:
        """Unit vector (3,) of the chords in W, forward."""
        return np.array([math.cos(self.sweep_rad), -self.span_sign * math.sin(self.sweep_rad), 0.0])

    @property
    def rest_R_BW(self) -> Array:
        """Rotation (3, 3) with all hinges at rest, wing components to body components."""
        upright = abs(abs(self.dihedral_rad) - 0.5 * math.pi) < VERTICAL_RAD
        cosine = 0.0 if upright else math.cos(self.dihedral_rad)
        sine = -self.span_sign * math.sin(self.dihedral_rad)  # tip up on both sides
        dihedral = np.array([[1.0, 0.0, 0.0], [0.0, cosine, -sine], [0.0, sine, cosine]])
        cosine, sine = math.cos(self.incidence_rad), math.sin(self.incidence_rad)
        incidence = np.array([[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]])
        cosine, sine = math.cos(self.sweep_rad), self.span_sign * math.sin(self.sweep_rad)
        sweep = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
        return np.asarray(dihedral @ incidence @ sweep)

    @property
    def is_upright(self) -> bool:
        """Whether wing axes and body axes are parallel with all hinges at rest."""
        return self.sweep_rad == self.dihedral_rad == self.incidence_rad == 0.0

    @property
    def elastic_axis_W(self) -> Array:
        """The elastic axis at the root (3,), m: the origin of beam and links."""
        return self.elastic_axis_x_m * self.chord_W

    @property
    def mass_arm_W(self) -> Array:
        """A section's centre of mass (3,) from the elastic axis, m."""
        return (self.mass_axis_x_m - self.elastic_axis_x_m) * self.chord_W

    @property
    def elastic_axis_x_m(self) -> float:
        """The elastic axis ahead of mid-chord, along the chord; the offset itself is positive aft."""
        return -self.elastic_axis_offset_m

    @property
    def mass_axis_x_m(self) -> float:
        """The line of centres of mass ahead of mid-chord, along the chord."""
        return -self.mass_axis_offset_m

    @property
    def root_arms_B(self) -> Array:
        """Vectors (m, 3), m, from each hinge to the elastic axis at the root, at rest; see `hinge_arms`."""
        return hinge_arms(self.hinges, np.array(self.position_m), self.rest_R_BW @ self.elastic_axis_W)

    @property
    def mean_chord_m(self) -> float:
        """Area over span."""
        return 0.5 * (self.root_chord_m + self.tip_chord_m)

    @property
    def area_m2(self) -> float:
        """Planform area."""
        return self.span_m * self.mean_chord_m

    def chord_at(self, distance_m: ArrayLike) -> Array:
        """Chord (m) at a distance from the root along the mid-chord line, shape of the input."""
        fraction = np.asarray(distance_m, dtype=np.float64) / self.length_m
        return self.root_chord_m + (self.tip_chord_m - self.root_chord_m) * fraction

    def twist_at(self, distance_m: ArrayLike) -> Array:
        """Twist (rad, nose up) of the section at a distance from the root; zero at the root, linear."""
        return self.twist_rad * np.asarray(distance_m, dtype=np.float64) / self.length_m

    def slope_at(self, distance_m: ArrayLike) -> Array:
        """Incidence (rad) that twist and camber add to a flat section at a distance from the root."""
        return self.twist_at(distance_m) - self.zero_lift_rad

    def section_at(self, distance_m: ArrayLike) -> SectionProperties:
        """Section properties at distances from the root, shape (stations,)."""
        chord = np.atleast_1d(self.chord_at(distance_m))
        if self.section is not None:
            return given_section(self.section, chord)
        return solid_box(self.material, chord * math.cos(self.sweep_rad), self.thickness_m)

    def axial_at(self, distance_m: ArrayLike) -> tuple[Array, Array]:
        """Axial and shear stiffness, N, each (stations,), at distances from the root.

        For the solid box they are E A and 5/6 G A (Timoshenko's factor of a rectangle). Explicit section
        properties do not include them; they are then those of the rectangle of this thickness with the same
        flap stiffness, 12 EI_flap / thickness^2. Both are far too stiff to matter, but a beam needs them.
        """
        axial = 12.0 * self.section_at(distance_m).ei_flap / self.thickness_m**2
        return axial, SHEAR_FACTOR * axial / (2.0 * (1.0 + self.material.poisson_ratio))
