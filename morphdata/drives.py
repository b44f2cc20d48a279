"""Hinges, and the drives that move them: one prescribed history may turn several equal hinges."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal, Protocol

from pydantic import Field

from morphdata.base import Angle, Document, Position
from morphdata.channels import is_channel
from morphdata.faults import Fault
from morphdata.samplefiles.titles import ATTITUDE

HINGE_RANGE_RAD = 1.3  # rad in either direction, if a hinge has no range
MAX_HINGES = 4  # of one surface
MAX_EXTENSION_M = 100.0
WORDS = {"x": "fold", "y": "incidence", "z": "sweep"}  # words of hinges without a name
SPAN = "span"  # that of a prismatic hinge along the span
SIDES = ("left", "right")
BOTH = "both"
SWEEPS = tuple(f"{WORDS['z']}_{side}" for side in SIDES)
# columns of samples and keys of schedules with another meaning
RESERVED = frozenset({"time", *ATTITUDE, BOTH, *SIDES})
SAME_AXIS = 1e-9  # distance between two unit vectors
ANGLE_TOLERANCE_RAD = 1e-6  # measured angles are not exactly zero

ROTARY_FIELDS, SLIDING_FIELDS = ("min_rad", "max_rad", "angle_rad"), ("min_m", "max_m", "extension_m")

Side = Literal["right", "left"]
Unit = Literal["rad", "m"]
Extension = Annotated[float, Field(ge=-MAX_EXTENSION_M, le=MAX_EXTENSION_M)]
Vector = tuple[float, float, float]
Component = Annotated[float, Field(ge=-1e3, le=1e3)]


class Hinge(Document):
    """A joint with prescribed motion: z sweeps, x folds, y changes incidence, a vector is free.

    A prismatic one slides, along the surface's own span unless its axis says otherwise. If it is the last
    hinge of a surface and slides along its span, its position is the mouth of the panel in which the surface
    is hidden as far as its root lies inboard of it: only the part outboard of the mouth has air loads, all of
    it has mass.
    """

    name: Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]{0,39}$")] | None = Field(
        default=None,
        description="Name of its drive, without the side, which is appended: `droop` of a left surface is "
        "the drive `droop_left`. Without a name an x hinge is `fold`, y `incidence` and z `sweep`.",
    )
    position_m: Position = Field(
        description="From the fuselage reference point, body axes (forward, right, down), where no hinge has "
        "moved."
    )
    axis: Literal["x", "y", "z"] | Annotated[list[Component], Field(min_length=3, max_length=3)] | None = (
        Field(
            default=None,
            description="A letter turns mirror images alike: a positive angle moves the tip aft (z) or up "
            "(x), or the nose up (y). A vector in body axes, of any length, is turned about by the "
            "right-hand rule; the mirror image of [x, y, z] is [-x, y, -z]. A prismatic hinge needs none to "
            "slide along the surface's span; x, y, z slide it forward, outward, down, a vector along itself "
            "(mirror image: [x, -y, z]).",
        )
    )
    kind: Literal["revolute", "prismatic"] = Field(
        default="revolute", description="`prismatic`: it slides, and its history is in m."
    )
    min_rad: Angle = Field(
        default=-HINGE_RANGE_RAD, description="Smallest angle; samples beyond it are refused."
    )
    max_rad: Angle = Field(
        default=HINGE_RANGE_RAD, description="Largest angle; samples beyond it are refused."
    )
    angle_rad: Angle = Field(default=0.0, description="Angle held if no history is given.")
    min_m: Extension | None = Field(
        default=None, description="Of a prismatic hinge: smallest extension, default 0."
    )
    max_m: Extension | None = Field(default=None, description="Of a prismatic hinge: largest extension.")
    extension_m: Extension | None = Field(
        default=None, description="Of a prismatic hinge: extension held if no history is given, default 0."
    )

    @property
    def is_prismatic(self) -> bool:
        """Whether it slides."""
        return self.kind == "prismatic"

    @property
    def unit(self) -> Unit:
        """Of its history."""
        return "m" if self.is_prismatic else "rad"

    @property
    def low(self) -> float:
        """Smallest angle or extension, rad or m."""
        return self.min_m or 0.0 if self.is_prismatic else self.min_rad

    @property
    def high(self) -> float:
        """Largest angle or extension, rad or m."""
        return self.max_m or 0.0 if self.is_prismatic else self.max_rad

    @property
    def held(self) -> float:
        """Angle or extension held if no history is given, rad or m."""
        return self.extension_m or 0.0 if self.is_prismatic else self.angle_rad

    @property
    def word(self) -> str | None:
        """Name without the side; None for an unnamed hinge about a vector."""
        if self.is_prismatic:
            return self.name or (SPAN if self.axis in (None, "y") else None)
        return self.name or (WORDS[self.axis] if isinstance(self.axis, str) else None)

    def axis_B(self, side: str, line_B: Vector | None = None) -> Vector:
        """Unit vector in body axes about which (or along which) it moves a surface on a given side.

        line_B : that of the surface's span, outward, along which a prismatic hinge without an axis slides.
        """
        sign = 1.0 if side == "right" else -1.0
        if self.axis is None:
            return line_B or (0.0, sign, 0.0)
        if isinstance(self.axis, str):
            if self.is_prismatic:
                return {"x": (1.0, 0.0, 0.0), "y": (0.0, sign, 0.0), "z": (0.0, 0.0, 1.0)}[self.axis]
            return {"x": (-sign, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, sign)}[self.axis]
        x, y, z = self.axis
        length = math.hypot(x, y, z)
        return x / length, y / length, z / length

    def faults(self) -> Iterator[Fault]:
        """Check that the axis has a direction, the range a width, and that it contains the held angle."""
        if self.axis is None and not self.is_prismatic:
            yield Fault(
                "missing",
                "The hinge has no axis.",
                "/axis",
                "Give x (fold), y (incidence), z (sweep) or a vector; only a prismatic hinge needs none.",
            )
        if isinstance(self.axis, list):
            if not any(self.axis):
                yield Fault(
                    "axis_zero", "The axis has no direction.", "/axis", "Give x, y, z or a vector, not zero."
                )
            if self.name is None:
                yield Fault(
                    "missing",
                    "A hinge about a vector needs a name.",
                    "/name",
                    'Name its drive, for example "cant"; only x, y and z have default names.',
                )
        elif self.is_prismatic and self.word is None:
            yield Fault(
                "missing",
                f"A hinge that slides along {self.axis} needs a name.",
                "/name",
                'Name its drive, for example "shift"; only one along the span has a default name.',
            )
        yield from self._unit_faults()

    def _unit_faults(self) -> Iterator[Fault]:
        """Check that range and held value are in the unit of the hinge's kind, and sound."""
        of_other = ROTARY_FIELDS if self.is_prismatic else SLIDING_FIELDS
        fields = type(self).model_fields
        wrong = [name for name in of_other if getattr(self, name) != fields[name].default]
        for name in wrong:
            meant = dict(zip(ROTARY_FIELDS + SLIDING_FIELDS, SLIDING_FIELDS + ROTARY_FIELDS, strict=True))[
                name
            ]
            yield Fault(
                "wrong_unit",
                f"A {self.kind} hinge has no {name}.",
                f"/{name}",
                f"It moves in {self.unit}: give {meant}.",
            )
        if wrong:
            return
        if self.is_prismatic and self.max_m is None:
            yield Fault(
                "missing", "A prismatic hinge needs max_m.", "/max_m", "Give its largest extension, in m."
            )
        else:
            yield from range_faults("hinge", self.low, self.high, self.held, self.unit)


