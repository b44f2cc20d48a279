"""Result of an identification: the model, its fit of the samples, and what is known about its numbers."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field, model_validator

from morphdata.base import Result
from morphdata.identify import Correction
from morphdata.links import LinksPerWing
from morphdata.measurement import SampleMeasurement
from morphdata.renamed import FORMER_NOTE, under_both_spellings
from morphdata.uncertainty import PosteriorSummary, Profile
from morphdata.verdict import ChannelStatistics, Verdict
from morphdata.warnings import Warnings


class CostEstimate(Result):
    """What a search would take, to an order of magnitude."""

    samples: int
    rows: int
    parameters: int = Field(description="Free parameters, of the largest model in a study.")
    flights: int = Field(description="Flights to be flown: parameter sets times samples.")
    flight_s: float = Field(description="Simulated time of all those flights.")
    core_s: float = Field(description="Computing time on one core.")


class Angles(Result):
    """One number per Euler angle."""

    phi: float | None
    theta: float | None
    psi: float | None


class SampleFit(Result):
    """How well one sample is met: J is the sum of squared angle errors, rad^2."""

    sample: str
    role: str
    J_rigid: float | None
    J_initial: float | None
    J_identified: float | None
    rms_rad: Angles
    max_abs_rad: Angles
    statistics: dict[str, ChannelStatistics] = Field(
        default={}, description="Of the identified model's errors, by channel (`phi`, `theta`, `psi`)."
    )


class AeroCorrections(Result):
    """Identified aerodynamic corrections."""

    lift_factor: float = Field(description="Of all surfaces that `lift_factors` does not name.")
    lift_factors: dict[str, float] | None = Field(
        default=None, description="Of surfaces with their own, mirror images by a name for both."
    )
    ac_offset_m: float = Field(description="Aerodynamic-centre offset, forward positive.")
    centre_shift_m: float | None = Field(
        default=None,
        description=FORMER_NOTE.format(name="ac_offset_m"),
        json_schema_extra={"deprecated": True},
    )
    profile_drag: float
    lag_s: float
    zero_lift_rad: float | None = Field(
        default=None,
        description="Zero-lift angle of attack of the sections; null in results of earlier versions.",
    )
    cm0: float | None = Field(
        default=None,
        description="Moment coefficient of the sections, nose up; null in results of earlier versions.",
    )

    @model_validator(mode="before")
    @classmethod
    def _both_spellings(cls, given: Any) -> Any:
        """Complete what an earlier version has stored."""
        return under_both_spellings(given) if isinstance(given, dict) else given


class IdentifiedParameters(Result):
    """The identified equivalent model."""

    links_per_wing: LinksPerWing
    division: list[Any] = Field(description="Share of the span of each link.")
    stiffness_nm_rad: list[Any] = Field(description="Per joint [flap, torsion, edgewise].")
    damping_nms_rad: list[Any] = Field(description="Per joint [flap, torsion, edgewise].")
    aero: AeroCorrections


class LinksTried(Result):
    """A number of links per wing that was tried."""

    links_per_wing: LinksPerWing
    log_likelihood: float = Field(
        description="Natural logarithm of how likely the training samples are under this model, over how "
        "likely they are under the one that was chosen."
    )
    J_train: float = Field(description="J over the training samples, rad^2.")
    flights: int


class SearchReport(Result):
    """How the search went."""

    method: str
    seed: int
    flights: int
    generations: int
    wall_s: float
    aero_coefficients: list[Correction] | None = Field(
        default=None, description="Aerodynamic corrections that were searched."
    )
    own_lift: list[str] = Field(default=[], description="Surfaces with a lift factor of their own.")
    prior_rad: float | None = Field(
        default=None,
        description="Being off the physical guess by one search coordinate (a factor e of a stiffness) "
        "costs as much as one error of this size, rad: chosen by the training samples.",
    )
    widened: list[str] = Field(
        default=[],
        description="Parameters whose default bounds were widened because the training samples pushed "
        "against them.",
    )
    links_tried: list[LinksTried] = Field(
        default=[], description="What was tried where `links_per_wing` is `auto`."
    )
    history: list[dict[str, Any]]


Interval = Annotated[list[float | None], Field(min_length=2, max_length=2)]


class Uncertainty(Result):
    """How well the samples determine the parameters.

    Names are `division.1`, `stiffness_nm_rad.joint_1.flap`, `lag_s`, ...; where wings are separate, `wing_1.`
    stands before them. Throughout version 0.2 objects and lists of names have the former spellings, too:
    `...joint_1.lag` of `...joint_1.edgewise`, `centre_shift_m` of `ac_offset_m`.
    """

    method: str | None = Field(
        default=None,
        description="`coloured`: residuals are correlated in time, scaled by sample and angle, and three "
        "flights or more are also left out in turn. `white`: independent and of one variance.",
    )
    standard_error: dict[str, float | None] = Field(description="SI units; null where it is not finite.")
    interval_95: dict[str, Interval] = Field(
        default={},
        description="[low, high] of each parameter that was searched, SI units; null on a side where the "
        "samples do not bound it within the range of the search. Empty in a partial result.",
    )
    value: dict[str, float] = Field(
        default={},
        description="The identified values by the same names, fixed parameters included; SI units.",
    )
    cramer_rao_percent: dict[str, float | None] = Field(
        default={},
        description="Cramer-Rao bound of each searched parameter, per cent of its value: the standard error "
        "if residuals were white noise. null where the samples do not see it, or the value is 0. The "
        "interval knows that residuals are correlated and is the one to rely on.",
    )
    undetermined: list[str] = Field(
        default=[], description="Parameters whose standard deviation exceeds a factor of e."
    )
    at_bound: list[str] = Field(default=[], description="Parameters that ended at a bound of the search.")
    correlation: list[list[float]] = Field(description="Of the search coordinates.")
    unidentifiable: list[Any] = Field(
        description="Combinations of search coordinates that the samples cannot see."
    )
    posterior: PosteriorSummary | None = Field(
        default=None, description="Where `uncertainty.posterior` was requested."
    )
    profile: dict[str, Profile] = Field(
        default={}, description="Profile likelihoods of the parameters in `uncertainty.profile`."
    )


class IdentifyResult(Result):
    """Result of an identification."""

    model: IdentifiedParameters | None = Field(
        description="null in a partial result whose best model never flew the samples to fit."
    )
    fit: list[SampleFit]
    search: SearchReport
    uncertainty: Uncertainty | None = None
    verdict: Verdict | None = Field(
        default=None, description="Whether the model may be believed; null in results of earlier versions."
    )
    measurement: dict[str, SampleMeasurement] = Field(
        default={}, description="By sample: biases, delay and heading that were found, and what was free."
    )
    warnings: Warnings = Field(default=[])
    cost: dict[str, Any] | None = None
    partial: bool = Field(default=False, description="Best result so far of a job that did not finish.")
