"""Optimisation of morph schedules: least disturbance of the attitude within the drive's limits."""

from __future__ import annotations

from morphcore.geometry.aircraft import Aircraft, Flight, aircraft_from_document, flight_from_document
from morphcore.geometry.lattice import DEFAULT_LATTICE, LatticeSettings, lattice_settings
from morphcore.models.equivalent import ParameterBatch
from morphcore.models.parameters_document import parameters_from_document
from morphcore.optimise.optimisation import ScheduleOptimisation
from morphcore.optimise.result import ScheduleResult
from morphcore.optimise.settings import (
    FlexibleSettings,
    ScheduleSearch,
    flexible_settings,
    schedule_search,
)
from morphcore.steps import Step
from morphcore.stopping import Interrupted
from morphcore.threads import use_threads
from morphdata.optimize import Limits, Morph, OptimizeRequest, Verify, Weights
from morphdata.parameters import flown_with

__all__ = [
    "FlexibleSettings",
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
    aircraft: Aircraft,
    flight: Flight,
    model: ParameterBatch,
    *,
    morph: Morph,
    limits: Limits | None = None,
    weights: Weights | None = None,
    search: ScheduleSearch | None = None,
    verify: Verify = "flexible",
    lattice: LatticeSettings = DEFAULT_LATTICE,
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
        aircraft,
        flight,
        model,
        morph=morph,
        limits=limits,
        weights=weights,
        search=search,
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
    given, model = request.document(), request.model
    flown = flown_with(model)
    return ScheduleOptimisation(
        aircraft_from_document(given["aircraft"]),
        flight_from_document(given["flight"]),
        parameters_from_document(given["model"]["parameters"], "/model/parameters"),
        morph=request.morph,
        limits=request.limits,
        weights=request.weights,
        search=schedule_search(request.search),
        verify=request.verify,
        flexible=flexible_settings(request.flexible),
        lattice=lattice_settings(flown.lattice.model_dump(exclude_none=True)),
        start=flown.start,
        step_s=flown.step_s,
    )
