"""Lifting surfaces with all defaults resolved, in the form used by the numerics."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from morphcore.geometry.control import Control
from morphcore.geometry.hinge import Hinge, hinge_arms
from morphcore.geometry.point_mass import PointMass
from morphcore.geometry.section import SectionProperties, given_section, solid_box
from morphcore.geometry.span_stations import SpanStations
from morphcore.shown import Shown
from morphdata import aircraft as documents
from morphdata.aircraft import Material, Section
from morphdata.telescopes import mouth_m, span_line_B

Array = NDArray[np.float64]
Side = Literal["right", "left"]

VERTICAL_RAD = 1e-5  # a dihedral this close to pi / 2 is a vertical fin, exactly
SHEAR_FACTOR = 5.0 / 6.0  # of a rectangle, Timoshenko


@dataclass(frozen=True, repr=False)
class Surface(Shown):
    """A flat lifting surface on hinges: straight mid-chord line along its own y, linear taper, or stations.

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
    are slopes of the mean line in its boundary condition. ``stations`` take precedence over the other fields;
    with them ``profile_drag`` is the mean over the area, and the elastic axis is still straight along y.
    ``cl_max`` and ``cl_min`` limit the lift coefficient of the sections; None: they do not stall.
    ``mouth_m`` is the distance of the mouth from the root at zero extension if the surface telescopes, see
    `hidden_m`; else None.
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
    stations: SpanStations | None = None
    point_masses: tuple[PointMass, ...] = ()
    controls: tuple[Control, ...] = ()
    cl_max: float | None = None
    cl_min: float | None = None
    mouth_m: float | None = None

    @classmethod
    def of(cls, document: documents.Surface) -> Surface:
        """Return the surface that a document describes."""
        root, tip = document.root_and_tip_chord_m
        x, y, z = document.root_m
        stations = SpanStations.of(document, lambda chord: _uniform_section(document, chord))
        line_B = span_line_B(document)
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
            hinges=tuple(Hinge.of(hinge, document.side, line_B) for hinge in document.all_hinges),
            position_m=(x, y, z),
            flexible=document.flexible,
            profile_drag=document.profile_drag if stations is None else stations.profile_drag,
            zero_lift_rad=document.zero_lift_rad,
            cm0=document.cm0,
            twist_rad=document.twist_rad,
            section=document.section,
            elastic_axis_offset_m=document.elastic_axis_offset_m if stations is None else stations.elastic_m,
            mass_axis_offset_m=document.mass_axis_offset_m,
            stations=stations,
            controls=tuple(
                Control.of(control, document.side, control.name) for control in document.all_controls
            ),
            cl_max=document.cl_max,
            cl_min=document.cl_min,
            mouth_m=mouth_m(document),
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
        if self.stations is not None:
            return self.stations.mean_chord_m
        return 0.5 * (self.root_chord_m + self.tip_chord_m)

    @property
    def area_m2(self) -> float:
        """Planform area."""
        return self.span_m * self.mean_chord_m

    def hidden_m(self, hinge_rad: ArrayLike) -> float:
        """Length inboard of the mouth from which it slides, without air loads, m; 0 if it does not telescope.

        hinge_rad : (m,) of its hinges; the last is the extension.
        """
        if self.mouth_m is None:
            return 0.0
        return max(self.mouth_m - float(np.asarray(hinge_rad, dtype=np.float64)[-1]), 0.0)

    def chord_at(self, distance_m: ArrayLike) -> Array:
        """Chord (m) at a distance from the root along the mid-chord line, shape of the input."""
        fraction = np.asarray(distance_m, dtype=np.float64) / self.length_m
        if self.stations is not None:
            return self.stations.between(fraction, self.stations.chord_m)
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
        base = _uniform_section(self, chord)
        if self.stations is None:
            return base
        return self.stations.of_section(np.atleast_1d(distance_m) / self.length_m, base)

    def aft_at(self, distance_m: ArrayLike) -> Array:
        """Mid-chord (m) aft of the root's, at distances from the root, shape of the input."""
        share = np.asarray(distance_m, dtype=np.float64) / self.length_m
        if self.stations is None:
            return np.zeros_like(share)
        return self.stations.between(share, self.stations.aft_m)

    def mass_arm_at(self, distance_m: ArrayLike) -> Array:
        """The centres of mass ahead of the elastic axis along the chord, m, shape of the input.

        distance_m : from the root.
        """
        share = np.asarray(distance_m, dtype=np.float64) / self.length_m
        if self.stations is None:
            return np.full_like(share, self.mass_axis_x_m - self.elastic_axis_x_m)
        return -self.stations.between(share, self.stations.mass_aft_m) - self.elastic_axis_x_m

    def drag_share_at(self, distance_m: ArrayLike) -> Array:
        """Profile drag coefficient over ``profile_drag`` at distances from the root, shape of the input."""
        share = np.asarray(distance_m, dtype=np.float64) / self.length_m
        if self.stations is None or self.stations.drag_share is None:
            return np.ones_like(share)
        return self.stations.between(share, self.stations.drag_share)

    @property
    def breaks_m(self) -> Array:
        """Distances from the root between which all properties are smooth: from 0 to the end, m."""
        if self.stations is None:
            return np.array([0.0, self.length_m])
        return np.concatenate([[0.0], self.stations.kinks, [1.0]]) * self.length_m

    def point_mass_arm_W(self, mass: PointMass, distance_m: float = 0.0) -> Array:
        """A point mass (3,) in W from the elastic axis at a distance from the root, undeformed, m."""
        along = mass.at * self.length_m
        aft = mass.aft_m + float(self.aft_at(along))
        beside = np.array([0.0, self.span_sign * (along - distance_m), -mass.up_m])
        return np.asarray(beside - (aft + self.elastic_axis_x_m) * self.chord_W)

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
            share = np.atleast_1d(np.asarray(distance_m, dtype=np.float64)) / self.length_m
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
    return solid_box(of.material, chord * math.cos(of.sweep_rad), of.thickness_m)
