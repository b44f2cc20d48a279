"""Identification of equivalent models from sample flights."""

from __future__ import annotations

from collections.abc import Sequence

from morphcore.errors import InvalidInput
from morphcore.geometry.aircraft import Aircraft, Flight
from morphcore.identify.identification import Identification
from morphcore.identify.result import IdentifyResult
from morphcore.identify.settings import SearchSettings, search_settings
from morphcore.search.step import Step
from morphcore.simulate.trajectory import Trajectory
from morphcore.stopping import Interrupted
from morphcore.threads import use_threads
from morphdata.aircraft import Aircraft as AircraftDocument
from morphdata.flight import Flight as FlightDocument
from morphdata.identify import EquivalentModel, IdentifyRequest, IdentifySearch, SamplesRequest

__all__ = [
    "Identification",
    "IdentifyResult",
    "Interrupted",
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
    links_per_wing: int = EquivalentModel().links_per_wing,
    seed: int = IdentifySearch().seed,
    model: EquivalentModel | None = None,
    search: IdentifySearch | None = None,
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
        model or EquivalentModel(links_per_wing=links_per_wing),
        search_settings(search or IdentifySearch(seed=seed)),
    )
    checkpoint = b""
    for step in run.steps():
        checkpoint = step.checkpoint
    return run.result(checkpoint)


def identification_from_request(request: IdentifyRequest, threads: int | None = None) -> Identification:
    """The identification that a request (the body of ``POST /identify``) asks for.

    Raises
    ------
    InvalidInput : it refers to something by an id, which only a service knows.
    """
    if threads is not None:
        use_threads(threads)
    return Identification(*flown_inputs(request), request.model, search_settings(request.search))


def flown_inputs(request: SamplesRequest) -> tuple[Aircraft, Flight, list[Trajectory]]:
    """Aircraft, flight condition and samples of a request, as numbers.

    Raises
    ------
    InvalidInput : the rows of a sample are elsewhere.
    """
    samples = request.inline_samples()
    for number in range(len(request.samples)):
        if number not in samples:
            raise InvalidInput(
                "only a service knows a flight by its id",
                pointer=f"/samples/{number}/trajectory_id",
                hint="give the flight's rows instead",
            )
    return (
        Aircraft.of(request.aircraft),
        Flight.of(request.flight),
        [Trajectory.of(sample) for sample in samples.values()],
    )
