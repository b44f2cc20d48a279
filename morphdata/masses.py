"""What an aircraft carries, and what drives it: point masses and the line of thrust."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Annotated, Protocol

from pydantic import Field

from morphdata.base import Document, Position, Text
from morphdata.faults import Fault
from morphdata.inertia import Inertia, inertia_faults, inertia_matrix

MAX_POINT_MASSES = 64
MIN_FORWARD = 0.5  # cosine of 60 degrees, of a thrust's direction to the body's x axis

Share = Annotated[float, Field(ge=0.0, le=1.0)]
Offset = Annotated[float, Field(ge=-50.0, le=50.0)]


class Placed(Protocol):
    """What is on the fuselage, or on a surface."""

    @property
    def position_m(self) -> Sequence[float] | None:
        """On the fuselage."""

    @property
    def surface(self) -> str | None:
        """Name of the surface."""

    @property
    def at(self) -> float | None:
        """Share of its span."""

    @property
    def offset_m(self) -> Sequence[float] | None:
        """Of mid-chord there."""


def place_faults(placed: Placed, what: str) -> Iterator[Fault]:
    """Check that a place is given once and completely; ``what`` is placed, a word."""
    if placed.surface is None:
        for name in ("at", "offset_m"):
            if getattr(placed, name) is not None:
                yield Fault(
                    "surface_missing",
                    f"{name} is a place on a surface, but no surface is named.",
                    f"/{name}",
                    "Add surface, or give position_m on the fuselage instead.",
                )
        if placed.position_m is None and placed.at is None:
            yield Fault(
                "missing",
                f"The place of the {what} is not given.",
                "/position_m",
                "Give position_m on the fuselage, or surface and at.",
            )
    elif placed.position_m is not None:
        yield Fault(
            "given_twice",
            "position_m is a place on the fuselage, but a surface is named, too.",
            "/position_m",
            "Give either position_m, or surface and at (with offset_m).",
        )
    elif placed.at is None:
        yield Fault(
            "missing",
            "The place on the surface is not given.",
            "/at",
            "Add at, the share of the span: 0 at the root, 1 at the tip.",
        )


class PointMass(Document):
    """A mass on the fuselage, or on a surface with which it sweeps, bends and twists."""

    name: Text | None = None
    mass_kg: Annotated[float, Field(gt=0.0, le=1e7)]
    position_m: Position | None = Field(
        default=None, description="On the fuselage: its centre from the reference point, body axes."
    )
    surface: Text | None = Field(default=None, description="On a surface: its name. Needs `at`.")
    at: Share | None = Field(default=None, description="Share of the span, 0 at the root and 1 at the tip.")
    offset_m: Annotated[list[Offset], Field(min_length=2, max_length=2)] | None = Field(
        default=None, description="[aft, up] of mid-chord at `at`, along the surface's own axes, m."
    )
    inertia_kg_m2: Inertia | None = Field(
        default=None,
        description="About its own centre: three diagonal terms or 3 x 3, in body axes, on a surface in its "
        "own axes (forward, right, down on the undeflected surface). Without it, the mass is a point.",
    )

    def faults(self) -> Iterator[Fault]:
        """Check that the place is given once and completely, and that the inertia is that of a body."""
        yield from inertia_faults(self.inertia_kg_m2)
        yield from place_faults(self, "mass")


class Propulsion(Document):
    """The line along which the thrust that a trim finds acts on the fuselage, and keeps acting in flight."""

    position_m: Position | None = Field(
        default=None, description="A point of the line of thrust, from the reference point, body axes."
    )
    direction: Annotated[
        list[Annotated[float, Field(ge=-1e3, le=1e3)]], Field(min_length=3, max_length=3)
    ] = Field(default=[1.0, 0.0, 0.0], description="Of the force on the aircraft, body axes, of any length.")
    surface: Text | None = Field(default=None, description="Not supported yet.")
    at: Share | None = Field(default=None, description="Not supported yet.")

    def faults(self) -> Iterator[Fault]:
        """Check that the line is on the fuselage and that its thrust can balance drag."""
        for name in ("surface", "at"):
            if getattr(self, name) is not None:
                yield Fault(
                    "not_supported",
                    "Thrust on a surface is not supported yet.",
                    f"/{name}",
                    f"Leave {name} out, and give position_m on the fuselage.",
                )
        if self.position_m is None and self.surface is None and self.at is None:
            yield Fault("missing", "The line of thrust has no position.", "/position_m", "Add position_m.")
        length = math.sqrt(sum(x * x for x in self.direction))
        if self.direction[0] <= MIN_FORWARD * length:
            yield Fault(
                "direction_not_forward",
                "The direction of the thrust is more than 60 degrees off the body's forward axis.",
                "/direction",
                "Give the direction of the force on the aircraft: [1, 0, 0] is forward, also for a pusher.",
            )


def mass_faults(masses: Sequence[PointMass], surfaces: Sequence[str]) -> Iterator[Fault]:
    """Check that the surfaces that carry point masses exist.

    Parameters
    ----------
    masses : sequence of PointMass
    surfaces : sequence of str
        Names of the aircraft's surfaces.
    """
    for number, mass in enumerate(masses):
        if mass.surface is not None and mass.surface not in surfaces:
            yield Fault(
                "surface_unknown",
                f"There is no surface {mass.surface!r}.",
                f"/point_masses/{number}/surface",
                f"The surfaces are {', '.join(map(repr, surfaces))}.",
            )


Carried = list[tuple[float, ...]]


def reflected_masses(masses: Sequence[PointMass], surface: str) -> tuple[Carried, Carried]:
    """What a surface carries, as sorted rows of plain numbers, and the same mirrored to the other side."""
    own, images = [], []
    for mass in masses:
        if mass.surface == surface and mass.at is not None:
            (xx, xy, xz), (_, yy, yz), (*_, zz) = inertia_matrix(mass.inertia_kg_m2 or [0.0, 0.0, 0.0])
            place = (mass.at, mass.mass_kg, *(mass.offset_m or [0.0, 0.0]))
            own.append((*place, xx, yy, zz, xy, xz, yz))
            images.append((*place, xx, yy, zz, -xy, xz, -yz))
    return sorted(own), sorted(images)
