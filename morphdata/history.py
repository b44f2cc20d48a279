"""What all schedules have in common: times, rates and the checks of both, whatever moves."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Annotated, ClassVar

from pydantic import Field

from morphdata.base import Document
from morphdata.drives import Unit
from morphdata.faults import Fault
from morphdata.samplefiles.flight import LONGEST_FLIGHT_S

MAX_DURATION_S = LONGEST_FLIGHT_S
MAX_KNOTS = 1000
DEFAULT_RAMP_S = 0.1

Moment = Annotated[float, Field(ge=0.0, le=MAX_DURATION_S)]
Duration = Annotated[float, Field(gt=0.0, le=MAX_DURATION_S)]
ClockTime = Annotated[float, Field(ge=-MAX_DURATION_S, le=1e6)]
Rate = Annotated[float, Field(gt=0.0, le=100.0)]


class History(Document):
    """What moves, over time.

    Attributes
    ----------
    unit : {"rad", "m"}
        Of what moves.
    values : tuple of str
        Fields that hold angles or extensions, or lists of them.
    """

    unit: ClassVar[Unit]
    values: ClassVar[tuple[str, ...]]

    @property
    def named(self) -> Iterator[tuple[float, str]]:
        """Angles or extensions that it names, with their pointers."""
        for field in self.values:
            given = getattr(self, field)
            if isinstance(given, list):
                yield from ((value, f"{field}/{row}") for row, value in enumerate(given))
            else:
                yield given, field


class AngleHistory(History):
    """Of a drive that turns."""

    unit: ClassVar[Unit] = "rad"


class ExtensionHistory(History):
    """Of a drive that slides."""

    unit: ClassVar[Unit] = "m"


def rate_faults(
    duration_s: float | None, rate: float | None, morph_s: float, ramp_s: float, unit: Unit
) -> Iterator[Fault]:
    """Check that a morph of constant rate has duration or rate, and room for its ramps.

    Parameters
    ----------
    duration_s, rate : float, optional
        As given; the rate in rad/s or m/s.
    morph_s, ramp_s : float
        Duration that follows, and that of each ramp, s.
    unit : {"rad", "m"}
        Of what moves.
    """
    field, values = f"rate_{unit}_s", "angles" if unit == "rad" else "extensions"
    if (duration_s is None) == (rate is None):
        both = duration_s is not None
        yield Fault(
            "given_twice" if both else "missing",
            f"duration_s and {field} are {'both given' if both else 'both missing'}.",
            f"/{field}" if both else "/duration_s",
            "Give one of them: the other follows.",
        )
    elif morph_s == 0.0:
        yield Fault(
            "nothing_to_morph",
            f"{field} needs two different {values}.",
            f"/final_{unit}",
            f'Give another final_{unit}, or {{"kind": "hold"}}.',
        )
    elif morph_s > MAX_DURATION_S:
        yield Fault(
            "morph_too_long",
            f"At {rate:g} {unit}/s the morph takes {morph_s:g} s.",
            f"/{field}",
            f"It must take at most {MAX_DURATION_S:g} s: morph faster.",
        )
    elif ramp_s > morph_s / 2:
        yield Fault(
            "ramp_too_long",
            f"Two ramps of {ramp_s:g} s do not fit into a morph of {morph_s:g} s.",
            "/ramp_s",
            f"Give at most {morph_s / 2:g} s, or morph more slowly.",
        )


def history_faults(schedule: Document, time: str, field: str, noun: str) -> Iterator[Fault]:
    """Check that the list ``field`` has a value (an angle: ``noun``) for every time, and that time rises."""
    times: Sequence[float] = getattr(schedule, time)
    values: Sequence[float] = getattr(schedule, field)
    if len(times) != len(values):
        yield Fault(
            "unequal_lengths",
            f"There are {len(times)} times and {len(values)} {noun}s.",
            f"/{field}",
            f"Give one {noun} for every time.",
        )
    for row, (before, after) in enumerate(pairwise(times), start=1):
        if after <= before:
            yield Fault(
                "time_not_rising",
                f"Time goes from {before:g} s to {after:g} s at row {row}.",
                f"/{time}/{row}",
                "Sort the rows by time and drop repeated ones.",
            )
            break
