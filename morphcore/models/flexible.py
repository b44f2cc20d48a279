"""The flexible model: wings of geometrically exact beams with a vortex lattice on their deformed surfaces.

Node 0 is the fuselage, its axes are B. Each surface follows with its root node on the elastic axis, and the
nodes of its elements from root to tip; a rigid surface has only its root. Without deformation, node axes are
the wing axes W. The lattice rides on sections of the beams: one at each edge of a strip (the ring corners)
and one at the middle of each strip (control points, profile drag). Every force on the lattice is transferred
to the nodes by virtual work.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from morphcore.aero.apparent_mass import apparent_inertia, spatial
from morphcore.aero.kernels.loads import JONES_B1, JONES_B2
from morphcore.aero.moving_lattice import Riders
from morphcore.aero.operator import AircraftLattice, aircraft_lattice
from morphcore.aero.stall import lift_limits
from morphcore.frames import skew
from morphcore.geometry.aircraft import Aircraft, Flight, Fuselage
from morphcore.geometry.control_slopes import panel_slopes
from morphcore.geometry.fields import whole_number
from morphcore.geometry.lattice import SurfaceLattice
from morphcore.geometry.section import SectionProperties
from morphcore.geometry.surface import Surface
from morphcore.models.kernels.telescope import HELD
from morphcore.models.links import POINTS, WEIGHTS
from morphcore.models.lumps import beam_lumps, moved_inertia, surface_lumps
from morphcore.models.span_quadrature import span_points
from morphcore.multibody.beam import (
    GAUSS,
    GAUSS_WEIGHTS,
    Beams,
    Section,
    flexibility_parts,
    make_beams,
)
from morphdata.faults import refuse
from morphdata.lattice import DEFAULT_LATTICE, Lattice
from morphdata.simulate import DEFAULT_ELEMENTS, MAX_ELEMENTS
from morphdata.telescopes import unsupported_faults

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]

KINK = 1e-9  # of an element: nearer to its ends, a kink of the surface's properties is at the node


@dataclass(frozen=True)
class FlexibleModel:
    """Beams, lattice and the connection between them.

    roots, tips : (s,) first and last node of each surface. rest_W : (n, 3) nodes of the unbent surfaces from
    their root node, in W, m. riders : the lattice on sections; element, fraction : (k,) where these are
    (element -1 - i is node i itself). apparent : (n, 6, 6) apparent mass of the air at the nodes, kg and m;
    (0, 6, 6) if the flight has none. compliances : (e, 3, 6, 6) what each Gauss point adds to an element's
    flexibility, (0, ...) if no surface telescopes.
    """

    aircraft: Aircraft
    flight: Flight
    lattice: AircraftLattice
    beams: Beams
    roots: IntArray
    tips: IntArray
    rest_W: Array
    riders: Riders
    element: IntArray
    fraction: Array
    apparent: Array
    compliances: Array

    def held(self, angles: Array) -> Array:
        """Stiffness (e, 6, 6) of the elements at angles (h,) of all hinges: hidden parts are held straight.

        Each Gauss point stands for the stretch of the element of its weight: it bends as far as that is
        visible, and otherwise HELD times as much.
        """
        stiffness, first = self.beams.stiffness.copy(), 0
        ends = np.cumsum([0.0, *GAUSS_WEIGHTS])
        for surface, own, count in zip(
            self.aircraft.surfaces, self.aircraft.hinge_columns, self.tips - self.roots, strict=True
        ):
            hidden = surface.hidden_m(angles[own]) / surface.length_m * count
            for e in range(min(int(np.ceil(hidden)), count)):
                seen = np.clip((e + ends[1:] - hidden) / GAUSS_WEIGHTS, HELD, 1.0)
                total = np.einsum("g,gij->ij", seen, self.compliances[first + e])
                stiffness[first + e] = np.linalg.inv(total)
            first += count
        return stiffness

    def at(self, angles: Array) -> FlexibleModel:
        """The model with the lattice that it has at angles (h,) of all hinges: it slides with their spans."""
        lattice = self.lattice.at(angles)
        if lattice is self.lattice:
            return self
        riders, element, fraction = _seats(self.aircraft, self.flight, lattice, self.roots, self.tips)
        riders = replace(riders, control_slope=self.riders.control_slope)
        return replace(self, lattice=lattice, riders=riders, element=element, fraction=fraction)


def flexible_model(
    aircraft: Aircraft,
    flight: Flight,
    *,
    elements: int = DEFAULT_ELEMENTS,
    lattice: Lattice = DEFAULT_LATTICE,
) -> FlexibleModel:
    """Build the model, with ``elements`` equal beam elements for every flexible surface.

    Raises
    ------
    InvalidInput : the number of elements is out of range.
    """
    elements = whole_number(elements, "elements", pointer="/model/elements", minimum=1, maximum=MAX_ELEMENTS)
    refuse(
        unsupported_faults(
            aircraft.telescoping, apparent_mass=flight.apparent_mass, lattice_shape=lattice.shape
        )
    )
    parts = aircraft_lattice(aircraft, lattice)
    ends: list[list[int]] = []
    rest, sections, damping = [], [], []
    bodies, inertia = [0], [fuselage_inertia(aircraft.fuselage)]
    roots, tips, rest_W = [], [], [np.zeros((1, 3))]
    apparent = [np.zeros((1, 6, 6))]
    node = 1
    for surface in aircraft.surfaces:
        count = elements if surface.flexible else 0
        roots.append(node)
        tips.append(node + count)
        stations = np.linspace(0.0, surface.length_m, count + 1)
        rest_W.append(stations[:, None] * np.array([0.0, surface.span_sign, 0.0]))
        on_points, on_nodes = beam_lumps(surface, count)
        for e in range(count):
            ends.append([node + e, node + e + 1])
            rest.append([0.0, 0.0, 0.0, 0.0, surface.span_sign * surface.length_m / count, 0.0])
            sections.append(element_sections(surface, stations[e], surface.length_m / count, on_points[e]))
            damping.append(surface.material.stiffness_damping_s)
        if count == 0:
            bodies.append(node)
            inertia.append(rigid_surface_inertia(surface))
        for number in np.flatnonzero(on_nodes.any(axis=(1, 2))):
            bodies.append(node + int(number))
            inertia.append(on_nodes[number])
        node += count + 1
        if flight.apparent_mass:
            apparent.append(_apparent_at(surface, flight, stations))
    slopes = panel_slopes(parts.slopes, len(aircraft.controls), parts.lattices)
    first, last = np.array(roots, dtype=np.int64), np.array(tips, dtype=np.int64)
    riders, element, fraction = _seats(aircraft, flight, parts, first, last)
    beams = make_beams(
        np.array(ends).reshape(-1, 2), rest, sections, damping, bodies=bodies, inertia=inertia, nodes=node
    )
    return FlexibleModel(
        aircraft=aircraft,
        flight=flight,
        lattice=parts,
        beams=beams,
        roots=first,
        tips=last,
        rest_W=np.concatenate(rest_W),
        riders=replace(riders, control_slope=slopes, limits=_circulation_limits(parts)),
        element=element,
        fraction=fraction,
        apparent=np.concatenate(apparent)[0 if flight.apparent_mass else 1 :],
        compliances=_compliances(aircraft, rest, sections),
    )


def _circulation_limits(parts: AircraftLattice) -> Array:
    """Limits (t, 2) of all strips' circulation over the speed, m; (0, 2) if no section stalls."""
    limits = lift_limits(parts.aircraft.surfaces, parts.lattices)
    chords = np.concatenate([lattice.strip_chord_m for lattice in parts.lattices])
    return 0.5 * chords[: limits.shape[0], None] * limits


