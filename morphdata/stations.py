"""Properties of a surface that vary along its span: rows of stations."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Annotated

from pydantic import Field

from morphdata.base import Document
from morphdata.faults import Fault

MIN_STATIONS, MAX_STATIONS = 2, 64
STRAIGHT_CHORDS = 1e-6  # of the largest chord: how far the elastic axis may be from straight

Stiffness = Annotated[float, Field(gt=0.0, le=1e15)]
Chord = Annotated[float, Field(gt=0.0, le=50.0)]
Fraction = Annotated[float, Field(ge=-1.0, le=2.0)]
Inertias = Annotated[
    list[Annotated[float, Field(ge=0.0, le=1e6)]],
    Field(min_length=3, max_length=3, description="About x, y, z of the section's centre of mass."),
]


class Station(Document):
    """One row: values at a share of the span, linear between rows; others are the surface's own there."""

    at: Annotated[float, Field(ge=0.0, le=1.0)] = Field(
        description="Share of the span: 0 at the root (the first row), 1 at the tip (the last)."
    )
    chord_m: Chord | None = None
    ei_flap_n_m2: Stiffness | None = None
    ei_edge_n_m2: Stiffness | None = None
    gj_n_m2: Stiffness | None = None
    ea_n: Stiffness | None = None
    mass_per_length_kg_m: Annotated[float, Field(gt=0.0, le=1e5)] | None = None
    inertia_per_length_kg_m: Inertias | None = None
    profile_drag: Annotated[float, Field(ge=0.0, le=2.0)] | None = None
    elastic_axis: Fraction | None = Field(
        default=None, description="Share of the chord aft of the leading edge; the axis must be straight."
    )
    mass_axis: Fraction | None = Field(
        default=None, description="The sections' centres of mass: share of the chord aft of the leading edge."
    )
    aft_m: Annotated[float, Field(ge=-100.0, le=100.0)] = Field(
        default=0.0, description="Mid-chord aft of that of the root, m."
    )
    up_m: Annotated[float, Field(ge=-100.0, le=100.0)] = Field(
        default=0.0, description="Not supported yet: must be 0."
    )

    def faults(self) -> Iterator[Fault]:
        """Check that a section that can twist has a moment of inertia about the span, and is not bent up."""
        if self.inertia_per_length_kg_m is not None and self.inertia_per_length_kg_m[1] == 0.0:
            yield Fault(
                "greater_than",
                "The section has no moment of inertia about y, the span.",
                "/inertia_per_length_kg_m/1",
                "Give the moments about chord axis, span axis and normal; the second must be more than 0.",
            )
        if self.up_m != 0.0:
            yield Fault(
                "axis_not_straight",
                "up_m bends the surface out of its plane, which is not supported yet.",
                "/up_m",
                "Leave it out; a surface that rises as a whole is turned by a hinge of axis x.",
            )


def row_chords(stations: Sequence[Station], root_m: float, tip_m: float) -> list[float]:
    """Chord of each row: its own, or that of the surface, linear from root to tip."""
    return [
        row.chord_m if row.chord_m is not None else root_m + (tip_m - root_m) * row.at for row in stations
    ]


def elastic_axes(stations: Sequence[Station], chords: Sequence[float], offset_m: float) -> list[float]:
    """Elastic axis of each row, aft of the root's mid-chord, m; `offset_m` is the surface's own value."""
    return [
        row.aft_m + (offset_m if row.elastic_axis is None else (row.elastic_axis - 0.5) * chord)
        for row, chord in zip(stations, chords, strict=True)
    ]


def station_faults(
    stations: Sequence[Station], chords: tuple[float, float], offset_m: float
) -> Iterator[Fault]:
    """Check the order of a surface's rows, that they give a chord, and that the elastic axis is straight.

    Parameters
    ----------
    stations : sequence of Station
    chords : (float, float)
        The surface's own chord at root and tip, m; 0 where it has none.
    offset_m : float
        Its own elastic axis aft of mid-chord, m.
    """
    shares = [row.at for row in stations]
    wrong = next((k for k in range(1, len(shares)) if shares[k] <= shares[k - 1]), None)
    if shares[0] != 0.0:
        wrong = 0
    elif wrong is None and shares[-1] != 1.0:
        wrong = len(shares) - 1
    if wrong is not None:
        yield Fault(
            "stations_out_of_order",
            f"Row {wrong} is at {shares[wrong]:g}.",
            f"/stations/{wrong}/at",
            "Rows run from the root (0) to the tip (1), each further out than the one before.",
        )
        return
    for number, row in enumerate(stations):
        if row.chord_m is None and not all(chords):
            yield Fault(
                "missing",
                "The chord is not given here.",
                f"/stations/{number}/chord_m",
                "Give it in every row, or add chord_m (or root and tip chord) to the surface.",
            )
            return
    if stations[0].aft_m != 0.0:
        yield Fault(
            "root_moved",
            "aft_m is measured from the root's mid-chord, but not 0 at the root.",
            "/stations/0/aft_m",
            "Move the root with position_m of the surface.",
        )
        return
    own = row_chords(stations, *chords)
    axes = elastic_axes(stations, own, offset_m)
    for number, axis in enumerate(axes):
        if abs(axis - axes[0]) > STRAIGHT_CHORDS * max(own):
            straight = 0.5 + (axes[0] - stations[number].aft_m) / own[number]
            yield Fault(
                "axis_not_straight",
                f"The elastic axis lies {axis:g} m aft of the root's mid-chord, {axes[0]:g} m at the root: "
                "an axis that bends is not supported yet.",
                f"/stations/{number}/elastic_axis",
                f"On the straight axis, elastic_axis is {straight:.9g} here.",
            )
            return
