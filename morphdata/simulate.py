"""Request and result of POST /simulate."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field

from morphdata.aircraft import EXAMPLE_AIRCRAFT, Aircraft
from morphdata.base import Document, Result
from morphdata.channel_choice import OutputChoice
from morphdata.environment import Environment
from morphdata.execution import Request
from morphdata.faults import Fault
from morphdata.flight import EXAMPLE_FLIGHT, Flight
from morphdata.history import MAX_DURATION_S, Duration
from morphdata.lattice import CHOSEN, FlightStepS, Lattice, Start
from morphdata.options import MODEL, SCHEDULE, VEHICLE, Option
from morphdata.parameters import KnownModel, flown_with
from morphdata.samplefiles.flight import MAX_ROWS, MIN_ROWS
from morphdata.schedules import EXAMPLE_SCHEDULE, Schedules
from morphdata.shape import FlownShape, SurfaceSections
from morphdata.telescopes import telescoping, unsupported_faults
from morphdata.vehicle import (
    flexible_wing_faults,
    model_surfaces_faults,
    sliding_faults,
    start_faults,
    trim_drive_faults,
)
from morphdata.warnings import Warnings

DEFAULT_ELEMENTS = 10
MAX_ELEMENTS = 100
OUTPUT_STEP_S = 0.01  # as in the example flights
MAX_STEPS = {
    "rigid": 1_200_000,
    "equivalent": 1_200_000,
    "flexible": 60_000,
}  # about ten minutes of computing
DEFAULT_STEP_S = {"rigid": 0.01, "equivalent": 0.01, "flexible": 0.001}
ROUND_OFF = 1e-9  # round-off tolerance of a number of rows or steps


class RigidModel(Document):
    """Rigid wings, without aerodynamic corrections."""

    kind: Literal["rigid"]
    lattice: Lattice | None = None
    step_s: FlightStepS | None = Field(default=None, description=CHOSEN)
    start: Annotated[Start | None, Option("--start", MODEL)] = Field(
        default=None, description="Trim each model by itself, or start from `flight.start`."
    )


class EquivalentFlightModel(KnownModel):
    """Wings of rigid links with gimbal joints, with known parameters."""

    kind: Literal["equivalent"]


class FlexibleModel(Document):
    """Wings of geometrically exact beams: the reference, and hundreds of times slower."""

    kind: Literal["flexible"]
    elements: Annotated[int, Option("--elements", MODEL)] = Field(
        default=DEFAULT_ELEMENTS,
        ge=1,
        le=MAX_ELEMENTS,
        description="Beam elements of each wing of the flexible model.",
    )
    lattice: Lattice | None = None
    step_s: FlightStepS | None = Field(default=None, description="Default: 1 ms.")
    start: Annotated[Start | None, Option("--start", MODEL)] = Field(
        default=None, description="Trim each model by itself, or start from `flight.start`."
    )


FlightModel = Annotated[RigidModel | EquivalentFlightModel | FlexibleModel, Field(discriminator="kind")]


EXAMPLE_SIMULATION: dict[str, Any] = {
    "aircraft": EXAMPLE_AIRCRAFT,
    "flight": EXAMPLE_FLIGHT,
    "model": {"kind": "rigid"},
    "schedules": {"both": EXAMPLE_SCHEDULE},
    "duration_s": 2.5,
}


class SimulateRequest(Request, OutputChoice):
    """Aircraft, flight condition, a model, and the schedules of the drives."""

    model_config = ConfigDict(json_schema_extra={"examples": [EXAMPLE_SIMULATION]})

    aircraft: Annotated[Aircraft, Option("--aircraft", VEHICLE)] = Field(description="Aircraft.")
    flight: Annotated[Flight, Option("--flight", VEHICLE)] = Field(description="Flight condition.")
    model: FlightModel
    schedules: Schedules
    duration_s: Duration
    output_step_s: Annotated[float, Field(ge=0.0005, le=MAX_DURATION_S)] = Field(
        default=OUTPUT_STEP_S, description="Between the rows of the trajectory."
    )
    environment: Annotated[Environment | None, Option("--environment", SCHEDULE)] = Field(
        default=None, description="Gust and turbulence; default: still air."
    )

    @property
    def rows(self) -> int:
        """Rows of the trajectory."""
        return int(self.duration_s / self.output_step_s + ROUND_OFF) + 1

    @property
    def steps(self) -> int:
        """Number of time steps: a whole number between two rows, none longer than the model's."""
        longest_s = flown_with(self.model).step_s or DEFAULT_STEP_S[self.model.kind]
        return math.ceil(self.output_step_s / longest_s - ROUND_OFF) * (self.rows - 1)

    def faults(self) -> Iterator[Fault]:
        """Check that the flight can start, its drives stay in range, and its length is permitted."""
        yield from start_faults(self.flight, flown_with(self.model).start)
        yield from trim_drive_faults(self.aircraft, self.flight)
        yield from sliding_faults(self.aircraft, self.flight, flown_with(self.model).lattice)
        yield from self.schedules.drive_faults(self.aircraft.drives)
        if not MIN_ROWS <= self.rows <= MAX_ROWS:
            yield Fault(
                "too_many_rows" if self.rows > MAX_ROWS else "too_few_rows",
                f"{self.duration_s:g} s in steps of {self.output_step_s:g} s make {self.rows} rows.",
                "/output_step_s",
                f"Choose duration_s and output_step_s for {MIN_ROWS} to {MAX_ROWS} rows.",
            )
        if self.steps > MAX_STEPS[self.model.kind]:
            yield Fault(
                "too_much_work",
                f"The flight takes {self.steps} time steps of the {self.model.kind} model.",
                "/duration_s",
                f"At most {MAX_STEPS[self.model.kind]}: reduce duration_s, or choose a longer model.step_s.",
            )
        yield from unsupported_faults(
            telescoping(self.aircraft.surfaces),
            moving_air=self.environment is not None and not self.environment.still,
            channels=self.channels or [],
            flexible=self.model.kind == "flexible",
        )
        surfaces = [surface.name for surface in self.aircraft.surfaces]
        end_s = (self.rows - 1) * self.output_step_s
        yield from self.output_faults(surfaces, self.flight.gravity_m_s2, (0.0, end_s))
        if self.model.kind != "rigid":
            yield from flexible_wing_faults(self.aircraft, "nothing_to_bend")
        if isinstance(self.model, KnownModel):
            yield from model_surfaces_faults(self.aircraft, self.model.known, "/model/parameters")


