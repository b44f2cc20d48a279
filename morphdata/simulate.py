"""What POST /simulate takes and what a simulation results in."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from morphdata.aircraft import EXAMPLE_AIRCRAFT, Aircraft
from morphdata.base import Document
from morphdata.execution import Request
from morphdata.flight import EXAMPLE_FLIGHT, Flight
from morphdata.lattice import CHOSEN, FlightStepS, Lattice, Start
from morphdata.options import MODEL, SCHEDULE, VEHICLE, Option
from morphdata.parameters import KnownModel
from morphdata.schedules import EXAMPLE_SCHEDULE, MAX_DURATION_S, Duration, Moment, Schedules
from morphdata.search import MAX_SEED
from morphdata.warnings import Warnings

MAX_ELEMENTS = 100

GustSpeed = Annotated[float, Field(ge=-100.0, le=100.0)]
Direction = Annotated[
    list[Annotated[float, Field(ge=-1e3, le=1e3)]], Field(min_length=3, max_length=3)
]  # of any length


class RigidModel(Document):
    """Rigid wings, without aerodynamic corrections."""

    kind: Literal["rigid"]
    lattice: Lattice | None = None
    step_s: FlightStepS | None = Field(default=None, description=CHOSEN)
    start: Annotated[Start | None, Option("--start", MODEL)] = Field(
        default=None, description="Trim each model by itself, or start from `flight.start`."
    )


class EquivalentFlightModel(KnownModel):
    """Wings of rigid links with gimbal joints, with parameters that are known."""

    kind: Literal["equivalent"]


class FlexibleModel(Document):
    """Wings of geometrically exact beams: the reference, and hundreds of times slower."""

    kind: Literal["flexible"]
    elements: Annotated[int, Option("--elements", MODEL)] = Field(
        default=10, ge=1, le=MAX_ELEMENTS, description="Beam elements of each wing of the flexible model."
    )
    lattice: Lattice | None = None
    step_s: FlightStepS | None = Field(default=None, description="1 ms where it is left out.")
    start: Annotated[Start | None, Option("--start", MODEL)] = Field(
        default=None, description="Trim each model by itself, or start from `flight.start`."
    )


FlightModel = Annotated[RigidModel | EquivalentFlightModel | FlexibleModel, Field(discriminator="kind")]


class Gust(Document):
    """A gust of the shape 1 - cos (EASA CS-25.341): frozen in the air that the aircraft crosses."""

    amplitude_m_s: GustSpeed
    gradient_m: Annotated[float, Field(gt=0.0, le=1e4)] = Field(description="From the edge to the peak.")
    start_s: Moment = Field(default=0.0, description="When the aircraft meets the edge.")
    direction_n: Direction = Field(default=[0.0, 0.0, -1.0], description="Earth axes (NED); up by default.")


class Turbulence(Document):
    """Dryden turbulence (MIL-F-8785C)."""

    wind_20ft_m_s: Annotated[float, Field(ge=0.0, le=100.0)] = Field(
        default=0.0, description="Mean wind at 20 ft, which rules low altitudes: 7.7 is light, 15.4 moderate."
    )
    sigma_high_m_s: Annotated[float, Field(ge=0.0, le=50.0)] = Field(
        default=0.0, description="Standard deviation above 2000 ft."
    )


class Environment(Document):
    """Gust and turbulence on top of the flight's uniform wind."""

    gust: Gust | None = None
    turbulence: Turbulence | None = None
    seed: int = Field(default=1, ge=0, le=MAX_SEED, description="The same seed gives the same air.")


EXAMPLE_SIMULATION: dict[str, Any] = {
    "aircraft": EXAMPLE_AIRCRAFT,
    "flight": EXAMPLE_FLIGHT,
    "model": {"kind": "rigid"},
    "schedules": {"both": EXAMPLE_SCHEDULE},
    "duration_s": 2.5,
}


class SimulateRequest(Request):
    """Aircraft, flight condition, a model, and what the hinges do."""

    model_config = ConfigDict(json_schema_extra={"examples": [EXAMPLE_SIMULATION]})

    aircraft: Annotated[Aircraft, Option("--aircraft", VEHICLE)] = Field(description="Aircraft.")
    flight: Annotated[Flight, Option("--flight", VEHICLE)] = Field(description="Flight condition.")
    model: FlightModel
    schedules: Schedules
    duration_s: Duration
    output_step_s: Annotated[float, Field(ge=0.0005, le=MAX_DURATION_S)] = Field(
        default=0.01, description="Between the rows of the trajectory."
    )
    environment: Annotated[Environment | None, Option("--environment", SCHEDULE)] = Field(
        default=None, description="Gust and turbulence; still air without."
    )


class FlightCost(BaseModel):
    """What a simulation would take, to an order of magnitude."""

    rows: int = Field(description="Of the trajectory.")
    steps: int = Field(description="Time steps: of 10 ms where they are chosen, which may become a quarter.")
    flight_s: float = Field(description="Simulated time.")
    core_s: float = Field(description="Computing time on one core.")


class FlownModel(BaseModel):
    """The model that was flown."""

    model_config = ConfigDict(extra="allow")

    kind: str


class TrimState(BaseModel):
    """How the flight starts: in body axes, at the reference point."""

    model_config = ConfigDict(extra="allow")

    alpha_rad: float
    force_b_n: list[float]
    moment_b_n_m: list[float]


class SimulatedTrajectory(BaseModel):
    """Columns of the flight: those of a sample, and body rates, velocity, position and wing tips."""

    model_config = ConfigDict(extra="allow")

    time_s: list[float]
    sweep_left_rad: list[float]
    sweep_right_rad: list[float]
    phi_rad: list[float]
    theta_rad: list[float]
    psi_rad: list[float]


class FlightSummary(BaseModel):
    """The flight in a few numbers."""

    model_config = ConfigDict(extra="allow")

    max_abs_rad: dict[str, float] = Field(description="Largest departure of each angle from its start.")
    variation_rad2: float = Field(
        description="Sum over samples 10 ms apart of the squared departures of the three angles."
    )


class SimulateResult(BaseModel):
    """Result of a simulation."""

    model_config = ConfigDict(extra="allow")

    model: FlownModel
    trim: TrimState
    trajectory: SimulatedTrajectory
    summary: FlightSummary
    warnings: Warnings = []
    cost: dict[str, Any]
