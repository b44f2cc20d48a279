"""The equivalent model: wings as chains of rigid links on gimbals; the rigid model is n = 1."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from morphcore.aero.bent_shape import BentShape
from morphcore.aero.kernels.loads import L_MOMENT, LINKS, PAIR0, STRIPS, TELESCOPES
from morphcore.aero.operator import AircraftLattice, aircraft_lattice
from morphcore.aero.vlm import prandtl_glauert
from morphcore.errors import InvalidInput
from morphcore.geometry.aircraft import Aircraft, Flight
from morphcore.geometry.fields import whole_number
from morphcore.geometry.mirror import Mirror, mirror_groups, mirror_of
from morphcore.geometry.obstacle import lift_coefficient
from morphcore.geometry.surface import Surface
from morphcore.lanes import lane_width
from morphcore.models.guess import fitted, physical_guess
from morphcore.models.kernels.layout import (
    FORCE_C,
    LINKS_C,
    MOMENT_C,
    axis_rows_of_scratch,
    state_rows,
    visible_rows_of_scratch,
)
from morphcore.models.links import link_edges
from morphcore.models.parameter_batch import ParameterBatch
from morphcore.models.parameters import CHAIN_PARAMETERS, Parameter
from morphcore.models.surface_rows import CutSurface, SurfaceRows
from morphcore.multibody.kernels.articulated import LINK_ROWS
from morphcore.shown import Shown
from morphdata.faults import refuse
from morphdata.lattice import DEFAULT_LATTICE, Lattice
from morphdata.links import (
    MAX_LINKS,
    LinksPerWing,
    common_names,
    links_document,
    links_of,
    means,
)
from morphdata.refusals import escaped
from morphdata.telescopes import unsupported_faults

__all__ = [
    "ChainModel",
    "LaneConstants",
    "ParameterBatch",
    "chain_model",
    "fitted",
    "from_lanes",
    "lane_constants",
    "physical_guess",
    "to_lanes",
]

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]

# Lift coefficient from which the lattice accounts for the velocity that the wake induces along wings of one
# plane: without it, 0.05 per cent of the angle of attack and 0.07 of the thrust at 0.38, 0.2 and 0.6 at 0.7
STEEP_LIFT = 0.45
FINE_LINKS = 8  # of a chain that stands for the beams: its nominal tip deflects by 0.3 per cent less


@dataclass(frozen=True, repr=False)
class ChainModel(Shown):
    """Topology and lattice of an equivalent (or rigid) model, shared by all its parameter sets.

    links_per_wing : links of each flexible surface, by name where they differ.
    surfaces : (s, 12) first link, links, first strip, strips, first overlap pair of each surface; whether it
        also represents its mirror image; the first of its further outputs of the lattice (or -1); its
        `AircraftLattice.control_inputs`; whether it carries point masses; the sign of its span if it
        telescopes, else 0.
    """

    aircraft: Aircraft
    flight: Flight
    lattice: AircraftLattice
    links_per_wing: LinksPerWing
    surfaces: IntArray

    @cached_property
    def mirror(self) -> Mirror | None:
        """The mirror image of each surface; None if the aircraft is not symmetric, or is itself a half."""
        return None if self.lattice.images else mirror_of(self.aircraft, self.flight)

    @cached_property
    def half(self) -> ChainModel | None:
        """One half of a symmetric aircraft, which can represent both at half the cost if they move alike.

        The fuselage is whole. Of a pair of surfaces the first named is kept.
        """
        if self.mirror is None:
            return None
        every = self.aircraft.surfaces
        own = replace(self.aircraft, surfaces=tuple(every[k] for k in self.mirror.own))
        images = tuple(every[k] for k in self.mirror.image)
        counts = self.surfaces[list(self.mirror.own), 1]
        lattice = self.lattice
        return _chain_model(
            own, self.flight, self.links_per_wing, counts, lattice.settings, images, lattice.steep
        )

    @cached_property
    def rigid(self) -> ChainModel:
        """The rigid model of the same aircraft (or half of one) in the same flight."""
        if self.links_per_wing == 1:
            return self
        return self._with_links(1)

    @cached_property
    def fine(self) -> ChainModel:
        """A chain of the same aircraft whose nominal parameters represent the beams: it bends as they do."""
        return self._with_links(FINE_LINKS)

    def _with_links(self, links: int) -> ChainModel:
        """The same aircraft (or half of one) with a number of links for each flexible surface."""
        counts = [links if surface.flexible else 1 for surface in self.aircraft.surfaces]
        lattice = self.lattice
        return _chain_model(
            self.aircraft, self.flight, links, counts, lattice.settings, lattice.images, lattice.steep
        )

    @cached_property
    def starts(self) -> dict[bytes, tuple[float, tuple[float, ...], BentShape | None]]:
        """Angle of attack and trim drives, rad, and shape, found by first angles: see simulate/wake.py."""
        return {}

    @property
    def links(self) -> int:
        """Number of links of all surfaces."""
        return int(self.surfaces[:, 1].sum())

    @property
    def joints(self) -> int:
        """Number of gimbal joints."""
        return self.links - len(self.aircraft.surfaces)

    @property
    def coordinates(self) -> int:
        """Number of free joint coordinates: three for each gimbal."""
        return 3 * self.joints

    @property
    def state_rows(self) -> int:
        """Rows of a state: 13 for the fuselage, joint angles and rates, nine for the lag of each link."""
        return int(state_rows(self.links, self.coordinates)[-1])

    @property
    def scratch_rows(self) -> int:
        """Number of rows of a block's scratch."""
        rows = int(axis_rows_of_scratch(self.links, self.coordinates)[-1])
        if not self.surfaces[:, TELESCOPES].any():
            return rows
        pairs = self.surfaces[-1, PAIR0] + self.surfaces[-1, LINKS] * self.surfaces[-1, STRIPS]
        return int(visible_rows_of_scratch(self.links, self.coordinates)[-1] + 2 * pairs)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The parameters that can be identified, in the order of reports."""
        return tuple(CHAIN_PARAMETERS)

    @cached_property
    def reference_surface(self) -> Surface:
        """The largest surface, whose chord is the reference for lengths and times of the whole aircraft."""
        return max(self.aircraft.surfaces, key=lambda surface: (surface.area_m2, surface.mean_chord_m))

    @cached_property
    def flexible(self) -> tuple[int, ...]:
        """Indices of the flexible surfaces, or of the largest if none is flexible."""
        surfaces = self.aircraft.surfaces
        found = tuple(k for k, surface in enumerate(surfaces) if surface.flexible)
        return found or (surfaces.index(self.reference_surface),)

    @cached_property
    def pairs(self) -> tuple[tuple[int, ...], ...]:
        """Indices of the flexible surfaces by mirror pair; a surface without an image forms its own group.

        Sorted by size, then by name, so that the order of the aircraft's surfaces does not matter.
        """
        groups = mirror_groups([self.aircraft.surfaces[k] for k in self.flexible])
        return tuple(sorted((tuple(self.flexible[k] for k in group) for group in groups), key=self._rank))

    @cached_property
    def unlike(self) -> dict[str, tuple[int, ...]]:
        """Mirror pairs of all surfaces, rigid ones too, by a name for both; the largest comes first."""
        surfaces = self.aircraft.surfaces
        groups = sorted(mirror_groups(surfaces), key=self._rank)
        reference = surfaces.index(self.reference_surface)
        groups.sort(key=lambda group: reference not in group)
        return dict(zip(common_names([surface.name for surface in surfaces], groups), groups, strict=True))

    def own_column(self, batch: ParameterBatch, number: int) -> int:
        """Column of a batch's lift factors that a surface has: that of its own, or the first."""
        if not batch.apart:
            return 0
        surfaces, images = self.aircraft.surfaces, self.lattice.images
        names = [surface.name for surface in (*surfaces, *images)]
        mine = {*next(pair for pair in self.unlike.values() if number in pair)}
        mine |= {len(surfaces) + number} if images else set()
        found = [k for k, key in enumerate(batch.apart, 1) if mine & set(means(key, names))]
        return found[0] if found else 0

    def links_on(self, number: int) -> int:
        """Links of a flexible surface; those asked for, if it is rigid and stands for all."""
        if self.aircraft.surfaces[number].flexible or not isinstance(self.links_per_wing, int):
            return int(self.surfaces[number, 1])
        return self.links_per_wing

    def _rank(self, group: Sequence[int]) -> tuple[float, str]:
        return -self.aircraft.surfaces[group[0]].area_m2, self.label(group)

    def label(self, group: Sequence[int]) -> str:
        """The name of a surface, or that of the right surface of a mirror pair."""
        surfaces = [self.aircraft.surfaces[k] for k in group]
        return min(surfaces, key=lambda surface: surface.side != "right").name

    def sets(self, *, separate_wings: bool = False) -> tuple[tuple[int, ...], ...]:
        """Indices of the surfaces that share a set of parameters: mirror pairs, or each by itself."""
        if not separate_wings:
            return self.pairs
        if len(self.pairs) == 1:
            return tuple((k,) for k in self.flexible)
        return tuple(sorted(((k,) for group in self.pairs for k in group), key=self._rank))

    def set_names(self, sets: Sequence[Sequence[int]]) -> tuple[tuple[str, ...], ...] | None:
        """Names of the surfaces of each set, the label first; None if all flexible surfaces are one pair."""
        if len(self.pairs) == 1:
            return None
        names = [[self.aircraft.surfaces[k].name for k in group] for group in sets]
        first = [self.label(group) for group in sets]
        return tuple(
            (label, *(name for name in group if name != label))
            for label, group in zip(first, names, strict=True)
        )

    def set_of(self, batch: ParameterBatch) -> tuple[int, ...]:
        """Which set of a batch each surface uses; -1 for rigid surfaces.

        Raises
        ------
        InvalidInput
            The batch has no set for a surface, or the wings of a halved aircraft would differ.
        """
        surfaces = self.aircraft.surfaces
        chosen = [-1] * len(surfaces)
        if batch.surfaces is None:
            if batch.sets not in (1, len(self.flexible)) or batch.sets < len(self.pairs):
                raise InvalidInput(
                    f"the parameters are for {batch.sets} wings, but the model has {len(self.flexible)}",
                    pointer="/model/parameters/division",
                    hint="give the model of this aircraft",
                )
            for number, k in enumerate(self.flexible):
                chosen[k] = min(number, batch.sets - 1)
            return tuple(chosen)
        known = {name: k for k, names in enumerate(batch.surfaces) for name in names}
        for k in self.flexible:
            own = {known.get(surfaces[k].name)} | {known.get(s.name) for s in self.lattice.images[k : k + 1]}
            if len(own) > 1 or None in own:
                raise InvalidInput(
                    f"there are no parameters for the surface {surfaces[k].name!r} or its mirror image",
                    pointer="/model/parameters/surfaces",
                    hint=f"they are for {', '.join(known)}: give the model of this aircraft",
                )
            chosen[k] = known[surfaces[k].name]
        return tuple(chosen)

    def is_even(self, batch: ParameterBatch) -> bool:
        """Whether mirror images share their parameters, so that half the aircraft can represent the whole."""
        chosen, mirror = self.set_of(batch), self.mirror
        return mirror is not None and all(
            chosen[k] == chosen[image] for k, image in zip(mirror.own, mirror.image, strict=True)
        )

    def on_surface(self, batch: ParameterBatch, number: int) -> dict[str, Array]:
        """Values (p, ...) of all parameters on one surface: the batch's, scaled, or its own guess."""
        surface, chosen = self.aircraft.surfaces[number], self.set_of(batch)[number]
        links = int(self.surfaces[number, 1])
        cut = CutSurface(surface, self.flight, np.full((batch.particles, links), 1.0 / links))
        values = {}
        for parameter in self.parameters:
            known = batch.values.get(parameter.name)
            if parameter.scope == "aircraft" and known is not None:
                known = batch.of_aircraft(parameter.name, self.own_column(batch, number))
                values[parameter.name] = known * parameter.in_proportion(surface, self.reference_surface)
            elif parameter.scope != "aircraft" and known is not None and surface.flexible:
                values[parameter.name] = batch.of_set(parameter.name, chosen)
            else:
                values[parameter.name] = parameter.guess(cut)
        return values


