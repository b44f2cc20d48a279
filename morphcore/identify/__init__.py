"""Identification of equivalent models from sample flights."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from morphcore.errors import InvalidInput
from morphcore.geometry.aircraft import Aircraft, Flight, aircraft_from_document, flight_from_document
from morphcore.geometry.fields import Fields
from morphcore.identify.identification import Identification
from morphcore.identify.result import IdentifyResult
from morphcore.identify.settings import ModelSettings, SearchSettings, model_settings, search_settings
from morphcore.search.step import Step
from morphcore.simulate.trajectory import Trajectory, trajectory_from_document
from morphcore.stopping import Interrupted
from morphcore.threads import use_threads

__all__ = [
    "Identification",
    "IdentifyResult",
    "Interrupted",
    "ModelSettings",
    "SearchSettings",
    "Step",
    "identification_from_document",
    "identify",
]


def identify(
    aircraft: Aircraft,
    flight: Flight,
    samples: Sequence[Trajectory],
    *,
    links_per_wing: int = 3,
    seed: int = 1,
    model: ModelSettings | None = None,
    search: SearchSettings | None = None,
) -> IdentifyResult:
    """Identify an equivalent model from sample flights, from start to end.

    Parameters
    ----------
    aircraft, flight : the aircraft and its flight condition.
    samples : flights; those with role "held_out" are not fitted but reported.
    links_per_wing, seed : the commonest choices; ``model`` and ``search`` replace them where given.

    Raises
    ------
    InvalidInput : the samples or settings make no sense. NotFlyable : no model flies the samples.
    """
    run = Identification(
        aircraft,
        flight,
        samples,
        model or ModelSettings(links_per_wing=links_per_wing),
        search or SearchSettings(seed=seed),
    )
    checkpoint = b""
    for step in run.steps():
        checkpoint = step.checkpoint
    return run.result(checkpoint)


def identification_from_document(document: dict[str, Any], threads: int | None = None) -> Identification:
    """The identification that a request document (the body of ``POST /identify``) asks for.

    Raises
    ------
    InvalidInput : with a pointer to the field at fault.
    """
    if threads is not None:
        use_threads(threads)
    fields = Fields(document, "")
    aircraft = aircraft_from_document(fields.raw("aircraft"))
    flight = flight_from_document(fields.raw("flight"))
    listed = fields.raw("samples")
    if not isinstance(listed, list):
        raise InvalidInput("samples is not a list", pointer="/samples", hint="give a list of samples")
    samples = [trajectory_from_document(item, f"/samples/{i}") for i, item in enumerate(listed)]
    model = model_settings(fields.raw("model", {}))
    search = search_settings(fields.raw("search", {}))
    fields.raw("execution", None)  # how a service runs it: no number depends on that
    fields.done()
    return Identification(aircraft, flight, samples, model, search)