def _compliances(aircraft: Aircraft, rest: list[list[float]], sections: list[list[Section]]) -> Array:
    """See `FlexibleModel.compliances`."""
    if all(surface.mouth_m is None for surface in aircraft.surfaces):
        return np.zeros((0, GAUSS.size, 6, 6))
    return np.array(
        [
            flexibility_parts(np.array(each[3:]), [section.stiffness for section in own])
            for each, own in zip(rest, sections, strict=True)
        ]
    ).reshape(-1, GAUSS.size, 6, 6)


def _seats(
    aircraft: Aircraft, flight: Flight, lattice: AircraftLattice, roots: IntArray, tips: IntArray
) -> tuple[Riders, IntArray, Array]:
    """Riders of the whole lattice, and element and fraction (k,) of their sections; see `FlexibleModel`."""
    riders, elements, fractions, first = [], [], [], 0
    for surface, part, root, tip in zip(aircraft.surfaces, lattice.lattices, roots, tips, strict=True):
        element, fraction, origin_W = _section_places(surface, part, int(root), first, int(tip - root))
        elements.append(element)
        fractions.append(fraction)
        riders.append(_riders(surface, part, flight, origin_W))
        first += int(tip - root)
    return _joined(riders), np.concatenate(elements), np.concatenate(fractions)