def chain_model(
    aircraft: Aircraft, flight: Flight, links_per_wing: LinksPerWing, lattice: Lattice = DEFAULT_LATTICE
) -> ChainModel:
    """Build the equivalent model with 1 to 16 links on each flexible surface; 1 is the rigid model.

    Parameters
    ----------
    aircraft : Aircraft
    flight : Flight
    links_per_wing : int or mapping of str to int
        Of all flexible surfaces, or of each by name, mirror images by a name for both.
    lattice : Lattice, optional

    Raises
    ------
    InvalidInput : a number of links is out of range, or a surface is not named or is unknown.
    """
    pointer, by_name = "/model/links_per_wing", isinstance(links_per_wing, Mapping)
    given = links_per_wing if isinstance(links_per_wing, Mapping) else {"": links_per_wing}
    checked = {
        name: whole_number(
            links, f"links_per_wing of {name!r}" if name else "links_per_wing",
            pointer=f"{pointer}/{escaped(name)}" if by_name else pointer, minimum=1, maximum=MAX_LINKS,
        )
        for name, links in given.items()
    }  # fmt: skip
    surfaces = aircraft.surfaces
    names, flexible = [each.name for each in surfaces], [each.flexible for each in surfaces]
    pairs = mirror_groups(surfaces)
    links: LinksPerWing = checked if by_name else checked[""]
    counts, faults = links_of(links, names, flexible, pairs, pointer)
    refuse(faults)
    refuse(
        unsupported_faults(
            aircraft.telescoping, apparent_mass=flight.apparent_mass, lattice_shape=lattice.shape
        )
    )
    steep = lift_coefficient(aircraft, flight) > STEEP_LIFT
    if by_name:
        bent = [k for k, bends in enumerate(flexible) if bends]
        links = links_document([names[k] for k in bent], [counts[k] for k in bent])
    return _chain_model(aircraft, flight, links, counts, lattice, steep=steep)


