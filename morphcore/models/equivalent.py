"""The equivalent model: wings as chains of rigid links on gimbals; the rigid model is n = 1."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from morphcore.aero.kernels.loads import AERO_ROWS, JONES_B1, JONES_B2, JONES_MEAN_LAG
from morphcore.aero.operator import AircraftLattice, aircraft_lattice
from morphcore.geometry.aircraft import Aircraft, Flight
from morphcore.geometry.fields import whole_number
from morphcore.geometry.mirror import Mirror, mirror_of
from morphcore.geometry.surface import Surface
from morphcore.lanes import lane_width
from morphcore.models.kernels.layout import (
    AERO_C,
    FORCE_C,
    LINKS_C,
    MOMENT_C,
    joint_rows_of_scratch,
    state_rows,
)
from morphcore.models.links import drag_areas, joint_stiffness, link_edges, link_masses, strip_overlap
from morphcore.multibody.kernels.articulated import LINK_ROWS
from morphcore.shown import Shown
from morphdata.lattice import DEFAULT_LATTICE, Lattice
from morphdata.parameters import MAX_LINKS

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]

NEUTRAL_LIFT_FACTOR = 1.0
SHORTEST_LAG_S = 1e-9  # below, the circulation is quasi-steady; spares a division by zero


@dataclass(frozen=True, repr=False)
class ParameterBatch(Shown):
    """Parameters of many equivalent models of one aircraft (p particles, w wing sets, n links).

    ``w`` is 1 where all flexible surfaces share their parameters, else the number of flexible surfaces.

    division : (p, w, n) fractions of the span, summing to one. stiffness, damping : (p, w, n - 1, 3) of flap,
    torsion, lag, N m/rad and N m s/rad. lift_factor (-), centre_shift (m, forward positive), profile_drag
    (-), lag (s) : (p,).
    """

    division: Array
    stiffness: Array
    damping: Array
    lift_factor: Array
    centre_shift: Array
    profile_drag: Array
    lag: Array

    @property
    def particles(self) -> int:
        """Number of parameter sets."""
        return int(self.division.shape[0])

    @property
    def wing_sets(self) -> int:
        """Sets of wing parameters, w."""
        return int(self.division.shape[1])

    @property
    def links(self) -> int:
        """Links per flexible surface."""
        return int(self.division.shape[2])

    def select(self, index: NDArray[np.int64] | slice) -> ParameterBatch:
        """Some of the parameter sets."""
        return ParameterBatch(**{name: value[index] for name, value in vars(self).items()})


@dataclass(frozen=True, repr=False)
class ChainModel(Shown):
    """Topology and lattice of an equivalent (or rigid) model: all that its parameter sets share.

    surfaces : (s, 6) first link, links, first strip, strips, first overlap pair of each surface, and whether
        it stands for its mirror image too.
    """

    aircraft: Aircraft
    flight: Flight
    lattice: AircraftLattice
    links_per_wing: int
    surfaces: IntArray

    @cached_property
    def mirror(self) -> Mirror | None:
        """Which surfaces are each other's images; None if the aircraft is not symmetric, or half of one."""
        return None if self.lattice.images else mirror_of(self.aircraft, self.flight)

    @cached_property
    def half(self) -> ChainModel | None:
        """One half of a symmetric aircraft, which stands for both where they move alike, at half the cost.

        The fuselage is whole. Of a pair of surfaces the one that is named first is kept.
        """
        if self.mirror is None:
            return None
        every = self.aircraft.surfaces
        own = replace(self.aircraft, surfaces=tuple(every[k] for k in self.mirror.own))
        images = tuple(every[k] for k in self.mirror.image)
        return _chain_model(own, self.flight, self.links_per_wing, self.lattice.settings, images)

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
        """Rows of a state: 13 of the fuselage, angles and rates of the joints, nine of lag a link."""
        return int(state_rows(self.links, self.coordinates)[-1])

    @property
    def scratch_rows(self) -> int:
        """Rows of a block's scratch."""
        return int(joint_rows_of_scratch(self.links, self.coordinates)[-1])

    @property
    def relative_chord(self) -> Array:
        """Chord of each link's surface over the first surface's, (links,): it scales the lag times."""
        chords = [s.mean_chord_m for s in self.aircraft.surfaces]
        return np.repeat(np.array(chords) / chords[0], self.surfaces[:, 1])

    @property
    def natural_lag_s(self) -> float:
        """Mean lag of Jones' indicial function at the flight's airspeed and the first surface's chord."""
        chord = self.aircraft.surfaces[0].mean_chord_m
        return JONES_MEAN_LAG * chord / (2 * self.flight.airspeed_m_s)


def chain_model(
    aircraft: Aircraft, flight: Flight, links_per_wing: int, lattice: Lattice = DEFAULT_LATTICE
) -> ChainModel:
    """The equivalent model with 1 to 8 links on each flexible surface; 1 is the rigid model.

    Raises
    ------
    InvalidInput : the number of links is out of range.
    """
    links = whole_number(
        links_per_wing, "links_per_wing", pointer="/model/links_per_wing", least=1, most=MAX_LINKS
    )
    return _chain_model(aircraft, flight, links, lattice)


