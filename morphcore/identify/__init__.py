"""Identification of equivalent models from sample flights."""

from __future__ import annotations

from collections.abc import Sequence

from morphcore.geometry.aircraft import Aircraft, Flight
from morphcore.identify.generation import GenerationTask
from morphcore.identify.identification import Identification
from morphcore.identify.result import IdentifyResult
from morphcore.identify.settings import ModelSettings, SearchSettings, model_settings, search_settings
from morphcore.simulate.trajectory import Trajectory
from morphcore.steps import Step
from morphcore.stopping import Interrupted
from morphcore.threads import use_threads
from morphdata.aircraft import Aircraft as AircraftDocument
from morphdata.flight import Flight as FlightDocument
from morphdata.identify import IdentifyRequest, SamplesRequest

__all__ = [
    "GenerationTask",
    "Identification",
    "IdentifyResult",
    "Interrupted",
    "ModelSettings",
    "SearchSettings",
    "Step",
    "identification_from_request",
    "identify",
]


def identify(
    aircraft: AircraftDocument,
    flight: FlightDocument,
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
        Aircraft.of(aircraft),
        Flight.of(flight),
        samples,
        model or ModelSettings(links_per_wing=links_per_wing),
        search or SearchSettings(seed=seed),
    )
    checkpoint = b""
    for step in run.steps():
        checkpoint = step.checkpoint
    return run.result(checkpoint)


def identification_from_request(request: IdentifyRequest, threads: int | None = None) -> Identification:
    """The identification that a request (the body of ``POST /identify``) asks for.

    Raises
    ------
    InvalidInput : with a pointer to the field at fault.
    """
    if threads is not None:
        use_threads(threads)
    return Identification(
        *flown_inputs(request), model_settings(request.model), search_settings(request.search)
    )


def flown_inputs(request: SamplesRequest) -> tuple[Aircraft, Flight, list[Trajectory]]:
    """Aircraft, flight condition and samples of a request, as numbers."""
    return (
        Aircraft.of(request.aircraft),
        Flight.of(request.flight),
        [Trajectory.of(sample) for sample in request.inline_samples().values()],
    )
