"""Optimisation of morph schedules: least disturbance of the attitude within the drive's limits."""

from __future__ import annotations

from typing import Any

from morphcore.geometry.aircraft import Aircraft, Flight, aircraft_from_document, flight_from_document
from morphcore.geometry.fields import Fields
from morphcore.geometry.lattice import DEFAULT_LATTICE, LatticeSettings
from morphcore.models.equivalent import ParameterBatch
from morphcore.models.parameters_document import parameters_from_document
from morphcore.optimise.optimisation import ScheduleOptimisation
from morphcore.optimise.result import ScheduleResult
from morphcore.optimise.settings import (
    VERIFICATIONS,
    FlexibleSettings,
    Limits,
    Morph,
    ScheduleSearch,
    Verify,
    Weights,
    flexible_settings,
    limits_settings,
    morph_settings,
    schedule_search,
    weights_settings,
)
from morphcore.search.step import Step
from morphcore.simulate.request import flown_model
from morphcore.stopping import Interrupted
from morphcore.threads import use_threads

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
    "optimisation_from_document",
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


def optimisation_from_document(document: dict[str, Any], threads: int | None = None) -> ScheduleOptimisation:
    """The optimisation that a request document (the body of ``POST /optimize``) asks for.

    Identified parameters bring their own lattice, step and start, unless others are given beside them.

    Raises
    ------
    InvalidInput : with a pointer to the field at fault.
    """
    if threads is not None:
        use_threads(threads)
    fields = Fields(document, "")
    aircraft = aircraft_from_document(fields.raw("aircraft"))
    flight = flight_from_document(fields.raw("flight"))
    parameters = parameters_from_document(fields.child("model").raw("parameters"), "/model/parameters")
    model = flown_model({"kind": "equivalent", **fields.raw("model")})
    run = ScheduleOptimisation(
        aircraft,
        flight,
        parameters,
        morph=morph_settings(fields.raw("morph")),
        limits=limits_settings(fields.raw("limits", {})),
        weights=weights_settings(fields.raw("weights", {})),
        search=schedule_search(fields.raw("search", {})),
        verify=fields.choice("verify", VERIFICATIONS, default="flexible"),  # type: ignore[arg-type]
        flexible=flexible_settings(fields.raw("flexible", {})),
        lattice=model.lattice,
        start=model.start,
        step_s=model.step_s,
    )
    fields.raw("execution", None)  # how a service runs it: no number depends on that
    fields.done()
    return run
