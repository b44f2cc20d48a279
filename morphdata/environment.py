"""Gust and turbulence along a flight."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated

from pydantic import Field

from morphdata.base import Document
from morphdata.faults import Fault
from morphdata.history import Moment
from morphdata.search import MAX_SEED

GustSpeed = Annotated[float, Field(ge=-100.0, le=100.0)]
Direction = Annotated[
    list[Annotated[float, Field(ge=-1e3, le=1e3)]], Field(min_length=3, max_length=3)
]  # of any length


class Gust(Document):
    """A gust of the shape 1 - cos (EASA CS-25.341): frozen in the air that the aircraft crosses."""

    amplitude_m_s: GustSpeed
    gradient_m: Annotated[float, Field(gt=0.0, le=1e4)] = Field(description="From the edge to the peak.")
    start_s: Moment = Field(default=0.0, description="Time at which the aircraft meets the edge.")
    direction_n: Direction = Field(default=[0.0, 0.0, -1.0], description="Earth axes (NED); up by default.")

    def faults(self) -> Iterator[Fault]:
        """Check that the gust has a direction."""
        if not any(self.direction_n):
            yield Fault(
                "no_direction",
                "The gust has no direction.",
                "/direction_n",
                "Give a vector of any length, [0, 0, -1] for up.",
            )


class Turbulence(Document):
    """Dryden turbulence (MIL-F-8785C)."""

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
