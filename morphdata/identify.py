"""What POST /identify takes and what an identification results in."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from morphdata.aircraft import EXAMPLE_AIRCRAFT, Aircraft
from morphdata.base import Document
from morphdata.execution import Execution, SpreadExecution
from morphdata.flight import EXAMPLE_FLIGHT, Flight
from morphdata.lattice import Lattice, Start, StepS
from morphdata.parameters import MAX_LINKS
from morphdata.samples import EXAMPLE_SAMPLE, Sample
from morphdata.search import WEEK_S, SwarmSearch, WarmStart
from morphdata.warnings import Warnings

MAX_SAMPLES = 64

Correction = Literal["lift_factor", "centre_shift_m", "profile_drag", "lag_s"]
Method = Literal["hybrid", "least_squares", "cma", "pso"]
Range = Annotated[
    list[Annotated[float, Field(ge=-1e15, le=1e15)]],
    Field(min_length=2, max_length=2, description="[low, high], low below high."),
]


class Bounds(Document):
    """Where the search may look; what is left out gets bounds from beam theory around the physical guess."""

    stiffness_nm_rad: Range | None = None
    damping_nms_rad: Range | None = None
    division: Range | None = Field(default=None, description="[low, high] of a link's share of the span.")
    lift_factor: Range | None = None
    centre_shift_m: Range | None = None
    profile_drag: Range | None = None
    lag_s: Range | None = None


class SoughtModel(Document):
    """A model whose parameters are sought: wings of rigid links with gimbal joints."""

    separate_wings: bool = Field(
        default=False, description="Left and right wings get parameters of their own."
    )
    aero_coefficients: list[Correction] | None = Field(
        default=None,
        max_length=4,
        description="Aerodynamic corrections that are sought; the others keep their neutral values. "
        "Left out: those that the training samples can tell, which are all, but `profile_drag` only if one "
        "is asymmetric (its sweeps differ, or it rolls or yaws, by more than 0.01 rad).",
    )
    bounds: Bounds | None = None
    lattice: Lattice = Lattice()
    step_s: StepS | None = Field(
        default=None,
        description="Longest time step. Left out: the longest of 10, 5 and 2.5 ms that holds the training "
        "samples' attitude to 5e-5 rad with the physical guess; the result's `model` says which.",
    )
    start: Start = Field(
        default="trim", description="Trim each model by itself, or start from `flight.start`."
    )


class EquivalentModel(SoughtModel):
    """The model whose parameters are sought: wings of rigid links with gimbal joints."""

    links_per_wing: int = Field(default=3, ge=1, le=MAX_LINKS)


class Search(SwarmSearch):
    """How the parameters are sought; what is left out depends on the method."""

    method: Method = "hybrid"
    particles: Annotated[int, Field(ge=1, le=100_000)] | None = None
    generations: Annotated[int, Field(ge=1, le=100_000)] | None = None
    max_seconds: Annotated[float, Field(gt=0.0, le=WEEK_S)] | None = Field(
        default=None, description="Time budget of the search; the best so far is the result."
    )
    preset: Literal["paper"] | None = Field(
        default=None, description="`paper`: 2500 particles, c1 = c2 = 1, as published."
    )


class IdentifySearch(Search):
    """How the parameters are sought, and from where."""

    warm_start: WarmStart | None = Field(
        default=None,
        description="Begin from this model instead of the physical guess, which stays among the candidates. "
        "The search then looks at fewer of them, unless `particles` says how many.",
    )


EXAMPLE_REQUEST: dict[str, Any] = {
    "aircraft": EXAMPLE_AIRCRAFT,
    "flight": EXAMPLE_FLIGHT,
    "samples": [EXAMPLE_SAMPLE],
    "model": {"links_per_wing": 3},
    "search": {"method": "hybrid", "seed": 1},
}


class SamplesRequest(Document):
    """A request to fit models to sample flights."""

    aircraft: Aircraft
    flight: Flight
    samples: list[Sample] = Field(min_length=1, max_length=MAX_SAMPLES)
    model: SoughtModel
    search: Search = Search()
    execution: Execution = Execution()


class IdentifyRequest(SamplesRequest):
    """Aircraft, flight condition and samples; model and search have good defaults."""

    model_config = ConfigDict(json_schema_extra={"examples": [EXAMPLE_REQUEST]})

    model: EquivalentModel = EquivalentModel()
    search: IdentifySearch = IdentifySearch()
    execution: SpreadExecution = SpreadExecution()


class CostEstimate(BaseModel):
    """What a search would take, to an order of magnitude."""

    samples: int
    rows: int
    parameters: int = Field(description="Unknowns of the search, of the largest model in a study.")
    flights: int = Field(description="Flights to be flown: parameter sets times samples.")
    flight_s: float = Field(description="Simulated time of all those flights.")
    core_s: float = Field(description="Computing time on one core.")


class Angles(BaseModel):
    """One number per Euler angle."""

    phi: float | None
    theta: float | None
    psi: float | None


class SampleFit(BaseModel):
    """How well one sample is met: J is the sum of squared angle errors, rad^2."""

    model_config = ConfigDict(extra="allow")

    sample: str
    role: str
    J_rigid: float | None
    J_initial: float | None
    J_identified: float | None
    rms_rad: Angles
    max_abs_rad: Angles


class AeroCorrections(BaseModel):
    """Identified aerodynamic corrections."""

    model_config = ConfigDict(extra="allow")

    lift_factor: float
    centre_shift_m: float
    profile_drag: float
    lag_s: float


class IdentifiedParameters(BaseModel):
    """The identified equivalent model."""

    model_config = ConfigDict(extra="allow")

    links_per_wing: int
    division: list[Any] = Field(description="Share of the span of each link.")
    stiffness_nm_rad: list[Any] = Field(description="Per joint [flap, torsion, lag].")
    damping_nms_rad: list[Any] = Field(description="Per joint [flap, torsion, lag].")
    aero: AeroCorrections


class SearchReport(BaseModel):
    """How the search went."""

    model_config = ConfigDict(extra="allow")

    method: str
    seed: int
    flights: int
    generations: int
    wall_s: float
    aero_coefficients: list[Correction] | None = Field(
        default=None, description="Aerodynamic corrections that were sought."
    )
    history: list[dict[str, Any]]


Interval = Annotated[list[float | None], Field(min_length=2, max_length=2)]


class Uncertainty(BaseModel):
    """How well the samples determine the parameters.

    Names are `division.1`, `stiffness_nm_rad.joint_1.flap`, `lag_s`, ...; where wings are separate, `wing_1.`
    stands before them.
    """

    model_config = ConfigDict(extra="allow")

    method: str | None = Field(
        default=None, description="`white`: the residuals are taken for independent and of one variance."
    )
    standard_error: dict[str, float | None] = Field(description="SI units; null where it is not finite.")
    interval_95: dict[str, Interval] = Field(
        default={},
        description="[low, high] of each parameter that was searched, SI units; null on a side where the "
        "samples do not bound it within the range of the search. Empty in a partial result.",
    )
    undetermined: list[str] = Field(
        default=[], description="Parameters that the samples leave open by a factor e or more."
    )
    at_bound: list[str] = Field(default=[], description="Parameters that ended at a bound of the search.")
    correlation: list[list[float]] = Field(description="Of the search coordinates.")
    unidentifiable: list[Any] = Field(
        description="Combinations of search coordinates that the samples cannot see."
    )


class IdentifyResult(BaseModel):
    """Result of an identification."""

    model_config = ConfigDict(extra="allow")

    model: IdentifiedParameters | None = Field(
        description="null in a partial result whose best model never flew the samples to fit."
    )
    fit: list[SampleFit]
    search: SearchReport
    uncertainty: Uncertainty | None = None
    warnings: Warnings = []
    cost: dict[str, Any] | None = None
    partial: bool = Field(default=False, description="The best so far of a job that did not run to its end.")
