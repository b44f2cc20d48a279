"""The result of an optimisation: the schedule, its limits, and the comparison."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from morphcore.optimise.case import MorphCase
from morphcore.optimise.compared import ComparedFlight, best_found, compared_schedules
from morphcore.optimise.feasible import reached
from morphcore.optimise.flights import Flown
from morphcore.optimise.goals import Found
from morphcore.optimise.schedule_warnings import schedule_warnings
from morphcore.optimise.settings import ScheduleSettings
from morphcore.optimise.state import OptimisationState
from morphcore.optimise.units import named_in
from morphcore.shown import Shown, Summary
from morphcore.simulate.schedule import ConstantRate, Schedule, Spline
from morphcore.simulate.steady import departure
from morphdata.measurement import ANGLE_COLUMNS
from morphdata.optimize import Limits, Morph, Weights

Array = NDArray[np.float64]
Document = dict[str, Any]

SCHEDULES = ("constant", "rigid_optimum", "optimum")
MODELS = ("rigid", "equivalent", "flexible")


@dataclass(frozen=True, repr=False)
class FrontPoint(Shown):
    """One duration, s: its best schedule and variation, with that of the constant rate (rad^2).

    ``beaten`` : a shorter morph has no larger variation. ``constant`` : None if not flown or diverged.
    """

    duration_s: float
    schedule: Spline
    variation: float
    constant: float | None
    beaten: bool


@dataclass(frozen=True, repr=False)
class ScheduleResult(Shown):
    """An optimised morph with its comparison.

    drive : word or name of what the morph moves; drives : names of all drives that it moves.
    schedules : the constant rate, the rigid model's optimum (None if none), the optimum. flights :
    by model, then by schedule; None where not flown. front : all durations searched, ascending. partial : the
    best so far of a run that did not finish. warnings : as documents.
    """

    morph: Morph
    limits: Limits
    weights: Weights
    best: Found
    drive: str
    drives: tuple[str, ...]
    schedules: dict[str, Schedule | None]
    times_s: Array
    flights: dict[str, dict[str, ComparedFlight | None]]
    front: tuple[FrontPoint, ...]
    search: Document
    notes: tuple[str, ...]
    partial: bool
    warnings: tuple[Document, ...] = ()

    @property
    def lost(self) -> bool:
        """Whether the equivalent model cannot fly the optimum to its end, which makes it no valid answer."""
        return self.variation("optimum", "equivalent") is None

    @property
    def schedule(self) -> Spline:
        """The optimum."""
        found = self.schedules["optimum"]
        assert isinstance(found, Spline)  # noqa: S101 - a search produces nothing else
        return found

    def variation(self, schedule: str, model: str) -> float | None:
        """Variation of one schedule in one model, rad^2; None where it was not flown."""
        flown = self.flights[model].get(schedule)
        return None if flown is None else flown.variation

    def reduction(self, schedule: str = "optimum") -> tuple[float | None, str]:
        """Reduction of the variation against the constant rate, per cent, and the model it refers to.

        The flexible model if both schedules were flown in it, else the equivalent model.
        """
        for model in ("flexible", "equivalent"):
            constant, other = self.variation("constant", model), self.variation(schedule, model)
            if constant and other is not None:
                return 100.0 * (1.0 - other / constant), model
        return None, "equivalent"

    def summary(self) -> Summary:
        """The schedule, and its improvement over the others."""
        reduction, model = self.reduction()
        gain = "" if reduction is None else f", {reduction:.1f} % below constant rate ({model} model)"
        return Summary(
            f"ScheduleResult: {self.best.duration_s:g} s{gain}",
            {
                "drive": self.drive,
                "knot times, s": self.schedule.knot_time_s,
                f"knots, {self.morph.unit}": self.schedule.knot_angle_rad,
            },
            ("variation, rad^2", *MODELS),
            [[name, *(self.variation(name, model) for model in MODELS)] for name in SCHEDULES],
            self.notes,
        )

    def to_document(self) -> Document:
        """JSON form with the names of the API."""
        reduction, model = self.reduction()
        document: Document = {
            "schedule": None if self.lost else _knots(self.drive, self.schedule),
            "limits": self.limits.model_dump(),
            "reached": {name: self._reached(name) for name in SCHEDULES},
            "variation": {
                name: {model: self.variation(name, model) for model in MODELS} for name in SCHEDULES
            },
            "reduction_percent": reduction,
            "reduction_model": model,
            "rigid_optimum_reduction_percent": self.reduction("rigid_optimum")[0],
            "schedules": {name: _schedule_document(found) for name, found in self.schedules.items()},
            "torque": {
                name: {model: self._torque(name, model) for model in MODELS[:2]} for name in SCHEDULES
            },
            "morph": self.morph.model_dump(exclude_none=True),
            "drives": list(self.drives),
            "duration_s": self.best.duration_s,
            "weights": self.weights.model_dump(),
            "search": self.search,
            "partial": self.partial,
            "warnings": list(self.warnings),
        }
        if self.morph.goal == "pareto":
            document["pareto"] = [self._front_document(point) for point in self.front if not point.beaten]
        if self.morph.goal != "variation":
            document["searched"] = [
                self._front_document(point) | {"beaten": point.beaten} for point in self.front
            ]
        if self.notes:
            document["notes"] = list(self.notes)
        named: Document = named_in(self.morph.unit, document)
        return named | {"morph": self.morph.model_dump(exclude_none=True)}

    def curves(self) -> Document:
        """Time histories for plots and tables: the schedules and the attitude in every model."""
        schedules = {}
        for name, schedule in self.schedules.items():
            if schedule is not None:
                motion = schedule.motion(self.times_s)
                schedules[name] = {
                    "sweep_rad": motion.angle.tolist(),
                    "rate_rad_s": motion.rate.tolist(),
                    "acceleration_rad_s2": motion.acceleration.tolist(),
                }
        flights = {
            model: {name: _attitude(flight) for name, flight in flown.items() if flight is not None}
            for model, flown in self.flights.items()
        }
        return {
            "time_s": self.times_s.tolist(),
            "drive": self.drive,
            "drives": list(self.drives),
            "schedules": named_in(self.morph.unit, schedules),
            "flights": flights,
        }

    def _front_document(self, point: FrontPoint) -> Document:
        return {
            "duration_s": point.duration_s,
            "variation_rad2": point.variation,
            "constant_rad2": point.constant,
            "schedule": _knots(self.drive, point.schedule),
        }

    def _reached(self, name: str) -> Document | None:
        schedule = self.schedules[name]
        if schedule is None:
            return None
        model = "rigid" if name == "rigid_optimum" else "equivalent"
        return vars(reached(schedule)) | {"max_hinge_torque_nm": self._torque(name, model)}

    def _torque(self, schedule: str, model: str) -> float | None:
        flown = self.flights[model].get(schedule)
        return None if flown is None else flown.torque


def schedule_result(
    case: MorphCase,
    settings: ScheduleSettings,
    weights: Weights,
    state: OptimisationState,
    *,
    judged: bool = True,
) -> ScheduleResult:
    """Fly the compared schedules and, if ``judged``, compute their torques and the front's constant rates."""
    best, schedules = best_found(case, state), compared_schedules(case, state)
    named = {name: schedule for name, schedule in schedules.items() if schedule is not None}
    flights: dict[str, dict[str, ComparedFlight | None]] = {}
    benches = {model: case.flights(model) for model in ("rigid", "equivalent")}
    for model, bench in benches.items():
        torque = judged and bool(bench.moved.any())  # controls have no motors
        flown = bench.fly(list(named.values()), torque=torque)
        flights[model] = {name: _compared(flown, i, judged=torque) for i, name in enumerate(named)}
    flights["flexible"] = {item.schedule: _verified(case, item.euler) for item in state.verified}
    searched = tuple(
        sorted((f for f in state.found if f.model == "equivalent"), key=lambda item: item.duration_s)
    )
    return ScheduleResult(
        morph=case.morph,
        limits=case.limits,
        weights=weights,
        best=best,
        drive=case.word,
        drives=case.drives,
        schedules=schedules,
        times_s=benches["equivalent"].times_s,
        flights=flights,
        front=_front(case, searched, judged=judged) if case.morph.goal != "variation" else (),
        search={
            "method": settings.method,
            "seed": settings.seed,
            "unknowns": case.space(best.duration_s).dimension,
            "flights": state.flights,
            "generations": state.generation,
            "wall_s": state.wall_s,
            "search_s": state.search_s,
            "verify_s": sum(item.wall_s for item in state.verified),
            "best_cost": _number(best.cost),
            "finished": state.phase == "done",
            "history": list(state.history),
        },
        notes=tuple(
            f"{item.schedule} in the flexible model: {item.failure}"
            for item in state.verified
            if item.failure
        ),
        partial=state.phase != "done",
        warnings=schedule_warnings(case, state, schedules, flights),
    )


