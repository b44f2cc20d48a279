"""The shape of a flown aircraft in results."""

from __future__ import annotations

from pydantic import Field

from morphdata.base import Result

Points3 = list[list[list[float]]]
Turns = list[list[list[float]]]


class SurfaceShape(Result):
    """One surface, at each time and station along its span."""

    name: str
    at: list[float] = Field(
        description="Shares of the span, from the root; equal ones are the two sides of a joint."
    )
    axis_n_m: Points3 = Field(description="Elastic axis: [time][station], north, east, down.")
    leading_n_m: Points3 = Field(description="Leading edge, likewise.")
    trailing_n_m: Points3 = Field(description="Trailing edge, likewise.")
    quaternion_ns: Turns = Field(
        description="Attitude of each section (w, x, y, z): turns its axes, forward, right and down on the "
        "undeflected surface, to north, east, down."
    )


class FlownShape(Result):
    """Where the aircraft is and how it is bent, at chosen times: enough to draw it.

    Surfaces are flat, as in the lattice: camber, twist and deflected controls move no point.
    """

    time_s: list[float]
    position_n_m: list[list[float]] = Field(description="Reference point of the fuselage, north, east, down.")
    quaternion_nb: list[list[float]] = Field(
        description="Attitude of the fuselage (w, x, y, z): turns forward, right, down to north, east, down."
    )
    surfaces: list[SurfaceShape]


class SurfaceSections(Result):
    """The strips of a surface, whose channels are numbered from the root."""

    name: str
    at: list[float] = Field(description="Middles of the strips, shares of the span.")
    width_m: list[float] = Field(description="Along the span.")
    chord_m: list[float] = Field(description="In the middle of the strip.")
