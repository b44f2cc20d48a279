"""Properties of a surface that vary along its span by rows, resolved: every row has every value."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from morphcore.geometry.section import SectionProperties
from morphdata import aircraft as documents
from morphdata.stations import Station, elastic_axes, row_chords

Array = NDArray[np.float64]
Row = tuple[float, ...]

SAME_SLOPE = 1e-12  # of the largest slope there could be: round-off of rows on one straight line

# rows of a document by the properties they replace; a list of three is about x, y, z
FIELDS: dict[str, Callable[[Station], float | None]] = {
    "ei_flap": lambda row: row.ei_flap_n_m2,
    "ei_edge": lambda row: row.ei_edge_n_m2,
    "gj": lambda row: row.gj_n_m2,
    "mass": lambda row: row.mass_per_length_kg_m,
    "inertia_x": lambda row: None if row.inertia_per_length_kg_m is None else row.inertia_per_length_kg_m[0],
    "inertia_y": lambda row: None if row.inertia_per_length_kg_m is None else row.inertia_per_length_kg_m[1],
    "inertia_z": lambda row: None if row.inertia_per_length_kg_m is None else row.inertia_per_length_kg_m[2],
}


@dataclass(frozen=True)
class SpanStations:
    """Values at shares ``at`` of the span, linear between.

    chord_m; aft_m : mid-chord, and mass_aft_m : centres of mass, aft of the root's mid-chord, m. elastic_m :
    the straight elastic axis, likewise. sections : name and values of each of `SectionProperties` that rows
    give, and ``ea`` (N). profile_drag : their mean over the area; drag_share : of it.
    """

    at: Row
    chord_m: Row
    aft_m: Row
    mass_aft_m: Row
    elastic_m: float
    sections: tuple[tuple[str, Row], ...]
    profile_drag: float
    drag_share: Row | None

    @classmethod
    def of(
        cls, document: documents.Surface, base: Callable[[Array], SectionProperties]
    ) -> SpanStations | None:
        """The rows of a document; None if it has none.

        base : section properties at given chords (stations,), as they are without rows.
        """
        rows = document.stations
        if rows is None:
            return None
        chords = row_chords(rows, *document.own_chords_m)
        own = base(np.array(chords))
        sections = {name: _filled(rows, get, getattr(own, name)) for name, get in FIELDS.items()}
        flap = np.array(sections["ei_flap"] or own.ei_flap)
        axial = 12.0 * flap / document.thickness_m**2
        if document.section is not None and document.section.ea_n is not None:
            axial = np.full(len(rows), document.section.ea_n)
        sections["ea"] = _filled(rows, lambda row: row.ea_n, axial)
        drag = _filled(rows, lambda row: row.profile_drag, np.full(len(rows), document.profile_drag))
        mean = _mean_drag(np.array([row.at for row in rows]), np.array(chords), drag)
        return cls(
            at=tuple(row.at for row in rows),
            chord_m=tuple(chords),
            aft_m=tuple(row.aft_m for row in rows),
            mass_aft_m=tuple(
                row.aft_m
                + (document.mass_axis_offset_m if row.mass_axis is None else (row.mass_axis - 0.5) * chord)
                for row, chord in zip(rows, chords, strict=True)
            ),
            elastic_m=elastic_axes(rows, chords, document.elastic_axis_offset_m)[0],
            sections=tuple((name, values) for name, values in sections.items() if values is not None),
            profile_drag=document.profile_drag if drag is None else mean,
            drag_share=tuple(value / mean for value in drag) if drag is not None and mean > 0.0 else None,
        )

    def between(self, share: Array, values: Row) -> Array:
        """Values at shares of the span, linear between the rows."""
        return np.asarray(np.interp(share, self.at, values))

    def of_section(self, share: Array, base: SectionProperties) -> SectionProperties:
        """Section properties at shares (stations,) of the span: of the rows where they give them."""
        given = {name: self.between(share, values) for name, values in self.sections if name != "ea"}
        return replace(base, **given)

    def axial(self, share: Array) -> Array | None:
        """Axial stiffness at shares of the span, N; None if no row gives it."""
        known = dict(self.sections).get("ea")
        return None if known is None else self.between(share, known)

    @property
    def kinks(self) -> Array:
        """Shares of the span at which a property changes its slope."""
        at = np.array(self.at)
        every = [self.chord_m, self.aft_m, self.mass_aft_m, *(values for _, values in self.sections)]
        if self.drag_share is not None:
            every.append(self.drag_share)
        values = np.array(every)
        slopes = np.diff(values, axis=1) / np.diff(at)
        size = np.abs(values).max(axis=1, keepdims=True) / np.diff(at).min()
        return np.asarray(at[1:-1][(np.abs(np.diff(slopes, axis=1)) > SAME_SLOPE * size).any(axis=0)])

    @property
    def mean_chord_m(self) -> float:
        """Area over span."""
        return float(np.trapezoid(self.chord_m, self.at))


def _filled(rows: Sequence[Station], get: Callable[[Station], float | None], own: Array) -> Row | None:
    """Values of all rows, the surface's own where a row has none; None if no row has one."""
    given = [get(row) for row in rows]
    if all(value is None for value in given):
        return None
    return tuple(float(own[k]) if value is None else value for k, value in enumerate(given))


def _mean_drag(at: Array, chord: Array, drag: Row | None) -> float:
    """Mean profile drag over the area: Simpson's rule is exact for a product of two straight lines."""
    if drag is None:
        return 0.0
    given = np.array(drag)
    middle = 0.25 * (chord[1:] + chord[:-1]) * (given[1:] + given[:-1])
    ends = chord[1:] * given[1:] + chord[:-1] * given[:-1]
    return float((np.diff(at) * (ends + 4.0 * middle)).sum() / 6.0 / np.trapezoid(chord, at))