def _apparent_at(surface: Surface, flight: Flight, stations: Array) -> Array:
    """Apparent mass (nodes, 6, 6) of a surface at its nodes (distances from the root, m).

    Each node carries the air of the half elements beside it; a rigid surface's root that of the whole.
    """
    edges = np.concatenate([[0.0], 0.5 * (stations[1:] + stations[:-1]), [surface.length_m]])
    return spatial(apparent_inertia(surface, flight.air_density_kg_m3, edges[:-1], edges[1:], stations))


def beam_sections(surface: Surface, distance_m: Array) -> list[Section]:
    """Stiffness and mass of a surface's sections at distances from the root, about its elastic axis.

    Axes of W: x across the elastic axis, y along it, z normal.
    """
    properties = surface.section_at(distance_m)
    axial, shear_x, shear_z = surface.axial_at(distance_m)
    arm = surface.mass_arm_at(distance_m)
    sections = []
    for i in range(distance_m.size):
        stiffness = np.diag(
            [properties.ei_flap[i], properties.gj[i], properties.ei_edge[i], shear_x[i], axial[i], shear_z[i]]
        )
        sections.append(Section(stiffness, section_inertia(properties, i, arm[i] * surface.chord_W)))
    return sections


def element_sections(surface: Surface, start_m: float, length_m: float, lumps: Array) -> list[Section]:
    """Sections at the Gauss points of the element from a distance from the root on, with its point masses.

    Where the surface's properties have kinks within the element, each Gauss point stands for the stretch of
    the length of its weight: it gets the mean compliance of that stretch, and its mass with rigid arms. Mass,
    centre and inertia are then exact for any rows.

    Parameters
    ----------
    lumps : ndarray, shape (3, 6, 6)
        Spatial inertia of the point masses on each Gauss point (`beam_lumps`).
    """
    points = start_m + GAUSS * length_m
    kinks = surface.breaks_m[1:-1] - start_m
    if np.any((kinks > KINK * length_m) & (kinks < (1.0 - KINK) * length_m)):
        ends = start_m + length_m * np.array([0.0, *np.cumsum(GAUSS_WEIGHTS)[:-1], 1.0])
        ends[-1] = min(ends[-1], surface.length_m)
        every, length, rule = span_points(surface, ends, POINTS, WEIGHTS)
        sections = []
        for point, stations, weight in zip(points, every, length * rule, strict=True):
            share = (weight / weight.sum())[:, None, None]
            of = beam_sections(surface, stations)
            arms = np.zeros((stations.size, 3))
            arms[:, 1] = surface.span_sign * (stations - point)
            mass = moved_inertia(np.stack([section.mass for section in of]), arms)
            compliance = np.linalg.inv(np.stack([section.stiffness for section in of]))
            stiffness = np.linalg.inv((share * compliance).sum(axis=0))
            sections.append(Section(stiffness, (share * mass).sum(axis=0)))
    else:
        sections = beam_sections(surface, points)
    if not lumps.any():
        return sections
    spread = GAUSS_WEIGHTS[:, None, None] * length_m
    return [
        Section(section.stiffness, section.mass + lump)
        for section, lump in zip(sections, lumps / spread, strict=True)
    ]


def section_inertia(properties: SectionProperties, station: int, arm_W: Array) -> Array:
    """Spatial inertia (6, 6) per length of one station whose centre of mass is at ``arm_W`` (3,), m."""
    about_centre = np.diag(
        [properties.inertia_x[station], properties.inertia_y[station], properties.inertia_z[station]]
    )
    return spatial_inertia(float(properties.mass[station]), about_centre, arm_W)


def spatial_inertia(mass: float, about_centre: Array, centre: Array) -> Array:
    """Spatial inertia (6, 6) of a body about a point; Featherstone (2008), equation 2.63.

    mass : kg; about_centre : (3, 3) kg m^2 about the centre of mass; centre : (3,) m from the point.
    """
    c = skew(centre)
    out = np.zeros((6, 6))
    out[:3, :3] = about_centre + mass * c @ c.T
    out[:3, 3:] = mass * c
    out[3:, :3] = mass * c.T
    out[3:, 3:] = mass * np.eye(3)
    return out


def fuselage_inertia(fuselage: Fuselage) -> Array:
    """Spatial inertia (6, 6) of the fuselage about the reference point, in B."""
    return spatial_inertia(fuselage.mass_kg, fuselage.inertia_B, np.asarray(fuselage.centre_of_mass_B))


