"""The outputs that are requested of a flight: channels, points and times of the shape."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from morphcore.geometry.aircraft import Aircraft, Flight
from morphcore.geometry.lattice import surface_lattice
from morphcore.shown import Shown
from morphcore.simulate.channels import Channel, parts_of, requested_channels
from morphcore.simulate.points import points_of
from morphcore.simulate.record import Outputs, Part
from morphdata.channel_choice import parsed_choice
from morphdata.channels import channel_facts
from morphdata.faults import refuse
from morphdata.lattice import Lattice
from morphdata.points import Point

Array = NDArray[np.float64]


@dataclass(frozen=True, repr=False)
class SurfaceStrips(Shown):
    """Strips of a surface from the root: middles as shares of the span, widths across the chord, chords."""

    name: str
    at: Array
    width_m: Array
    chord_m: Array

    def to_document(self) -> dict[str, Any]:
        """JSON form."""
        own = {name: getattr(self, name).tolist() for name in ("at", "width_m", "chord_m")}
        return {"name": self.name, **own}


@dataclass(frozen=True)
class RequestedOutputs:
    """What a flight reports: channels of the trajectory, and what the model records for them."""

    channels: tuple[Channel, ...]
    outputs: Outputs

    def strips(self, aircraft: Aircraft, lattice: Lattice) -> tuple[SurfaceStrips, ...]:
        """Where the strips are, if a channel of theirs is requested."""
        if not any(channel_facts(channel.name).per == "strip" for channel in self.channels):
            return ()
        found = []
        for surface in aircraft.surfaces:
            part = surface_lattice(surface, lattice.chordwise, lattice.spanwise)
            edges = part.strip_edges_m
            at, width = 0.5 * (edges[1:] + edges[:-1]) / surface.length_m, np.diff(edges) * part.cos_sweep
            found.append(SurfaceStrips(surface.name, at, width, part.strip_chord_m))
        return tuple(found)


def requested_outputs(
    aircraft: Aircraft,
    flight: Flight,
    times_s: Array,
    channels: Sequence[str] | None,
    points: Sequence[Point] | None,
    shape_times_s: Sequence[float] | None,
) -> RequestedOutputs:
    """Find what is requested of a flight with rows at ``times_s`` (k,).

    Raises
    ------
    InvalidInput
        A channel is unknown or given twice, or this flight has none such; a point is incomplete or on no
        surface of the aircraft; a time of the shape is none of the flight's.
    """
    choice = parsed_choice(channels, points, shape_times_s)
    names = [surface.name for surface in aircraft.surfaces]
    refuse(choice.output_faults(names, flight.gravity_m_s2, (float(times_s[0]), float(times_s[-1]))))
    chosen = requested_channels(choice.channels)
    parts, places = parts_of(chosen), points_of(choice.points or [])
    of_surfaces: frozenset[Part] = frozenset({"surfaces"} if any(each.surface for each in places) else ())
    moments = np.array(choice.shape_times_s or [])
    rows = np.rint((moments - times_s[0]) / (times_s[1] - times_s[0])).astype(np.int64)
    return RequestedOutputs(chosen, Outputs(parts | of_surfaces, places, rows))