def _front(case: MorphCase, searched: tuple[Found, ...], *, judged: bool) -> tuple[FrontPoint, ...]:
    """All durations with a schedule; a duration is beaten unless it varies less than all shorter ones."""
    front: list[FrontPoint] = []
    minimum = np.inf
    for item in searched:
        if not item.feasible:
            continue
        constant = None
        if judged:
            flown = case.flights("equivalent").fly([case.constant(item.duration_s)], torque=False)
            constant = None if flown.diverged[0] else float(flown.variation[0])
        schedule = case.space(item.duration_s).schedule(item.point)
        beaten = item.variation >= minimum
        front.append(FrontPoint(item.duration_s, schedule, item.variation, constant, beaten))
        minimum = min(minimum, item.variation)
    return tuple(front)


def _compared(flown: Flown, i: int, *, judged: bool) -> ComparedFlight:
    lost = bool(flown.diverged[i])
    return ComparedFlight(
        flown.departure[i],
        None if lost else float(flown.variation[i]),
        _number(flown.peak_torque[i]) if judged and not lost else None,
    )


def _verified(case: MorphCase, euler: Array) -> ComparedFlight | None:
    if euler.size == 0:
        return None
    away = departure(euler, case.times_s, case.flight.turn_rate_rad_s)
    return ComparedFlight(away, float(np.sum(away**2)), None)


def _attitude(flight: ComparedFlight) -> Document:
    return {name: column.tolist() for name, column in zip(ANGLE_COLUMNS, flight.departure.T, strict=True)}


def _knots(drive: str, schedule: Spline) -> Document:
    angles = schedule.knot_angle_rad.tolist()
    return {
        "drive": drive,
        "knot_time_s": schedule.knot_time_s.tolist(),
        "knot_angle_rad": angles,
        "knot_sweep_rad": angles,  # the old name, whatever the drive
    }


def _schedule_document(schedule: Schedule | None) -> Document | None:
    """A schedule in the form used by requests."""
    if isinstance(schedule, ConstantRate):
        return {"kind": "constant_rate", **vars(schedule)}
    if isinstance(schedule, Spline):
        return {
            "kind": "spline",
            "knot_time_s": schedule.knot_time_s.tolist(),
            "knot_angle_rad": schedule.knot_angle_rad.tolist(),
        }
    return None


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
