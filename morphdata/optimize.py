"""Request and result of POST /optimize."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import islice
from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field

from morphdata.aircraft import EXAMPLE_AIRCRAFT, Aircraft
from morphdata.base import Angle, Document, Result
from morphdata.controls import unmotorised
from morphdata.drive_keys import resolved, shown_names
from morphdata.drives import Drive, Extension, Unit, wrong_unit
from morphdata.execution import Request
from morphdata.extensions import SLIDING_LIMITS, limits_of
from morphdata.faults import Fault, InvalidInput, refuse
from morphdata.flight import EXAMPLE_FLIGHT, Flight
from morphdata.lattice import OWN_OR_CHOSEN, Lattice, StepS
from morphdata.options import LIMITS, MODEL, MORPH, SEARCH, VEHICLE, Option
from morphdata.parameters import EXAMPLE_PARAMETERS, KnownModel, flown_with
from morphdata.search import SwarmSearch
from morphdata.simulate import DEFAULT_ELEMENTS, MAX_ELEMENTS
from morphdata.vehicle import (
    flexible_wing_faults,
    model_surfaces_faults,
    moved_trim_faults,
    sliding_faults,
    start_faults,
    trim_drive_faults,
)
from morphdata.warnings import Warnings

LONGEST_MORPH_S = 100.0
SMALLEST_CHANGE_RAD = 1e-6
MAX_FLIGHTS = 2_000_000  # of one search
# nominal figures, to an order of magnitude, for settings that a request leaves to the solver
SWARM_PARTICLES, SWARM_GENERATIONS = 50, 100
SCREEN, DESCENT_STARTS, DESCENT_ITERATIONS = 16, 3, 8
SEARCHES = 2  # with the rigid model too
DURATIONS_TRIED = 10  # searches on the way to the shortest duration

Verify = Literal["flexible", "none"]
Weight = Annotated[float, Field(ge=0.0, le=1e6)]
DriveName = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]{0,45}$")]


class SearchedModel(KnownModel):
    """The equivalent model used in the search."""

    step_s: StepS | None = Field(default=None, description=OWN_OR_CHOSEN)


class Morph(Document):
    """The requested change of shape: one schedule for a kind of drive, or for a single one."""

    drive: Annotated[DriveName | None, Option("--drive", MORPH)] = Field(
        default=None,
        description="What morphs: the word of a kind of drive, `fold`, of which both sides follow the "
        "schedule, or the name of one, `fold_left`. Needed if the aircraft has several kinds; the others "
        "hold their angles.",
    )
    initial_rad: Annotated[Angle, Option("--initial", MORPH)] = Field(
        default=0.0, description="Angle of the drive before the morph, rad."
    )
    final_rad: Annotated[Angle | None, Option("--final", MORPH)] = Field(
        default=None, description="Angle of the drive at the end of the morph, rad."
    )
    initial_m: Annotated[Extension | None, Option("--initial-m", MORPH)] = Field(
        default=None, description="Of a drive that slides: its extension before the morph, m; default 0."
    )
    final_m: Annotated[Extension | None, Option("--final-m", MORPH)] = Field(
        default=None,
        description="Of a drive that slides, instead of `final_rad`: its extension at the end, m.",
    )
    duration_s: Annotated[float, Field(gt=0.0, le=LONGEST_MORPH_S), Option("--duration", MORPH)] = Field(
        description="Duration of the morph, s; for the goals `minimum_time` and `pareto` the longest that "
        "is looked at."
    )
    knots: Annotated[int, Option("--knots", MORPH)] = Field(
        default=6,
        ge=3,
        le=20,
        description="Of the spline, both ends included; the times between are searched.",
    )
    settle_s: Annotated[float, Field(ge=0.0, le=LONGEST_MORPH_S), Option("--settle", MORPH)] = Field(
        default=2.0,
        description="Time after `duration_s` in which the attitude still counts, also for shorter morphs.",
    )
    free_values: Annotated[bool, Option("--free-values", MORPH)] = Field(
        default=False, description="Also search the angles at the knots."
    )
    goal: Annotated[Literal["variation", "minimum_time", "pareto"], Option("--goal", MORPH)] = Field(
        default="variation",
        description="Least variation in the given duration, least duration under `max_variation_rad2`, or "
        "the front of both.",
    )
    max_variation_rad2: Annotated[
        Annotated[float, Field(gt=0.0, le=1e6)] | None, Option("--max-variation", MORPH)
    ] = Field(default=None, description="Maximum variation; needed for the goal `minimum_time`.")
    front_points: Annotated[int, Option("--front-points", MORPH)] = Field(
        default=7, ge=2, le=50, description="Durations on the front of `pareto`."
    )

    @property
    def unit(self) -> Unit:
        """Of the drive's history: m if it slides."""
        return "rad" if self.final_m is None else "m"

    @property
    def begin(self) -> float:
        """Angle or extension before the morph."""
        return self.initial_rad if self.final_m is None else self.initial_m or 0.0

    @property
    def end(self) -> float:
        """Angle or extension at its end."""
        return self.final_rad or 0.0 if self.final_m is None else self.final_m

    @property
    def change(self) -> float:
        """Signed change of the angle or extension."""
        return self.end - self.begin

    def named_drive(self, drives: Mapping[str, Drive]) -> str:
        """Return the drive to be moved, or its word: as given, else the only word of the aircraft."""
        return self.drive or next(iter(drives.values())).word

    def moved(self, drives: Mapping[str, Drive]) -> tuple[str, ...]:
        """List the drives of an aircraft that follow the schedule.

        Raises
        ------
        InvalidInput
            The aircraft has no such drive, or several kinds and none is named; at ``/morph/drive``.
        """
        words = list(dict.fromkeys(drive.word for drive in drives.values()))
        if self.drive is None and len(words) > 1:
            refuse(
                [
                    Fault(
                        "missing",
                        f"The aircraft has several kinds of drives: {', '.join(words)}.",
                        "/morph/drive",
                        f"Name the one to be moved: {shown_names(drives)}.",
                    )
                ]
            )
        keys, faults = resolved(words if self.drive is None else [self.drive], drives)
        refuse(replace(fault, pointer="/morph/drive") for fault in faults)
        return tuple(keys)

    def faults(self) -> Iterator[Fault]:
        """Check that the angle changes, and that the fields needed by the goal are given."""
        if self.final_rad is None and self.final_m is None:
            yield Fault(
                "missing",
                "The end of the morph is not given.",
                "/final_rad",
                "Add final_rad, or final_m for a drive that slides.",
            )
            return
        mixed = self.initial_m if self.unit == "rad" else self.final_rad or self.initial_rad or None
        if mixed is not None:
            wrong = "/initial_m" if self.unit == "rad" else "/final_rad" if self.final_rad else "/initial_rad"
            yield Fault("given_twice", "The morph has angles and extensions.", wrong, "Leave this out.")
        if abs(self.change) < SMALLEST_CHANGE_RAD:
            yield Fault(
                "nothing_to_morph",
                f"The morph begins and ends at {self.end:g} {self.unit}.",
                f"/final_{self.unit}",
                f"Give another final_{self.unit}.",
            )
        if self.goal == "minimum_time" and self.max_variation_rad2 is None:
            yield Fault(
                "missing",
                "The minimum time needs a limit of the variation.",
                "/max_variation_rad2",
                "Add it; the variation of a result at constant rate shows its order of magnitude.",
            )
        elif self.goal != "minimum_time" and self.max_variation_rad2 is not None:
            yield Fault(
                "not_used",
                f"The goal {self.goal!r} does not use max_variation_rad2.",
                "/max_variation_rad2",
                'Leave it out, or use the goal "minimum_time".',
            )


