"""Gust and turbulence along a flight."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated

from pydantic import Field

from morphdata.base import Document
from morphdata.faults import Fault
from morphdata.history import Moment
from morphdata.search import MAX_SEED

MAX_SPANWISE_ROWS = 50

GustSpeed = Annotated[float, Field(ge=-100.0, le=100.0)]
Direction = Annotated[
    list[Annotated[float, Field(ge=-1e3, le=1e3)]], Field(min_length=3, max_length=3)
]  # of any length


class SpanwiseRow(Document):
    """Strength of a gust at one place across the flight path; linear between rows, constant beyond them."""

    y_m: Annotated[float, Field(ge=-1e3, le=1e3)] = Field(
        description="To the right of the reference point, m; negative: to the left."
    )
    factor: Annotated[float, Field(ge=-10.0, le=10.0)] = Field(description="Multiplies the amplitude.")


class Gust(Document):
    """A gust of the shape 1 - cos (EASA CS-25.341): frozen in the air that the aircraft crosses.

    Each part of the aircraft meets it when it gets there, at the flight's airspeed.
    """

    amplitude_m_s: GustSpeed
    gradient_m: Annotated[float, Field(gt=0.0, le=1e4)] = Field(description="From the edge to the peak.")
    start_s: Moment = Field(default=0.0, description="Time at which the reference point meets the edge.")
    direction_n: Direction = Field(default=[0.0, 0.0, -1.0], description="Earth axes (NED); up by default.")

    spanwise: Annotated[list[SpanwiseRow], Field(min_length=2, max_length=MAX_SPANWISE_ROWS)] | None = Field(
        default=None,
        description="Strength across the flight path, from left to right; default: the same everywhere. "
        "Factors of -1 on the left and 1 on the right make a gust that rolls the aircraft.",
    )

    def faults(self) -> Iterator[Fault]:
        """Check that the gust has a direction, and that the rows of its strength are in order."""
        if not any(self.direction_n):
            yield Fault(
                "no_direction",
                "The gust has no direction.",
                "/direction_n",
                "Give a vector of any length, [0, 0, -1] for up.",
            )
        places = [row.y_m for row in self.spanwise or ()]
        wrong = next((k for k in range(1, len(places)) if places[k] <= places[k - 1]), None)
        if wrong is not None:
            yield Fault(
                "rows_out_of_order",
                f"Row {wrong} is at {places[wrong]:g} m, the one before at {places[wrong - 1]:g} m.",
                f"/spanwise/{wrong}/y_m",
                "Rows run from left (negative) to right, each further right than the one before.",
            )


class Turbulence(Document):
    """Dryden turbulence (MIL-F-8785C), with the rolling motion of the air across the span."""

    wind_20ft_m_s: Annotated[float, Field(ge=0.0, le=100.0)] = Field(
        default=0.0,
        description="Mean wind at 20 ft, which governs low altitudes: 7.7 is light, 15.4 moderate.",
    )
    sigma_high_m_s: Annotated[float, Field(ge=0.0, le=50.0)] = Field(
        default=0.0, description="Standard deviation above 2000 ft."
    )


class Environment(Document):
    """Gust and turbulence on top of the flight's uniform wind."""

    gust: Gust | None = None
    turbulence: Turbulence | None = None
    seed: int = Field(default=1, ge=0, le=MAX_SEED, description="The same seed gives the same turbulence.")

    @property
    def still(self) -> bool:
        """Whether there is neither gust nor turbulence."""
        return self.gust is None and self.turbulence is None
