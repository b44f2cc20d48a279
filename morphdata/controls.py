"""Control surfaces: trailing edges that are drives, like hinges, and turn the air, not the structure."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Any, Literal, Protocol

from pydantic import Field, create_model

from morphdata.base import Document
from morphdata.channels import is_channel
from morphdata.drives import (
    RESERVED,
    SIDES,
    Drive,
    Hinge,
    Moved,
    OfSide,
    Unit,
    drive_name,
    drives_of,
    range_faults,
)
from morphdata.faults import Fault

MAX_CONTROLS = 8  # of one surface
CONTROL_RANGE_RAD = 0.5  # rad in either direction, if a control has no range
LARGEST_DEFLECTION_RAD = 1.0  # far beyond linear flow

Deflection = Annotated[float, Field(ge=-LARGEST_DEFLECTION_RAD, le=LARGEST_DEFLECTION_RAD)]

if TYPE_CHECKING:
    _Stretch = Document
else:
    # `from` is a word of the language, so that a class cannot declare the field
    _Stretch = create_model(
        "_Stretch",
        __base__=Document,
        **{
            "from": (
                Annotated[float, Field(ge=0.0, lt=1.0)],
                Field(description="Inboard end, as a share of the surface's span from its root."),
            ),
            "to": (
                Annotated[float, Field(gt=0.0, le=1.0)],
                Field(description="Outboard end, as a share of the surface's span from its root."),
            ),
        },
    )


class Control(_Stretch):
    """A trailing-edge control surface with prescribed deflection; its hinge line has a constant chord share.

    Air loads are linear in the deflection. A control has neither mass nor hinge moment.
    """

    name: Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]{0,39}$")] = Field(
        description="Name of its drive. If surfaces of both sides have a control of this name, the side is "
        "appended: `elevator` is then the drives `elevator_left` and `elevator_right`, and `elevator` moves "
        "both."
    )
    chord_fraction: Annotated[float, Field(ge=0.05, le=0.9)] = Field(
        description="Chord behind the hinge line, as a share of the chord."
    )
    min_rad: Deflection = Field(
        default=-CONTROL_RANGE_RAD, description="Smallest angle; samples beyond it are refused."
    )
    max_rad: Deflection = Field(
        default=CONTROL_RANGE_RAD, description="Largest angle; samples beyond it are refused."
    )
    angle_rad: Deflection = Field(default=0.0, description="Angle held if no history is given.")
    mirror: Literal["symmetric", "antisymmetric"] = Field(
        default="symmetric",
        description="Whether a positive angle moves the trailing edge down on both sides, or, like that of "
        "ailerons, down on the right and up on the left.",
    )

    @property
    def start(self) -> float:
        """Inboard end, share of the span."""
        return float(getattr(self, "from"))

    @property
    def stop(self) -> float:
        """Outboard end, share of the span."""
        return float(getattr(self, "to"))  # noqa: B009 - declared by `create_model`

    @property
    def low(self) -> float:
        """Smallest angle, rad."""
        return self.min_rad

    @property
    def high(self) -> float:
        """Largest angle, rad."""
        return self.max_rad

    @property
    def held(self) -> float:
        """Angle held if no history is given, rad."""
        return self.angle_rad

    @property
    def unit(self) -> Unit:
        """Of its history."""
        return "rad"

    def sign(self, side: str) -> float:
        """+1 if a positive angle moves the trailing edge of a surface on a given side down, else -1."""
        return -1.0 if self.mirror == "antisymmetric" and side == "left" else 1.0

    def faults(self) -> Iterator[Fault]:
        """Check that the stretch of span and the range have a width, and the range holds the held angle."""
        if self.start >= self.stop:
            yield Fault(
                "range_upside_down",
                f"from {self.start:g} is not below to {self.stop:g}.",
                "/from",
                "Both are shares of the span from the root: give the inboard end first.",
            )
        yield from range_faults("control", self.min_rad, self.max_rad, self.angle_rad)


Controls = Annotated[list[Control], Field(min_length=1, max_length=MAX_CONTROLS)]


class Controlled(OfSide, Protocol):
    """A surface with its hinges and controls."""

    @property
    def all_hinges(self) -> Sequence[Hinge]:
        """From the fuselage outward."""

    @property
    def all_controls(self) -> Sequence[Control]:
        """In the document's order."""