class Limits(Document):
    """Limits of all schedules; omitted quantities are not limited."""

    max_rate_rad_s: Annotated[
        Annotated[float, Field(gt=0.0, le=100.0)] | None, Option("--rate-limit", LIMITS)
    ] = Field(default=None, description="Fastest sweep rate, rad/s.")
    max_accel_rad_s2: Annotated[
        Annotated[float, Field(gt=0.0, le=1e5)] | None, Option("--accel-limit", LIMITS)
    ] = Field(default=None, description="Largest sweep acceleration, rad/s^2.")
    monotonic: Annotated[bool, Option("--monotonic", LIMITS)] = Field(
        default=True, description="The rate never changes its sign."
    )
    max_hinge_torque_nm: Annotated[
        Annotated[float, Field(gt=0.0, le=1e9)] | None, Option("--torque-limit", LIMITS)
    ] = Field(
        default=None,
        description="Largest torque of any hinge's motor, N m, in the model used in the search.",
    )
    max_rate_m_s: Annotated[
        Annotated[float, Field(gt=0.0, le=100.0)] | None, Option("--rate-limit-m", LIMITS)
    ] = Field(default=None, description="Of a drive that slides: fastest rate, m/s.")
    max_accel_m_s2: Annotated[
        Annotated[float, Field(gt=0.0, le=1e5)] | None, Option("--accel-limit-m", LIMITS)
    ] = Field(default=None, description="Of a drive that slides: largest acceleration, m/s^2.")
    max_drive_force_n: Annotated[
        Annotated[float, Field(gt=0.0, le=1e9)] | None, Option("--force-limit", LIMITS)
    ] = Field(
        default=None,
        description="Of a drive that slides: largest force of any hinge's drive, N, in the model used in the "
        "search.",
    )

    def in_unit(self, unit: Unit) -> Limits:
        """Return the limits with those of a unit under the names of angles, as searches use them."""
        if unit == "rad":
            return self
        values = {of_angle: getattr(self, name) for of_angle, name in SLIDING_LIMITS.items()}
        return self.model_copy(update=values | dict.fromkeys(SLIDING_LIMITS.values()))

    def unit_faults(self, unit: Unit) -> Iterator[Fault]:
        """Check that no limit is in the unit of another kind of drive."""
        pairs = [(name, other) if unit == "m" else (other, name) for name, other in SLIDING_LIMITS.items()]
        for wrong, right in pairs:
            if getattr(self, wrong) is not None:
                hint = f"The morph is in {unit}: give {right}."
                yield Fault("wrong_unit", f"{wrong} does not limit it.", f"/limits/{wrong}", hint)

    def shortest_morph_s(self, change: float) -> float:
        """Compute the minimum time from rest to rest: full acceleration, full rate, full braking.

        Parameters
        ----------
        change : float
            Absolute change of the angle, rad, or of the extension, m, of limits `in_unit`.

        Returns
        -------
        float
            Seconds; 0 if nothing is limited.
        """
        rate = math.inf if self.max_rate_rad_s is None else self.max_rate_rad_s
        accel = math.inf if self.max_accel_rad_s2 is None else self.max_accel_rad_s2
        if rate * rate / accel < change:
            return change / rate + rate / accel
        return 2.0 * math.sqrt(change / accel)


