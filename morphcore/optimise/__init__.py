"""Optimisation of morph schedules: least disturbance of the attitude within the drive's limits."""

from __future__ import annotations

from morphcore.errors import InvalidInput
from morphcore.geometry.aircraft import Aircraft, Flight
from morphcore.models.equivalent import ParameterBatch
from morphcore.models.parameters_document import parameter_batch
from morphcore.optimise.optimisation import ScheduleOptimisation
from morphcore.optimise.result import ScheduleResult
from morphcore.optimise.settings import schedule_settings
from morphcore.search.step import Step
from morphcore.stopping import Interrupted
from morphcore.threads import use_threads
from morphdata.aircraft import Aircraft as AircraftDocument
from morphdata.flight import Flight as FlightDocument
from morphdata.lattice import DEFAULT_LATTICE, Lattice
from morphdata.optimize import Limits, Morph, OptimizeRequest, ScheduleSearch, Verify, Weights
from morphdata.parameters import flown_with

__all__ = [
    "Interrupted",
    "Limits",
    "Morph",
    "ScheduleOptimisation",
    "ScheduleResult",
    "ScheduleSearch",
    "Step",
    "Weights",
    "optimisation_from_request",
    "optimise_schedule",
]


def optimise_schedule(
    aircraft: AircraftDocument,
    flight: FlightDocument,
    model: ParameterBatch,
    *,
    morph: Morph,
    limits: Limits | None = None,
    weights: Weights | None = None,
    search: ScheduleSearch | None = None,
    verify: Verify = "flexible",
    lattice: Lattice = DEFAULT_LATTICE,
) -> ScheduleResult:
    """Find the morph schedule that disturbs the attitude least, from start to end.

    Parameters
    ----------
    aircraft, flight : the aircraft and its flight condition.
    model : parameters of one equivalent model (an identification's result, ``parameters_from_document``,
        ``physical_guess``).
    morph, limits, weights, search : what is wanted, see there. verify : fly constant rate, rigid optimum and
        optimum in the flexible model too ("flexible", minutes), or not ("none").

    Raises
    ------
    InvalidInput : no schedule keeps the limits, or a setting makes no sense. TrimNotFound : a model cannot be
    trimmed.
    """
    run = ScheduleOptimisation(
        Aircraft.of(aircraft),
        Flight.of(flight),
        model,
        morph=morph,
        limits=limits,
        weights=weights,
        search=schedule_settings(search or ScheduleSearch()),
        verify=verify,
        lattice=lattice,
    )
    checkpoint = b""
    for step in run.steps():
        checkpoint = step.checkpoint
    return run.result(checkpoint)


def optimisation_from_request(request: OptimizeRequest, threads: int | None = None) -> ScheduleOptimisation:
    """The optimisation that a request (the body of ``POST /optimize``) asks for.

    Identified parameters bring their own lattice, step and start, unless others are given beside them.

    Raises
    ------
    InvalidInput : with a pointer to the field at fault.
    """
    if threads is not None:
        use_threads(threads)
    model, flown = request.model, flown_with(request.model)
    if model.known is None:
        raise InvalidInput(
            "only a service knows a model by its id",
            pointer="/model/model_id",
            hint="give the model's parameters instead",
        )
    return ScheduleOptimisation(
        Aircraft.of(request.aircraft),
        Flight.of(request.flight),
        parameter_batch(model.known),
        morph=request.morph,
        limits=request.limits,
        weights=request.weights,
        search=schedule_settings(request.search),
        verify=request.verify,
        flexible=request.flexible,
        lattice=flown.lattice,
        start=flown.start,
        step_s=flown.step_s,
    )