def range_faults(what: str, low: float, high: float, held: float, unit: Unit = "rad") -> Iterator[Fault]:
    """Check that the range of a drive, rad or m, has a width and holds the held value."""
    lowest, highest, field = ROTARY_FIELDS if unit == "rad" else SLIDING_FIELDS
    if low >= high:
        yield Fault(
            "range_upside_down",
            f"{lowest} {low:g} is not below {highest} {high:g}.",
            f"/{lowest}",
            "Swap them, or correct one.",
        )
    elif not low <= held <= high:
        noun = "an angle" if unit == "rad" else "an extension"
        yield Fault(
            "angle_out_of_range",
            f"The {what} is held at {held:g} {unit}, and goes from {low:g} to {high:g} {unit}.",
            f"/{field}",
            f"Give {noun} inside the range, or widen {lowest} and {highest}.",
        )


class OfSide(Protocol):
    """The part of a surface that determines the names of drives."""

    @property
    def name(self) -> str:
        """Of the surface."""

    @property
    def side(self) -> Any:
        """Right or left."""


class Moved(Protocol):
    """The range of a hinge or control, from a document or from the numerics."""

    @property
    def low(self) -> float:
        """Smallest value."""

    @property
    def high(self) -> float:
        """Largest value."""

    @property
    def held(self) -> float:
        """Held if no history is given."""

    @property
    def unit(self) -> Unit:
        """Of these."""


