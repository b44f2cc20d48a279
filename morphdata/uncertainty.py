"""What may be requested about the uncertainty of an identified model, and what comes back."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated

from pydantic import Field

from morphdata.base import Document, Result
from morphdata.faults import Fault

MAX_SAMPLES = 100_000
MAX_PROFILES = 40
DEFAULT_SAMPLES = 5000
DEFAULT_FLIGHTS = 100_000
DEFAULT_POINTS = 9
MAX_NAME = 200


class PosteriorSettings(Document):
    """Draws of the parameters from their posterior."""

    samples: int = Field(
        default=DEFAULT_SAMPLES,
        ge=100,
        le=MAX_SAMPLES,
        description="Effective samples of every parameter that are drawn, if the flights allow.",
    )
    max_flights: int = Field(
        default=DEFAULT_FLIGHTS,
        ge=1000,
        le=10_000_000,
        description="Parameter sets that are flown at most; the result says how many effective samples "
        "they gave.",
    )
    seed: int = Field(default=1, ge=0, le=2**32 - 1, description="Of the random numbers.")


class UncertaintySettings(Document):
    """What is computed about the uncertainty beside standard errors and intervals."""

    profile: list[Annotated[str, Field(min_length=1, max_length=MAX_NAME)]] = Field(
        default=[],
        max_length=MAX_PROFILES,
        description="Parameters, by the names in `uncertainty.interval_95` of a result, whose profile "
        "likelihoods are computed: all others are fitted anew at each of their values.",
    )
    profile_points: int = Field(
        default=DEFAULT_POINTS, ge=5, le=101, description="Values of each profiled parameter."
    )
    posterior: PosteriorSettings | None = Field(
        default=None, description="Draw from the posterior of the parameters. Left out: no draws."
    )

    def faults(self) -> Iterator[Fault]:
        """Check that no parameter is profiled twice."""
        for number, name in enumerate(self.profile):
            if name in self.profile[:number]:
                yield Fault(
                    "name_not_unique",
                    f"{name} appears twice.",
                    f"/profile/{number}",
                    "Name each parameter once.",
                )


class ParameterDraws(Result):
    """Posterior of one parameter, SI units."""

    mean: float
    standard_deviation: float
    quantile_025: float
    quantile_50: float
    quantile_975: float
    effective_samples: float
    r_hat: float | None = Field(description="Split R-hat; null where no chain has moved.")


class PosteriorSummary(Result):
    """Draws from the posterior; the file `posterior.npz` holds them."""

    draws: int = Field(description="Draws in the file, all chains together.")
    chains: int
    effective_samples: float = Field(description="Of the parameter that has the fewest.")
    r_hat: float | None = Field(description="Of the parameter that has the largest.")
    acceptance: float = Field(description="Share of proposals that flights accepted.")
    flights: int = Field(description="Parameter sets flown, for all training samples each.")
    wall_s: float
    parameters: dict[str, ParameterDraws]


class Profile(Result):
    """Profile likelihood of one parameter."""

    value: list[float] = Field(description="Values at which it was held, SI units, rising.")
    J: list[float | None] = Field(
        description="Smallest J with the parameter held there, rad^2; null where no flight ended."
    )
    rise: list[float | None] = Field(
        description="How much less likely than the best: -2 log of the likelihood ratio, prior included."
    )
    interval_95: Annotated[list[float | None], Field(min_length=2, max_length=2)] = Field(
        description="Where the rise crosses the 95 per cent point of chi-square with one degree of freedom; "
        "null on a side where it does not within the range of the search."
    )
