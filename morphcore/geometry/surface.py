"""Lifting surfaces with all defaults resolved, in the form used by the numerics."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from morphcore.geometry.control import Control
from morphcore.geometry.hinge import Hinge, hinge_arms
from morphcore.geometry.section import SectionProperties, given_section, solid_box
from morphcore.shown import Shown
from morphdata import aircraft as documents
from morphdata.aircraft import Material, Section

Array = NDArray[np.float64]
Side = Literal["right", "left"]

SHEAR_FACTOR = 5.0 / 6.0  # of a rectangle, Timoshenko


@dataclass(frozen=True, repr=False)
class Surface(Shown):
    """A flat lifting surface on hinges: straight mid-chord line along its own y, linear taper.

    Wing axes W: origin at the root's mid-chord, x forward, y to the right, z down; the right surface spans
    +y, the left one -y. As in documents, ``elastic_axis_offset_m`` and ``mass_axis_offset_m`` are the
    distances of the elastic axis and of the line of centres of mass aft of mid-chord (negative: forward);
    computations in W use ``elastic_axis_x_m`` and ``mass_axis_x_m``. ``hinges`` carry the surface, from the
    fuselage outward; a fixed surface has none.
    """

    name: str
    side: Side
    span_m: float
    root_chord_m: float
    tip_chord_m: float
    thickness_m: float
    material: Material
    hinges: tuple[Hinge, ...]
    position_m: tuple[float, float, float]
    flexible: bool
    profile_drag: float
    section: Section | None
    elastic_axis_offset_m: float
    mass_axis_offset_m: float
    controls: tuple[Control, ...] = ()

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
            thickness_m=document.thickness_m,
            material=document.material,
            hinges=tuple(Hinge.of(hinge, document.side) for hinge in document.all_hinges),
            position_m=(x, y, z),
            flexible=document.flexible,
            profile_drag=document.profile_drag,
            section=document.section,
            elastic_axis_offset_m=document.elastic_axis_offset_m,
            mass_axis_offset_m=document.mass_axis_offset_m,
            controls=tuple(
                Control.of(control, document.side, control.name) for control in document.all_controls
            ),
        )

    @property
    def moved_parts(self) -> tuple[Hinge | Control, ...]:
        """What drives move: its hinges, then its controls."""
        return (*self.hinges, *self.controls)

    @property
    def span_sign(self) -> float:
        """+1 for a right surface (spans +y), -1 for a left one."""
        return 1.0 if self.side == "right" else -1.0

    @property
    def elastic_axis_x_m(self) -> float:
        """The x in W (forward positive) of the elastic axis; the offset itself is positive aft."""
        return -self.elastic_axis_offset_m

    @property
    def mass_axis_x_m(self) -> float:
        """The x in W (forward positive) of the line of centres of mass; the offset itself is positive aft."""
        return -self.mass_axis_offset_m

    @property
    def root_arms_B(self) -> Array:
        """Vectors (m, 3), m, from each hinge to the elastic axis at the root, at rest; see `hinge_arms`."""
        return hinge_arms(self.hinges, np.array(self.position_m), np.array([self.elastic_axis_x_m, 0.0, 0.0]))

    @property
    def mean_chord_m(self) -> float:
        """Area over span."""
        return 0.5 * (self.root_chord_m + self.tip_chord_m)

    @property
    def area_m2(self) -> float:
        """Planform area."""
        return self.span_m * self.mean_chord_m

    def chord_at(self, distance_m: ArrayLike) -> Array:
        """Chord (m) at a distance from the root along the span, shape of the input."""
        fraction = np.asarray(distance_m, dtype=np.float64) / self.span_m
        return self.root_chord_m + (self.tip_chord_m - self.root_chord_m) * fraction

    def section_at(self, distance_m: ArrayLike) -> SectionProperties:
        """Section properties at distances from the root, shape (stations,)."""
        chord = np.atleast_1d(self.chord_at(distance_m))
        if self.section is not None:
            return given_section(self.section, chord)
        return solid_box(self.material, chord, self.thickness_m)

    def axial_at(self, distance_m: ArrayLike) -> tuple[Array, Array]:
        """Axial and shear stiffness, N, each (stations,), at distances from the root.

        For the solid box they are E A and 5/6 G A (Timoshenko's factor of a rectangle). Explicit section
        properties do not include them; they are then those of the rectangle of this thickness with the same
        flap stiffness, 12 EI_flap / thickness^2. Both are far too stiff to matter, but a beam needs them.
        """
        axial = 12.0 * self.section_at(distance_m).ei_flap / self.thickness_m**2
        return axial, SHEAR_FACTOR * axial / (2.0 * (1.0 + self.material.poisson_ratio))