class Weights(Document):
    """Weights of the squared departures of roll, pitch and yaw in the objective."""

    phi: Weight = 1.0
    theta: Weight = 1.0
    psi: Weight = 1.0

    def faults(self) -> Iterator[Fault]:
        """Check that at least one weight is positive."""
        if self.phi == self.theta == self.psi == 0.0:
            yield Fault("weights_all_zero", "All weights are zero.", hint="Give one of them a weight.")


def goal_faults(morph: Morph, limits: Limits) -> Iterator[Fault]:
    """Check that limits are in the morph's unit, and a shortest duration exists where one is searched."""
    yield from limits.unit_faults(morph.unit)
    limits = limits.in_unit(morph.unit)
    if morph.goal != "variation" and limits.max_rate_rad_s is None and limits.max_accel_rad_s2 is None:
        yield Fault(
            "missing",
            f"Without a limit the goal {morph.goal!r} has no shortest duration.",
            "/limits",
            f"Give {limits_of(morph.unit)}.",
        )


class ScheduleSearch(SwarmSearch):
    """How the schedule is searched; defaults depend on the method."""

    method: Annotated[Literal["hybrid", "pso"], Option("--method", SEARCH)] = Field(
        default="hybrid", description="How the schedule is searched."
    )
    particles: Annotated[Annotated[int, Field(ge=1, le=10_000)] | None, Option("--particles", SEARCH)] = (
        Field(
            default=None,
            description="Size of the swarm, or number of schedules from which `hybrid` selects its starts.",
        )
    )
    generations: Annotated[Annotated[int, Field(ge=1, le=10_000)] | None, Option("--generations", SEARCH)] = (
        Field(default=None, description="Generations of the swarm, or iterations of `hybrid`.")
    )
    preset: Annotated[Literal["paper"] | None, Option("--preset", SEARCH)] = Field(
        default=None, description="`paper`: a swarm of 50 particles, c1 = c2 = 1, as published."
    )