def _chain_model(
    aircraft: Aircraft,
    flight: Flight,
    links_per_wing: LinksPerWing,
    counts: Sequence[int] | IntArray,
    lattice: Lattice,
    images: Sequence[Surface] = (),
    steep: bool = False,  # noqa: FBT001, FBT002 - private
) -> ChainModel:
    """A chain of so many links for each surface, as ``links_per_wing`` says in the form of documents."""
    lattices = aircraft_lattice(aircraft, lattice, images, steep=steep)
    rows, link, pair = [], 0, 0
    for surface, part, strip0, controls, count in zip(
        aircraft.surfaces, lattices.lattices, lattices.strip0, lattices.control_inputs, counts, strict=True
    ):
        more, lumped = lattices.more_rows(strip0), int(bool(surface.point_masses))
        slides = 0 if surface.mouth_m is None else int(surface.span_sign)
        seats = [strip0, part.spanwise, pair, int(bool(images)), more]
        rows.append([link, count, *seats, *controls, lumped, slides])
        link += count
        pair += count * part.spanwise
    return ChainModel(aircraft, flight, lattices, links_per_wing, np.array(rows, dtype=np.int64))


@dataclass(frozen=True)
class LaneConstants:
    """Parameter sets laid out for the kernels: ``rows`` (b, rows, width) and ``ranges`` (b, links, 2).

    The last block is filled up with copies of the last particle. ``ranges`` gives, for each link, the strips
    that it may touch in any lane of the block.
    """

    rows: Array
    ranges: IntArray
    particles: int

    def set_thrust(self, force_B: Array, moment_B: Array) -> None:
        """Write the constant force and moment in B, each (p, 3), N and N m."""
        self.rows[:, FORCE_C : FORCE_C + 3] = to_lanes(force_B)
        self.rows[:, MOMENT_C : MOMENT_C + 3] = to_lanes(moment_B)