def _chain_model(
    aircraft: Aircraft,
    flight: Flight,
    links_per_wing: int,
    lattice: Lattice,
    images: Sequence[Surface] = (),
) -> ChainModel:
    lattices = aircraft_lattice(aircraft, lattice, images)
    rows, link, pair = [], 0, 0
    for surface, part, strip0 in zip(aircraft.surfaces, lattices.lattices, lattices.strip0, strict=True):
        count = links_per_wing if surface.flexible else 1
        rows.append([link, count, strip0, part.spanwise, pair, int(bool(images))])
        link += count
        pair += count * part.spanwise
    return ChainModel(aircraft, flight, lattices, links_per_wing, np.array(rows, dtype=np.int64))


def physical_guess(model: ChainModel, division: Array | None = None, *, wing_sets: int = 1) -> ParameterBatch:
    """Parameters from beam and thin-airfoil theory: k = EI / l, c = beta k, neutral corrections, Jones' lag.

    ``division`` (p, w, n) defaults to one particle of equal links. Where all wings share parameters the first
    flexible surface gives them.
    """
    n = model.links_per_wing
    if division is None:
        division = np.full((1, wing_sets, n), 1.0 / n)
    flexible = model.aircraft.flexible_surfaces or model.aircraft.surfaces[:1]
    particles = division.shape[0]
    stiffness = np.stack(
        [
            joint_stiffness(s, link_edges(division[:, i], s.span_m))
            for i, s in enumerate(flexible[: division.shape[1]])
        ],
        axis=1,
    )
    beta = np.array([s.material.stiffness_damping_s for s in flexible[: division.shape[1]]])
    return ParameterBatch(
        division=division,
        stiffness=stiffness,
        damping=stiffness * beta[:, None, None],
        lift_factor=np.full(particles, NEUTRAL_LIFT_FACTOR),
        centre_shift=np.zeros(particles),
        profile_drag=np.full(particles, flexible[0].profile_drag),
        lag=np.full(particles, model.natural_lag_s),
    )


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


def lag_weights(lag_s: Array, step_s: float) -> Array:
    """Weights (..., 4) of one step of both of Jones' exponentials for mean lag times (...), s.

    For each of slow and fast: the decay e = exp(-h / T), and 1 - (1 - e) T / h.
    """
    weights = []
    for semichords in (1.0 / JONES_B1, 1.0 / JONES_B2):
        z = step_s / np.maximum(lag_s * semichords / JONES_MEAN_LAG, SHORTEST_LAG_S)
        weights += [np.exp(-z), 1.0 + np.expm1(-z) / z]
    return np.stack(weights, axis=-1)


def lane_constants(model: ChainModel, batch: ParameterBatch, step_s: float) -> LaneConstants:
    """Lay a batch of parameters out for the kernels and for steps of ``step_s``.

    Raises
    ------
    ValueError : half an aircraft cannot have wings of different parameters.
    """
    if model.lattice.images and batch.wing_sets > 1:
        raise ValueError("wings with parameters of their own need the whole aircraft")
    particles = batch.particles
    links = np.zeros((particles, model.links, LINK_ROWS))
    stiffness, damping, overlap = [], [], []
    touched = np.zeros((particles, model.links, 2), dtype=np.int64)
    wing = 0
    for surface, part, row in zip(
        model.aircraft.surfaces, model.lattice.lattices, model.surfaces, strict=True
    ):
        first, count = row[0], row[1]
        mine = slice(first, first + count)
        if surface.flexible:
            chosen = min(wing, batch.division.shape[1] - 1)
            wing += 1
            edges = link_edges(batch.division[:, chosen], surface.span_m)
            stiffness.append(batch.stiffness[:, chosen].reshape(particles, -1))
            damping.append(batch.damping[:, chosen].reshape(particles, -1))
            drag = batch.profile_drag
        else:
            edges = np.tile([0.0, surface.span_m], (particles, 1))
            drag = np.full(particles, surface.profile_drag)
        links[:, mine, :7] = link_masses(surface, edges)
        links[:, first + 1 : first + count, 7] = surface.span_sign * np.diff(edges, axis=1)[:, :-1]
        area, centroid = drag_areas(surface, edges)
        links[:, mine, 8] = area * drag[:, None]
        links[:, mine, 9] = centroid
        weight, middle = strip_overlap(surface, part, edges)
        overlap.append(np.stack([weight, middle], axis=-1).reshape(particles, -1))
        is_touched = weight > 0.0
        touched[:, mine, 0] = np.argmax(is_touched, axis=1)
        touched[:, mine, 1] = part.spanwise - np.argmax(is_touched[:, ::-1], axis=1)
    weights = lag_weights(batch.lag[:, None] * model.relative_chord, step_s)
    weights[..., ::2] **= 0.5  # the step carries the lag states by halves
    links[:, :, 10:] = weights
    values = np.zeros((particles, LINKS_C))
    values[:, AERO_C : AERO_C + AERO_ROWS] = np.stack([batch.lift_factor, batch.centre_shift], axis=1)
    rows = np.concatenate([values, links.reshape(particles, -1), *stiffness, *damping, *overlap], axis=1)
    low = to_lanes(touched[..., 0].astype(np.float64)).min(axis=2)
    high = to_lanes(touched[..., 1].astype(np.float64)).max(axis=2)
    return LaneConstants(to_lanes(rows), np.stack([low, high], axis=-1).astype(np.int64), particles)