class VerifyingModel(Document):
    """The flexible model used for verification."""

    elements: Annotated[int, Option("--elements", MODEL)] = Field(
        default=DEFAULT_ELEMENTS,
        ge=1,
        le=MAX_ELEMENTS,
        description="Beam elements of each wing of the flexible model.",
    )
    lattice: Lattice | None = Field(default=None, description="Default: that of the equivalent model.")


EXAMPLE_OPTIMIZATION: dict[str, Any] = {
    "aircraft": EXAMPLE_AIRCRAFT,
    "flight": EXAMPLE_FLIGHT,
    "model": {"parameters": EXAMPLE_PARAMETERS},
    "morph": {"final_rad": 1.0, "duration_s": 2.0, "knots": 6, "settle_s": 2.0},
    "limits": {"max_rate_rad_s": 1.0},
    "search": {"seed": 1},
    "verify": "none",
}


class OptimizeRequest(Request):
    """Aircraft, flight condition, an equivalent model, the requested morph and its limits."""

    model_config = ConfigDict(json_schema_extra={"examples": [EXAMPLE_OPTIMIZATION]})

    aircraft: Annotated[Aircraft, Option("--aircraft", VEHICLE)] = Field(description="Aircraft.")
    flight: Annotated[Flight, Option("--flight", VEHICLE)] = Field(description="Flight condition.")
    model: SearchedModel
    morph: Morph
    limits: Limits = Limits()
    weights: Annotated[Weights, Option("--weights", MORPH)] = Field(
        default=Weights(), description="Weights of roll, pitch and yaw in the variation."
    )
    search: ScheduleSearch = ScheduleSearch()
    verify: Annotated[Verify, Option("--verify", MODEL)] = Field(
        default="flexible", description="Fly the schedules again in the flexible model: minutes."
    )
    flexible: VerifyingModel = VerifyingModel()

    @property
    def unknowns(self) -> int:
        """Number of unknowns of the search."""
        return (self.morph.knots - 2) * (2 if self.morph.free_values else 1)

    @property
    def flights(self) -> int:
        """Number of flights of all searches, including the rigid model's, to an order of magnitude."""
        search, morph = self.search, self.morph
        if search.method == "pso" or search.preset == "paper":
            flights = (search.particles or SWARM_PARTICLES) * (search.generations or SWARM_GENERATIONS)
        else:
            iterations = search.generations or DESCENT_ITERATIONS
            flights = (search.particles or SCREEN) + DESCENT_STARTS * iterations * (self.unknowns + 1)
        durations = {"variation": 1, "minimum_time": DURATIONS_TRIED, "pareto": morph.front_points}
        return flights * SEARCHES * durations[morph.goal]

    def faults(self) -> Iterator[Fault]:
        """Check aircraft, model and morph together, and the size of the search."""
        yield from start_faults(self.flight, flown_with(self.model).start)
        yield from trim_drive_faults(self.aircraft, self.flight)
        yield from sliding_faults(self.aircraft, self.flight, flown_with(self.model).lattice)
        yield from flexible_wing_faults(self.aircraft, "nothing_to_bend")
        yield from model_surfaces_faults(self.aircraft, self.model.known, "/model/parameters")
        yield from self._hinge_faults()
        yield from self._time_faults()
        if self.flights > MAX_FLIGHTS:
            yield Fault(
                "too_much_work",
                f"The search would fly {self.flights} flights.",
                "/search/generations",
                f"At most {MAX_FLIGHTS}: choose fewer particles, generations, knots or front_points.",
            )

    def _hinge_faults(self) -> Iterator[Fault]:
        drives = self.aircraft.drives
        if not drives:
            yield Fault(
                "nothing_to_morph", "No surface has a hinge.", "/aircraft/surfaces", "Give the wings hinges."
            )
            return
        try:
            moved = self.morph.moved(drives)
        except InvalidInput as error:
            yield from error.faults
            return
        yield from moved_trim_faults(self.aircraft, self.flight, flown_with(self.model).start, moved)
        unit = self.morph.unit
        turning = [each for each in moved if drives[each].unit != unit]
        if turning:
            yield wrong_unit(drives[turning[0]], unit, f"/morph/final_{unit}")
            return
        for name, angle in (("initial", self.morph.begin), ("final", self.morph.end)):
            at = f"/morph/{name}_{unit}"
            yield from islice(filter(None, (drives[each].fault(angle, at) for each in moved)), 1)
        if self.limits.max_hinge_torque_nm is not None and (controls := unmotorised(drives, moved)):
            yield Fault(
                "no_hinge_torque",
                f"The hinge moment of the control {controls[0]!r} is not computed.",
                "/limits/max_hinge_torque_nm",
                "Leave it out: only hinges have a limit of their torque.",
            )

    def _time_faults(self) -> Iterator[Fault]:
        morph, limits = self.morph, self.limits
        min_s = limits.in_unit(morph.unit).shortest_morph_s(abs(morph.change))
        if morph.duration_s <= min_s:
            yield Fault(
                "morph_too_short",
                f"Within the limits the motion takes more than {morph.duration_s:g} s.",
                "/morph/duration_s",
                f"Give more than {min_s:.4g} s, or raise {limits_of(morph.unit)} in limits.",
            )
        yield from goal_faults(morph, limits)


