"""Lifting surfaces with all defaults resolved, in the form used by the numerics."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from morphcore.geometry.hinge import Hinge, hinge_arms
from morphcore.geometry.point_mass import PointMass
from morphcore.geometry.section import SectionProperties, given_section, solid_box
from morphcore.geometry.span_stations import SpanStations
from morphcore.shown import Shown
from morphdata import aircraft as documents
from morphdata.aircraft import Material, Section

Array = NDArray[np.float64]
Side = Literal["right", "left"]

SHEAR_FACTOR = 5.0 / 6.0  # of a rectangle, Timoshenko


@dataclass(frozen=True, repr=False)
class Surface(Shown):
    """A flat lifting surface on hinges: straight mid-chord line along its own y, linear taper, or stations.

    Wing axes W: origin at the root's mid-chord, x forward, y to the right, z down; the right surface spans
    +y, the left one -y. As in documents, ``elastic_axis_offset_m`` and ``mass_axis_offset_m`` are the
    distances of the elastic axis and of the line of centres of mass aft of mid-chord (negative: forward);
    computations in W use ``elastic_axis_x_m`` and ``mass_axis_x_m``. ``hinges`` carry the surface, from the
    fuselage outward; a fixed surface has none. ``stations`` take precedence over the other fields; with them
    ``profile_drag`` is the mean over the area, and the elastic axis is still straight along y.
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
    stations: SpanStations | None = None
    point_masses: tuple[PointMass, ...] = ()

    @classmethod
    def of(cls, document: documents.Surface) -> Surface:
        """Return the surface that a document describes."""
        root, tip = document.root_and_tip_chord_m
        x, y, z = document.root_m
        stations = SpanStations.of(document, lambda chord: _uniform_section(document, chord))
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
            profile_drag=document.profile_drag if stations is None else stations.profile_drag,
            section=document.section,
            elastic_axis_offset_m=document.elastic_axis_offset_m if stations is None else stations.elastic_m,
            mass_axis_offset_m=document.mass_axis_offset_m,
            stations=stations,
        )

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
        if self.stations is not None:
            return self.stations.mean_chord_m
        return 0.5 * (self.root_chord_m + self.tip_chord_m)

    @property
    def area_m2(self) -> float:
        """Planform area."""
        return self.span_m * self.mean_chord_m

    def chord_at(self, distance_m: ArrayLike) -> Array:
        """Chord (m) at a distance from the root along the span, shape of the input."""
        fraction = np.asarray(distance_m, dtype=np.float64) / self.span_m
        if self.stations is not None:
            return self.stations.between(fraction, self.stations.chord_m)
        return self.root_chord_m + (self.tip_chord_m - self.root_chord_m) * fraction

    def section_at(self, distance_m: ArrayLike) -> SectionProperties:
        """Section properties at distances from the root, shape (stations,)."""
        chord = np.atleast_1d(self.chord_at(distance_m))
        base = _uniform_section(self, chord)
        if self.stations is None:
            return base
        return self.stations.of_section(np.atleast_1d(distance_m) / self.span_m, base)

    def aft_at(self, distance_m: ArrayLike) -> Array:
        """Mid-chord (m) aft of the root's, at distances from the root, shape of the input."""
        share = np.asarray(distance_m, dtype=np.float64) / self.span_m
        if self.stations is None:
            return np.zeros_like(share)
        return self.stations.between(share, self.stations.aft_m)

    def mass_arm_at(self, distance_m: ArrayLike) -> Array:
        """The x in W (m, forward positive) of the centres of mass from the elastic axis, shape of the input.

        distance_m : from the root.
        """
        share = np.asarray(distance_m, dtype=np.float64) / self.span_m
        if self.stations is None:
            return np.full_like(share, self.mass_axis_x_m - self.elastic_axis_x_m)
        return -self.stations.between(share, self.stations.mass_aft_m) - self.elastic_axis_x_m

    def drag_share_at(self, distance_m: ArrayLike) -> Array:
        """Profile drag coefficient over ``profile_drag`` at distances from the root, shape of the input."""
        share = np.asarray(distance_m, dtype=np.float64) / self.span_m
        if self.stations is None or self.stations.drag_share is None:
            return np.ones_like(share)
        return self.stations.between(share, self.stations.drag_share)

    @property
    def breaks_m(self) -> Array:
        """Distances from the root between which all properties are smooth: from 0 to the span, m."""
        if self.stations is None:
            return np.array([0.0, self.span_m])
        return np.concatenate([[0.0], self.stations.kinks, [1.0]]) * self.span_m

    def mass_arm_W(self, mass: PointMass, distance_m: float = 0.0) -> Array:
        """A point mass (3,) in W from the elastic axis at a distance from the root, undeformed, m."""
        along = mass.at * self.span_m
        aft = mass.aft_m + float(self.aft_at(along))
        return np.array([-aft - self.elastic_axis_x_m, self.span_sign * (along - distance_m), -mass.up_m])

    def axial_at(self, distance_m: ArrayLike) -> tuple[Array, Array, Array]:
        """Axial stiffness and shear stiffness along chord and normal, N, each (stations,).

        For the solid box they are E A and 5/6 G A (Timoshenko's factor of a rectangle). Where a section does
        not give its axial stiffness, it is that of the rectangle of this thickness with the same flap
        stiffness, 12 EI_flap / thickness^2; shear follows from it. Both are far too stiff to matter, but a
        beam needs them.
        """
        axial = 12.0 * self.section_at(distance_m).ei_flap / self.thickness_m**2
        given = self.section
        if given is not None and given.ea_n is not None:
            axial = np.full_like(axial, given.ea_n)
        if self.stations is not None:
            share = np.atleast_1d(np.asarray(distance_m, dtype=np.float64)) / self.span_m
            known = self.stations.axial(share)
            axial = axial if known is None else known
        chord = normal = SHEAR_FACTOR * axial / (2.0 * (1.0 + self.material.poisson_ratio))
        if given is not None and given.ga_chord_n is not None:
            chord = normal = np.full_like(axial, given.ga_chord_n)
        if given is not None and given.ga_normal_n is not None:
            normal = np.full_like(axial, given.ga_normal_n)
        return axial, chord, normal


def _uniform_section(of: Surface | documents.Surface, chord: Array) -> SectionProperties:
    """Section properties at given chords (stations,), as they are without rows along the span."""
    if of.section is not None:
        return given_section(of.section, chord)
    return solid_box(of.material, chord, of.thickness_m)
