"""Optimisation of morph schedules: minimum disturbance of the attitude within the drive's limits."""

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
    aircraft : Aircraft
        The aircraft.
    flight : Flight
        Its flight condition.
    model : ParameterBatch
        Parameters of one equivalent model: those of an identification's result, ``parameters_from_document``
        or ``physical_guess``.
    morph : Morph
        Drive, angles (rad) and duration (s) of the morph.
    limits : Limits, optional
        Limits of the drive's rate (rad/s), acceleration (rad/s^2) and torque (N m).
    weights : Weights, optional
        Weights of the goals.
    search : ScheduleSearch, optional
        Effort of the search.
    verify : {"flexible", "none"}
        Whether constant rate, rigid optimum and optimum are flown in the flexible model too, which takes
        minutes.
    lattice : Lattice
        Panels of each surface and core of their vortices.

    Returns
    -------
    ScheduleResult
        The schedule, with the attitude variation (rad^2) that it and the reference schedules cause.

    Raises
    ------
    InvalidInput
        No schedule satisfies the limits, or a setting is invalid.
    TrimNotFound
        A model cannot be trimmed.

    Examples
    --------
    >>> from morphdata.optimize import Morph
    >>> morph = Morph(final_rad=0.5, duration_s=1.0, knots=3)
    >>> best = optimise_schedule(aircraft, flight, result.parameters, morph=morph)  # doctest: +SKIP
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
    """Build the optimisation described by a request, the body of ``POST /optimize``.

    The lattice, step and start of identified parameters are used unless the request overrides them.

    Raises
    ------
    InvalidInput : with a pointer to the field at fault.
    """
    if threads is not None:
        use_threads(threads)
    model, flown = request.model, flown_with(request.model)
    if model.known is None:
        raise InvalidInput(
            "a model id can only be resolved by the service",
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
