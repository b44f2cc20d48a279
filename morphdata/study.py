"""Request and result of POST /study."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Annotated, Any

from pydantic import ConfigDict, Field

from morphdata.base import Result
from morphdata.faults import Fault
from morphdata.identified import Angles, IdentifiedParameters, SampleFit
from morphdata.identify import EXAMPLE_REQUEST, SamplesRequest, SearchedModel, repeated_faults
from morphdata.links import MAX_LINKS, LinksPerWing
from morphdata.measurement import SampleMeasurement
from morphdata.options import MODEL, Option
from morphdata.verdict import Verdict
from morphdata.warnings import Warnings

EXAMPLE_STUDY: dict[str, Any] = {**EXAMPLE_REQUEST, "model": {"links_per_wing": [1, 2, 3, 4]}}


class StudiedModels(SearchedModel):
    """The compared models: the same wings with different numbers of links."""

    links_per_wing: Annotated[list[LinksPerWing], Option("--links", MODEL)] = Field(
        default=[1, 2, 3, 4, 5, 6],
        min_length=1,
        max_length=MAX_LINKS,
        description="Numbers of links to compare, all different; 1 is the rigid model with its aerodynamic "
        "corrections searched. Each is one number for all flexible surfaces, or one for each by name.",
    )

    def numbers_of_links(self) -> Sequence[LinksPerWing]:
        """List the compared numbers of links per wing."""
        return self.links_per_wing

    def links_at(self) -> Iterator[tuple[str, LinksPerWing]]:
        """Give those that name surfaces, with their places in the list."""
        yield from ((f"/{number}", links) for number, links in enumerate(self.links_per_wing))

    def faults(self) -> Iterator[Fault]:
        """Check that each number of links is listed once, and check every such model."""
        yield from repeated_faults(self.links_per_wing, "/links_per_wing", "List each number once.")
        yield from super().faults()


class StudyRequest(SamplesRequest):
    """As for an identification, with a list of numbers of links.

    `search.max_seconds` applies to all of them together.
    """

    model_config = ConfigDict(json_schema_extra={"examples": [EXAMPLE_STUDY]})

    model: StudiedModels = StudiedModels()


class StudyRow(Result):
    """Accuracy and cost of one number of links per wing."""

    links_per_wing: LinksPerWing
    bodies: int = Field(description="Rigid bodies of the whole model, fuselage included.")
    parameters: int = Field(description="Unknowns of the identification.")
    J_train: float | None = Field(description="Sum of squared angle errors over the fitted flights, rad^2.")
    J_held_out: float | None = Field(
        description="The same over the held-out flights; null if there are none."
    )
    rms_rad: Angles = Field(description="Over the held-out flights, else over the fitted ones.")
    flight_s: float | None = Field(description="Median wall time of one flight of 2 s on one core.")
    identify_s: float
    flights: int
    fit: list[SampleFit]
    model: IdentifiedParameters | None = Field(
        description="null if no model of this size could fly the samples to fit."
    )
    measurement: dict[str, SampleMeasurement] = Field(
        default={}, description="Biases, delay, heading and noise by fitted sample, as of an identification."
    )
    verdict: Verdict | None = Field(default=None, description="As of an identification with this model.")
    warnings: Warnings = Field(default=[])


class Recommendation(Result):
    """The recommended number of links."""

    links_per_wing: LinksPerWing | None = Field(description="null if no model could be flown")
    reason: str


class StudyReport(Result):
    """Report of the search."""

    seed: int
    wall_s: float


class StudyResult(Result):
    """Result of a study: one row per number of links, in ascending order."""

    rows: list[StudyRow]
    recommended: Recommendation
    search: StudyReport
    warnings: Warnings = Field(
        default=[], description="Of the recommended model or, if there is none, of the first row."
    )
    partial: bool = Field(default=False, description="The rows so far of a job that did not finish.")
