"""Points of the aircraft at which a flight reports the specific force and load factor."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Annotated

from pydantic import Field

from morphdata.base import Document, Position, Text
from morphdata.faults import Fault
from morphdata.masses import Offset, Share, place_faults

MAX_POINTS = 32

PointName = Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9_]{0,49}$")]


class Point(Document):
    """A point on the fuselage, or on a surface with which it sweeps, bends and twists."""

    name: PointName = Field(description="The end of its columns' names: `imu` in `fz_imu`.")
    position_m: Position | None = Field(
        default=None, description="On the fuselage: from the reference point, body axes."
    )
    surface: Text | None = Field(default=None, description="On a surface: its name. Needs `at`.")
    at: Share | None = Field(default=None, description="Share of the span, 0 at the root and 1 at the tip.")
    offset_m: Annotated[list[Offset], Field(min_length=2, max_length=2)] | None = Field(
        default=None, description="[aft, up] of mid-chord at `at`, along the surface's own axes, m."
    )

    def faults(self) -> Iterator[Fault]:
        """Check that the place is given once and completely."""
        yield from place_faults(self, "point")


Points = Annotated[list[Point], Field(max_length=MAX_POINTS)]


def point_faults(points: Sequence[Point], surfaces: Sequence[str]) -> Iterator[Fault]:
    """Check that names differ and that the surfaces exist; pointers are ``/0/name``.

    Parameters
    ----------
    points : sequence of Point
    surfaces : sequence of str
        Names of the aircraft's surfaces.
    """
    names = [point.name for point in points]
    for number, point in enumerate(points):
        if point.name in names[:number]:
            yield Fault(
                "given_twice",
                f"Two points are called {point.name}.",
                f"/{number}/name",
                "Give each a name of its own.",
            )
        if point.surface is not None and point.surface not in surfaces:
            yield Fault(
                "surface_unknown",
                f"There is no surface {point.surface!r}.",
                f"/{number}/surface",
                f"The surfaces are {', '.join(map(repr, surfaces))}.",
            )