def rigid_surface_inertia(surface: Surface) -> Array:
    """Spatial inertia (6, 6) of an unbent surface about its root node, in W."""
    stations, length, rule = span_points(surface, np.array([0.0, surface.length_m]), POINTS, WEIGHTS)
    distance, width = stations[0], (0.5 * length * rule)[0]
    properties = surface.section_at(distance)
    ahead = surface.mass_arm_at(distance)
    total = surface_lumps(surface)
    for i, y in enumerate(distance):
        arm_W = ahead[i] * surface.chord_W + np.array([0.0, surface.span_sign * y, 0.0])
        total += width[i] * section_inertia(properties, i, arm_W)
    return total


def _section_places(
    surface: Surface, part: SurfaceLattice, root: int, first_element: int, elements: int
) -> tuple[IntArray, Array, Array]:
    """Element, fraction (k,) and origin (k, 3) in W of one surface's sections.

    First the strips' edges, then their middles, from the root.
    """
    edges = part.strip_edges_m
    distance = np.concatenate([edges, 0.5 * (edges[1:] + edges[:-1])])
    if not elements:
        return np.full(distance.size, -1 - root), np.zeros(distance.size), np.zeros((distance.size, 3))
    place = distance / surface.length_m * elements
    inside = np.minimum(np.floor(place + 1e-12), elements - 1)
    origin_W = distance[:, None] * np.array([0.0, surface.span_sign, 0.0])
    element, fraction = first_element + inside.astype(np.int64), place - inside
    if surface.mouth_m is not None:
        # up to the mouth the panel is straight: its visible root leaves no gap to the inner panel
        element[0], fraction[0], origin_W[0] = -1 - root, 0.0, 0.0
    return element, fraction, origin_W


def _riders(surface: Surface, part: SurfaceLattice, flight: Flight, origin_W: Array) -> Riders:
    """Riders of one surface on its sections."""
    axis = surface.elastic_axis_W
    strips = part.spanwise
    corner = np.tile(np.arange(strips + 1), part.chordwise + 1)
    middle = strips + 1 + np.arange(strips)
    control = np.tile(middle, part.chordwise)
    semichord = 0.5 * np.tile(part.strip_chord_m, part.chordwise)
    middle_W = np.zeros((strips, 3))
    middles = 0.5 * (part.strip_edges_m[1:] + part.strip_edges_m[:-1])
    middle_W -= surface.aft_at(middles)[:, None] * surface.chord_W
    middle_W[:, 1] += surface.span_sign * middles
    return Riders(
        sections=origin_W.shape[0],
        corner=corner,
        corner_arm=part.ring_corners_W.reshape(-1, 3) - axis - origin_W[corner],
        control=control,
        control_arm=part.control_points_W.reshape(-1, 3) - axis - origin_W[control],
        drag=middle,
        drag_arm=middle_W - axis - origin_W[middle],
        drag_area=surface.profile_drag * part.panel_area_m2.sum(axis=0) * surface.drag_share_at(middles),
        moment_area=surface.cm0 * _chord_squared(surface, part),
        control_chord=np.tile(surface.chord_W[:2], (control.size, 1)),
        drag_chord=np.tile(surface.chord_W[:2], (strips, 1)),
        slope=np.tile(surface.slope_at(middles), part.chordwise),
        lag_time=semichord / flight.airspeed_m_s / np.array([[JONES_B1], [JONES_B2]]),
    )


def _chord_squared(surface: Surface, part: SurfaceLattice) -> Array:
    """Integral (strips,) of the chord squared over each strip, m^3; exact for linear taper."""
    inner, outer = surface.chord_at(part.strip_edges_m[:-1]), surface.chord_at(part.strip_edges_m[1:])
    width = np.diff(part.strip_edges_m) * surface.chord_W[0]
    return np.asarray(width * (inner**2 + inner * outer + outer**2) / 3.0)


def _joined(parts: list[Riders]) -> Riders:
    """Riders of all surfaces, with sections numbered consecutively."""
    first = np.cumsum([0] + [part.sections for part in parts[:-1]])

    def numbered(name: str) -> IntArray:
        return np.concatenate([getattr(part, name) + n for part, n in zip(parts, first, strict=True)])

    def stacked(name: str) -> Array:
        return np.concatenate([getattr(part, name) for part in parts], axis=1 if name == "lag_time" else 0)

    return Riders(
        sections=sum(part.sections for part in parts),
        corner=numbered("corner"),
        corner_arm=stacked("corner_arm"),
        control=numbered("control"),
        control_arm=stacked("control_arm"),
        drag=numbered("drag"),
        drag_arm=stacked("drag_arm"),
        drag_area=stacked("drag_area"),
        moment_area=stacked("moment_area"),
        control_chord=stacked("control_chord"),
        drag_chord=stacked("drag_chord"),
        slope=stacked("slope"),
        lag_time=stacked("lag_time"),
    )