class Hinged(OfSide, Protocol):
    """A surface with its hinges."""

    @property
    def all_hinges(self) -> Sequence[Hinge]:
        """From the fuselage outward."""

    def hinge_pointer(self, number: int) -> str:
        """JSON pointer of a hinge in the surface's document."""


@dataclass(frozen=True, slots=True)
class Drive:
    """A prescribed input: the hinges, or the control surfaces, turned by one history.

    Attributes
    ----------
    name : str
        Key of its history, `sweep_left`.
    word : str
        The name without the side, `sweep`, for both sides together.
    side : str
    surfaces : tuple of str
        Names of the surfaces it moves, in the aircraft's order.
    hinges : tuple of (int, int)
        Number of the surface and of the hinge on it, each from 0; none of a control.
    low, high : float
        Range that all its hinges allow, in its unit.
    held : float
        Angle or extension of its hinges if no history is given.
    controls : tuple of (int, int)
        Number of the surface and of the control on it, each from 0; none of a hinge.
    unit : {"rad", "m"}
        Of its history: m for prismatic hinges.
    """

    name: str
    word: str
    side: str
    surfaces: tuple[str, ...]
    hinges: tuple[tuple[int, int], ...]
    low: float
    high: float
    held: float
    controls: tuple[tuple[int, int], ...] = ()
    unit: Unit = "rad"

    def fault(self, angle_rad: float, pointer: str, furthest_rad: float = 0.0) -> Fault | None:
        """Return the fault of an angle of the drive; None if it is in range.

        ``furthest_rad`` : the largest angle of its column, which may show its unit.
        """
        if self.low - ANGLE_TOLERANCE_RAD <= angle_rad <= self.high + ANGLE_TOLERANCE_RAD:
            return None
        part = "control" if self.controls else "hinge"
        of = f"Its {part} on" if len(self.surfaces) == 1 else f"Its {part}s on"
        hint = f"{of} {' and '.join(map(repr, self.surfaces))} {'goes' if len(self.surfaces) == 1 else 'go'} "
        hint += f"from {self.low:g} to {self.high:g} {self.unit}."
        if self.unit == "m":
            return Fault(
                "extension_out_of_range",
                f"{self.name} is {angle_rad:g} m.",
                pointer,
                f"{hint} Correct the extension, or the hinge's min_m and max_m.",
            )
        if max(abs(angle_rad), abs(furthest_rad)) > math.pi:
            hint += f" Is the angle in degrees? A column may say so in its name: {self.name}_deg."
        return Fault(
            # the old code for sweep, which clients know
            "sweep_out_of_range" if self.word == WORDS["z"] else "angle_out_of_range",
            f"{self.name} is {angle_rad:g} rad.",
            pointer,
            f"{hint} Correct the angle, or the {part}'s min_rad and max_rad.",
        )


def drive_name(hinge: Hinge, side: str) -> str:
    """Return the name of the drive that moves a hinge of a surface on a given side."""
    word = hinge.word or ""
    return word if word.endswith((f"_{SIDES[0]}", f"_{SIDES[1]}")) else f"{word}_{side}"


def without_side(name: str) -> str:
    """Return the word of a drive's name; a name without a side is itself a word.

    >>> without_side("fold_left"), without_side("fold")
    ('fold', 'fold')
    """
    return next((name.removesuffix(f"_{side}") for side in SIDES if name.endswith(f"_{side}")), name)


