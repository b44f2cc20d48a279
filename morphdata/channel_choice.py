"""The choice of a flight's outputs in requests, and whether the flight can provide them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field

from morphdata.base import Document
from morphdata.channels import CHANNELS, channel_facts
from morphdata.faults import Fault
from morphdata.options import OUTPUT, Option
from morphdata.points import Point, Points, point_faults

if TYPE_CHECKING:
    ChannelName = str
else:  # type checkers cannot use choices from a list
    ChannelName = Literal[tuple(each.name for each in CHANNELS)]

MAX_SHAPES = 200  # times at which a flight's shape is reported
TIME_SLACK_S = 1e-9  # round-off of a time at the flight's end

RequestedChannels = Annotated[
    list[ChannelName], Field(max_length=100, json_schema_extra={"uniqueItems": True})
]
CHANNELS_TEXT = (
    "Columns of the trajectory after time, attitude and hinge angles, in this order; those of the example "
    "flights when left out."
)
ShapeTimes = Annotated[list[Annotated[float, Field(ge=-1e9, le=1e9)]], Field(max_length=MAX_SHAPES)]


class OutputChoice(Document):
    """What a flight reports besides time, attitude and angles of the drives."""

    channels: Annotated[RequestedChannels | None, Option("--channels", OUTPUT)] = Field(
        default=None, description=CHANNELS_TEXT
    )
    points: Annotated[Points | None, Option("--points", OUTPUT)] = Field(
        default=None,
        description="Points besides the reference point at which the channels fx, fy, fz, nx, ny and nz are "
        "reported, in columns that end in their names.",
    )
    shape_times_s: Annotated[ShapeTimes | None, Option("--shape-times", OUTPUT)] = Field(
        default=None,
        description="Times at which the shape of the bent aircraft is reported: that of the nearest row.",
    )

    def output_faults(
        self, surfaces: Sequence[str], gravity_m_s2: float, times_s: tuple[float, float]
    ) -> Iterator[Fault]:
        """Check what the document alone cannot know.

        Parameters
        ----------
        surfaces : sequence of str
            Names of the aircraft's surfaces.
        gravity_m_s2 : float
        times_s : pair of float
            First and last time of the flight.
        """
        for fault in channels_faults(self.channels or [], gravity_m_s2):
            yield fault.under("/channels")
        points = self.points or []
        for fault in point_faults(points, surfaces):
            yield fault.under("/points")
        if points and not any(channel_facts(name).per == "point" for name in self.channels or []):
            yield Fault(
                "points_without_channel",
                "Points are given, but channels requests nothing at points.",
                "/points",
                f"Add one of {', '.join(each.name for each in CHANNELS if each.per == 'point')} to channels, "
                "or leave points out.",
            )
        for number, time_s in enumerate(self.shape_times_s or []):
            if not times_s[0] - TIME_SLACK_S <= time_s <= times_s[1] + TIME_SLACK_S:
                yield Fault(
                    "time_out_of_range",
                    f"There is no shape at {time_s:g} s.",
                    f"/shape_times_s/{number}",
                    f"The flight lasts from {times_s[0]:g} to {times_s[1]:g} s.",
                )


def parsed_choice(
    channels: Sequence[str] | None, points: Sequence[Point] | None, shape_times_s: Sequence[float] | None
) -> OutputChoice:
    """The choice of a caller without a request document.

    Raises
    ------
    InvalidInput
        A name is unknown, or a point is incomplete.
    """
    given = {"channels": channels, "points": points, "shape_times_s": shape_times_s}
    return OutputChoice.parse({name: list(value) for name, value in given.items() if value is not None})


def channels_faults(names: Sequence[str], gravity_m_s2: float) -> Iterator[Fault]:
    """Check that each channel is requested once and that the flight can provide it; pointers are ``/0``."""
    for number, name in enumerate(names):
        facts = channel_facts(name)
        if name in names[:number]:
            yield Fault(
                "given_twice", f"The channel {name} is requested twice.", f"/{number}", "Leave one out."
            )
        elif facts.needs_gravity and gravity_m_s2 == 0.0:
            yield Fault(
                "channel_not_available",
                f"The channel {name} is a multiple of the weight, and flight.gravity_m_s2 is 0.",
                f"/{number}",
                "Request the specific force (fx, fy, fz) instead.",
            )