class FlightCost(Result):
    """Estimated cost of a simulation, to an order of magnitude."""

    rows: int = Field(description="Of the trajectory.")
    steps: int = Field(
        description="Number of time steps, of 10 ms if the step is chosen automatically (it may be less)."
    )
    flight_s: float = Field(description="Simulated time.")
    core_s: float = Field(description="Computing time on one core.")


class FlownModel(Result):
    """The model that was flown."""

    kind: str


class TrimState(Result):
    """Start of the flight, in body axes, at the reference point."""

    alpha_rad: float
    bank_rad: float | None = Field(default=None, description="Roll angle; absent where it is zero.")
    force_b_n: list[float]
    moment_b_n_m: list[float] = Field(
        description="Beyond the moment of the thrust if the aircraft has a line of thrust."
    )
    drives_rad: dict[str, float] | None = Field(
        default=None, description="Angles found for the flight's trim drives; absent without one."
    )
    thrust_moment_b_n_m: list[float] | None = Field(
        default=None, description="Moment of the thrust by the aircraft's line of thrust, if it has one."
    )


class SimulatedTrajectory(Result):
    """Columns of the flight: those of a sample, then those of its channels, with units in their names.

    Every drive of the aircraft has its column, `fold_left_rad`.
    """

    time_s: list[float]
    sweep_left_rad: list[float] = Field(
        description="Angle of the first drive of the left side, of any kind; zeros if there is none."
    )
    sweep_right_rad: list[float] = Field(description="The same of the right side.")
    phi_rad: list[float]
    theta_rad: list[float]
    psi_rad: list[float]


class FlightSummary(Result):
    """The flight in a few numbers."""

    max_abs_rad: dict[str, float] = Field(
        description="Largest departure of each angle from its start, the heading's from a steady turn."
    )
    variation_rad2: float = Field(
        description="Sum over samples 10 ms apart of the squared departures of the three angles."
    )


class SimulateResult(Result):
    """Result of a simulation."""

    model: FlownModel
    trim: TrimState
    trajectory: SimulatedTrajectory
    drives: list[str] = Field(
        default=[], description="Names of the aircraft's drives, whose columns the trajectory has."
    )
    shape: FlownShape | None = Field(
        default=None, description="Poses at `shape_times_s`; absent if none are requested."
    )
    sections: list[SurfaceSections] | None = Field(
        default=None, description="The strips, if a channel of theirs is requested."
    )
    summary: FlightSummary
    warnings: Warnings = Field(default=[])
    cost: dict[str, Any]