class ScheduleCost(Result):
    """Estimated cost of an optimisation, to an order of magnitude."""

    parameters: int = Field(description="Free parameters.")
    flights: int = Field(description="Flights in the search, including those of the rigid model.")
    flight_s: float = Field(description="Simulated time of all those flights.")
    core_s: float = Field(description="Computing time on one core, the flexible model's flights included.")


class FoundSchedule(Result):
    """A clamped cubic spline: at rest at both ends."""

    drive: str | None = Field(
        default=None,
        description="What follows it, as `morph.drive`; null in results of earlier versions, whose aircraft "
        "had one kind of hinge.",
    )
    knot_time_s: list[float]
    knot_angle_rad: list[float] | None = Field(
        default=None,
        description="Angles at the knots; results of earlier versions have `knot_sweep_rad` only.",
    )
    knot_sweep_rad: list[float] | None = Field(
        default=None, description="The same as `knot_angle_rad`, under its former name."
    )
    knot_extension_m: list[float] | None = Field(
        default=None, description="Extensions at the knots of a drive that slides, instead of the angles."
    )


class KeptLimits(Result):
    """The allowed maximum rate and acceleration."""

    max_rate_rad_s: float | None = None
    max_accel_rad_s2: float | None = None
    max_rate_m_s: float | None = None
    max_accel_m_s2: float | None = None


class Variation(Result):
    """Attitude variation of one schedule, rad^2, in each model; null if not flown."""

    rigid: float | None = None
    equivalent: float | None = None
    flexible: float | None = None


class Variations(Result):
    """The compared schedules."""

    constant: Variation = Field(description="At constant rate.")
    rigid_optimum: Variation = Field(description="Optimised with the rigid model.")
    optimum: Variation = Field(description="Optimised with the equivalent model.")


class OptimizeResult(Result):
    """Result of a schedule optimisation."""

    schedule: FoundSchedule | None = Field(
        description="null in a partial result whose best schedule could not be flown to its end."
    )
    drives: list[str] = Field(default=[], description="Names of the drives that follow the schedule.")
    limits: KeptLimits
    variation: Variations
    reduction_percent: float | None = Field(
        description="Of the variation relative to constant rate, in the flexible model if both were flown in "
        "it, else in the equivalent one."
    )
    search: dict[str, Any]
    warnings: Warnings = Field(default=[])
    partial: bool = Field(default=False, description="Best result so far of a job that did not finish.")