def drives_of(hinges: Iterable[tuple[str, OfSide, tuple[int, int], Moved]]) -> dict[str, Drive]:
    """Return the drives of hinges, by name, in the order of the hinges.

    Parameters
    ----------
    hinges : iterable of tuple
        For each, the name of its drive, its surface, the numbers of surface and hinge, and its range.
    """
    found: dict[str, Drive] = {}
    for name, surface, at, hinge in hinges:
        word = name.removesuffix(f"_{surface.side}")
        former = found.get(
            name, Drive(name, word, surface.side, (), (), -math.inf, math.inf, hinge.held, unit=hinge.unit)
        )
        found[name] = replace(
            former,
            surfaces=(*former.surfaces, surface.name),
            hinges=(*former.hinges, at),
            low=max(former.low, hinge.low),
            high=min(former.high, hinge.high),
        )
    return found


def drive_faults(surfaces: Sequence[Hinged]) -> Iterator[Fault]:
    """Check that names of drives are permitted and match their side, and that one name turns equal hinges."""
    first: dict[str, tuple[Hinge, str]] = {}
    for number, surface in enumerate(surfaces):
        for place, hinge in enumerate(surface.all_hinges):
            if hinge.word is None:
                continue  # reported as its own fault
            pointer = f"/surfaces/{number}{surface.hinge_pointer(place)}/name"
            name = drive_name(hinge, surface.side)
            if hinge.word in RESERVED or is_channel(hinge.word):
                yield Fault(
                    "name_reserved",
                    f"A drive cannot be called {hinge.word!r}.",
                    pointer,
                    f"These names have other meanings: {', '.join(sorted(RESERVED))}, and those of channels.",
                )
            elif not name.endswith(f"_{surface.side}"):
                yield Fault(
                    "wrong_side",
                    f"{surface.name!r} is on the {surface.side} side, its drive is called {name!r}.",
                    pointer,
                    "Leave the side out of the name; it is appended.",
                )
            former, owner = first.setdefault(name, (hinge, surface.name))
            apart = math.dist(former.axis_B(surface.side), hinge.axis_B(surface.side))
            if former.kind != hinge.kind or apart > SAME_AXIS or former.held != hinge.held:
                what = "angle_rad" if hinge.unit == "rad" else "extension_m"
                what = "kind" if former.kind != hinge.kind else "axis" if apart > SAME_AXIS else what
                yield Fault(
                    "unlike_hinges",
                    f"The drive {name!r} would turn hinges of {owner!r} and {surface.name!r} that differ in "
                    f"their {what}.",
                    pointer,
                    "Give one of them another name: a drive turns all its hinges alike.",
                )


def field_name(name: str, unit: str) -> str:
    """Return the field of a drive's history in documents: `fold_left_rad`, `span_left_m`."""
    return f"{name}_{unit}"


def wrong_unit(drive: Drive, unit: str, pointer: str) -> Fault:
    """Return the fault of a history whose unit is not that of its drive."""
    return Fault(
        "wrong_unit",
        f"{drive.name!r} {'slides' if drive.unit == 'm' else 'turns'}, and its history is in {unit}.",
        pointer,
        f"Give it in {drive.unit}, and name the column {field_name(drive.name, drive.unit)}.",
    )


def label(name: str) -> str:
    """Return the display name of a drive: `fold left`."""
    return name.replace("_", " ")


def shown_drives(names: Iterable[str]) -> list[str]:
    """Return what a listing says of the drives that move: nothing where only the sweep of both sides does.

    Both sides of a word are one entry.

    Examples
    --------
    >>> shown_drives(["sweep_left", "sweep_right"])
    []
    >>> shown_drives(["sweep_left", "sweep_right", "elevator", "fold_left"])
    ['sweep', 'elevator', 'fold_left']
    """
    names = list(dict.fromkeys(names))
    shown: dict[str, None] = {}
    for name in names:
        word = without_side(name)
        shown[word if all(f"{word}_{side}" in names for side in SIDES) else name] = None
    return [] if list(shown) == ["sweep"] else list(shown)