def to_lanes(values: Array) -> Array:
    """(p, rows) -> (blocks, rows, width), the last block filled up with copies of the last particle."""
    particles = values.shape[0]
    width = lane_width(particles)
    blocks = -(-particles // width)
    index = np.minimum(np.arange(blocks * width), particles - 1)
    return np.ascontiguousarray(values[index].reshape(blocks, width, -1).transpose(0, 2, 1))


def from_lanes(blocks: Array, particles: int) -> Array:
    """(blocks, rows, width) -> (p, rows)."""
    return np.ascontiguousarray(blocks.transpose(0, 2, 1).reshape(-1, blocks.shape[1])[:particles])


def lane_constants(model: ChainModel, batch: ParameterBatch, step_s: float) -> LaneConstants:
    """Lay a batch of parameters out for the kernels.

    Parameters
    ----------
    model : ChainModel
        The model to fly: the aircraft, or half of it.
    batch : ParameterBatch
        With the sets of this model (see `fitted`).
    step_s : float
        Time step, s.

    Raises
    ------
    InvalidInput
        The batch belongs to another aircraft, or the wings of a halved aircraft would differ.
    """
    particles = batch.particles
    links = np.zeros((particles, model.links, LINK_ROWS))
    touched = np.zeros((particles, model.links, 2), dtype=np.int64)
    every = []
    for number, (surface, part, row) in enumerate(
        zip(model.aircraft.surfaces, model.lattice.lattices, model.surfaces, strict=True)
    ):
        first, count = int(row[0]), int(row[1])
        mine = slice(first, first + count)
        laid = SurfaceRows(
            surface,
            part,
            step_s,
            links[:, mine],
            stiffness=np.zeros((particles, 3 * (count - 1))),
            damping=np.zeros((particles, 3 * (count - 1))),
            overlap=np.zeros((particles, 2 * part.spanwise * count)),
            touched=touched[:, mine],
        )
        values = model.on_surface(batch, number)
        for parameter in model.parameters:
            parameter.apply(laid, values[parameter.name])
        if model.flight.apparent_mass:
            laid.add_apparent_mass(link_edges(values["division"], surface.length_m), model.flight)
        every.append(laid)
    links[:, :, L_MOMENT] /= prandtl_glauert(model.flight.mach or 0.0)
    rows = np.concatenate(
        [
            np.zeros((particles, LINKS_C)),
            links.reshape(particles, -1),
            *(surface.stiffness for surface in every),
            *(surface.damping for surface in every),
            *(surface.overlap for surface in every),
        ],
        axis=1,
    )
    low = to_lanes(touched[..., 0].astype(np.float64)).min(axis=2)
    high = to_lanes(touched[..., 1].astype(np.float64)).max(axis=2)
    return LaneConstants(to_lanes(rows), np.stack([low, high], axis=-1).astype(np.int64), particles)
