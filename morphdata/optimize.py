"""What POST /optimize takes and what the optimisation of a schedule results in."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from morphdata.aircraft import EXAMPLE_AIRCRAFT, Aircraft
from morphdata.base import Angle, Document
from morphdata.execution import Execution
from morphdata.flight import EXAMPLE_FLIGHT, Flight
from morphdata.lattice import OWN_OR_CHOSEN, Lattice, StepS
from morphdata.parameters import EXAMPLE_PARAMETERS, KnownModel
from morphdata.search import WEEK_S, SwarmSearch
from morphdata.simulate import MAX_ELEMENTS
from morphdata.warnings import Warnings

LONGEST_MORPH_S = 100.0

Weight = Annotated[float, Field(ge=0.0, le=1e6)]


class SearchedModel(KnownModel):
    """The equivalent model that is searched with."""

    step_s: StepS | None = Field(default=None, description=OWN_OR_CHOSEN)


class Morph(Document):
    """The change of shape that is wanted; all hinges follow one schedule."""

    initial_rad: Angle = 0.0
    final_rad: Angle
    duration_s: Annotated[float, Field(gt=0.0, le=LONGEST_MORPH_S)] = Field(
        description="Of the goals `minimum_time` and `pareto` the longest that is looked at."
    )
    knots: int = Field(
        default=6, ge=3, le=20, description="Of the spline, both ends included; the times between are sought."
    )
    settle_s: Annotated[float, Field(ge=0.0, le=LONGEST_MORPH_S)] = Field(
        default=2.0,
        description="How long after `duration_s` the attitude still counts, of shorter morphs too.",
    )
    free_values: bool = Field(default=False, description="Seek the angles at the knots too.")
    goal: Literal["variation", "minimum_time", "pareto"] = Field(
        default="variation",
        description="Least variation in the given duration, least duration under `max_variation_rad2`, or "
        "the front of both.",
    )
    max_variation_rad2: Annotated[float, Field(gt=0.0, le=1e6)] | None = Field(
        default=None, description="Needed for the goal `minimum_time`."
    )
    front_points: int = Field(default=7, ge=2, le=50, description="Durations on the front of `pareto`.")


class Limits(Document):
    """What no schedule may exceed; what is left out is not limited."""

    max_rate_rad_s: Annotated[float, Field(gt=0.0, le=100.0)] | None = None
    max_accel_rad_s2: Annotated[float, Field(gt=0.0, le=1e5)] | None = None
    monotonic: bool = Field(default=True, description="The rate never changes its sign.")
    max_hinge_torque_nm: Annotated[float, Field(gt=0.0, le=1e9)] | None = Field(
        default=None, description="Of any hinge's motor, in the model that is searched with."
    )


class Weights(Document):
    """Weights of the angles' squared departures in what is minimised."""

    phi: Weight = 1.0
    theta: Weight = 1.0
    psi: Weight = 1.0


class ScheduleSearch(SwarmSearch):
    """How the schedule is sought; what is left out depends on the method."""

    method: Literal["hybrid", "pso"] = "hybrid"
    particles: Annotated[int, Field(ge=1, le=10_000)] | None = None
    generations: Annotated[int, Field(ge=1, le=10_000)] | None = None
    max_seconds: Annotated[float, Field(gt=0.0, le=WEEK_S)] | None = Field(
        default=None, description="Time budget of the searches; the best so far is the result."
    )
    preset: Literal["paper"] | None = Field(
        default=None, description="`paper`: a swarm of 50 particles, c1 = c2 = 1, as published."
    )


class VerifyingModel(Document):
    """The flexible model in which the schedules are flown again."""

    elements: int = Field(default=10, ge=1, le=MAX_ELEMENTS, description="Beam elements of each wing.")
    lattice: Lattice | None = Field(default=None, description="As the equivalent model's when left out.")


EXAMPLE_OPTIMIZATION: dict[str, Any] = {
    "aircraft": EXAMPLE_AIRCRAFT,
    "flight": EXAMPLE_FLIGHT,
    "model": {"parameters": EXAMPLE_PARAMETERS},
    "morph": {"final_rad": 1.0, "duration_s": 2.0, "knots": 6, "settle_s": 2.0},
    "limits": {"max_rate_rad_s": 1.0},
    "search": {"seed": 1},
    "verify": "none",
}


class OptimizeRequest(Document):
    """Aircraft, flight condition, an equivalent model, the morph that is wanted and its limits."""

    model_config = ConfigDict(json_schema_extra={"examples": [EXAMPLE_OPTIMIZATION]})

    aircraft: Aircraft
    flight: Flight
    model: SearchedModel
    morph: Morph
    limits: Limits = Limits()
    weights: Weights = Weights()
    search: ScheduleSearch = ScheduleSearch()
    verify: Literal["flexible", "none"] = Field(
        default="flexible", description="Fly the schedules again in the flexible model: minutes."
    )
    flexible: VerifyingModel = VerifyingModel()
    execution: Execution = Execution()


class ScheduleCost(BaseModel):
    """What an optimisation would take, to an order of magnitude."""

    parameters: int = Field(description="Unknowns of the search.")
    flights: int = Field(description="Flights to be flown in the search, of the rigid model too.")
    flight_s: float = Field(description="Simulated time of all those flights.")
    core_s: float = Field(description="Computing time on one core, the flexible model's flights included.")


class FoundSchedule(BaseModel):
    """A clamped cubic spline: at rest at both ends."""

    model_config = ConfigDict(extra="allow")

    knot_time_s: list[float]
    knot_sweep_rad: list[float]


class KeptLimits(BaseModel):
    """Largest rate and acceleration that were allowed."""

    model_config = ConfigDict(extra="allow")

    max_rate_rad_s: float | None
    max_accel_rad_s2: float | None


class Variation(BaseModel):
    """Attitude variation of one schedule, rad^2, flown in each of the models; null where it was not."""

    model_config = ConfigDict(extra="allow")

    rigid: float | None = None
    equivalent: float | None = None
    flexible: float | None = None


class Variations(BaseModel):
    """The schedules that are compared."""

    model_config = ConfigDict(extra="allow")

    constant: Variation = Field(description="At constant rate.")
    rigid_optimum: Variation = Field(description="Sought with the rigid model.")
    optimum: Variation = Field(description="Sought with the equivalent model.")


class OptimizeResult(BaseModel):
    """Result of a schedule optimisation."""

    model_config = ConfigDict(extra="allow")

    schedule: FoundSchedule | None = Field(
        description="null in a partial result whose best schedule never flew to its end."
    )
    limits: KeptLimits
    variation: Variations
    reduction_percent: float | None = Field(
        description="Of the variation against constant rate, in the flexible model where both were flown in "
        "it, else in the equivalent one."
    )
    search: dict[str, Any]
    warnings: Warnings = []
    partial: bool = Field(default=False, description="The best so far of a job that did not run to its end.")