def control_names(surfaces: Sequence[Controlled]) -> dict[tuple[int, int], str]:
    """Return the name of each control's drive, by the numbers of its surface and of itself there.

    A word that surfaces of both sides use has the side appended, another is the name as it is.
    """
    sides: dict[str, set[Any]] = {}
    for surface in surfaces:
        for control in surface.all_controls:
            sides.setdefault(control.name, set()).add(surface.side)
    return {
        (number, place): f"{control.name}_{surface.side}" if len(sides[control.name]) > 1 else control.name
        for number, surface in enumerate(surfaces)
        for place, control in enumerate(surface.all_controls)
    }


def control_drives(controls: Iterable[tuple[str, OfSide, tuple[int, int], Moved]]) -> dict[str, Drive]:
    """Return the drives of controls, by name; arguments as of `morphdata.drives.drives_of`."""
    return {
        name: replace(drive, hinges=(), controls=drive.hinges) for name, drive in drives_of(controls).items()
    }


def overlap_faults(controls: Sequence[Control]) -> Iterator[Fault]:
    """Check that the controls of one surface have different names and do not overlap along the span."""
    names: set[str] = set()
    for place, control in enumerate(controls):
        if control.name in names:
            yield Fault(
                "name_not_unique",
                f"Two controls of this surface are called {control.name!r}.",
                f"/controls/{place}/name",
                "Rename one.",
            )
        names.add(control.name)
    along = sorted(enumerate(controls), key=lambda each: each[1].start)
    for (_, inner), (place, outer) in pairwise(along):
        if outer.start < inner.stop:
            yield Fault(
                "controls_overlap",
                f"{outer.name!r} begins at {outer.start:g} of the span, and {inner.name!r} reaches to "
                f"{inner.stop:g}.",
                f"/controls/{place}/from",
                "Controls of one surface lie side by side: correct from and to.",
            )


def control_faults(surfaces: Sequence[Controlled]) -> Iterator[Fault]:
    """Check the names of controls, and that one name means like controls."""
    words = {hinge.word for surface in surfaces for hinge in surface.all_hinges}
    words |= {drive_name(hinge, surface.side) for surface in surfaces for hinge in surface.all_hinges}
    first: dict[str, tuple[Control, str]] = {}
    for number, surface in enumerate(surfaces):
        for place, control in enumerate(surface.all_controls):
            pointer = f"/surfaces/{number}/controls/{place}"
            yield from _name_fault(control.name, words, f"{pointer}/name")
            former, owner = first.setdefault(control.name, (control, surface.name))
            for field in ("mirror", "angle_rad"):
                if getattr(former, field) != getattr(control, field):
                    yield Fault(
                        "unlike_controls",
                        f"The controls {control.name!r} of {owner!r} and {surface.name!r} differ in their "
                        f"{field}.",
                        f"{pointer}/{field}",
                        "Give one of them another name: controls of one name are moved alike.",
                    )


def _name_fault(name: str, words: set[str | None], pointer: str) -> Iterator[Fault]:
    if name in RESERVED or is_channel(name):
        yield Fault(
            "name_reserved",
            f"A control cannot be called {name!r}.",
            pointer,
            f"These names have other meanings: {', '.join(sorted(RESERVED))}, and those of channels.",
        )
    elif name.endswith(tuple(f"_{side}" for side in SIDES)):
        yield Fault(
            "wrong_side",
            f"The name of a control, {name!r}, ends with a side.",
            pointer,
            "Leave the side out of the name; where both sides have the control, it is appended.",
        )
    elif name in words or any(f"{name}_{side}" in words for side in SIDES):
        yield Fault(
            "name_not_unique",
            f"A hinge's drive is already called {name!r}.",
            pointer,
            "Give the control another name.",
        )


def unmotorised(drives: Mapping[str, Drive], names: Iterable[str]) -> list[str]:
    """Return those of some drives that are controls, whose hinge moments are not computed."""
    return [name for name in names if drives[name].controls]
