"""Identification of equivalent models from sample flights."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from morphcore.errors import InvalidInput
from morphcore.geometry.aircraft import Aircraft, Flight
from morphcore.late import late_names
from morphcore.simulate.trajectory import Trajectory
from morphcore.threads import use_threads
from morphdata.aircraft import Aircraft as AircraftDocument
from morphdata.flight import Flight as FlightDocument
from morphdata.identify import EquivalentModel, IdentifyRequest, IdentifySearch, SamplesRequest
from morphdata.links import AskedLinks, to_choose
from morphdata.measurement import Measurement
from morphdata.uncertainty import UncertaintySettings

if TYPE_CHECKING:
    from morphcore.identify.auto_links import AutoIdentification
    from morphcore.identify.bands import Band, predict_bands
    from morphcore.identify.identification import Identification
    from morphcore.identify.result import IdentifyResult
    from morphcore.identify.settings import SearchSettings
    from morphcore.search.step import Step
    from morphcore.stopping import Interrupted

# imported on first use: together they would take a sixth of the time of importing the library
__getattr__ = late_names(
    __name__,
    {
        "AutoIdentification": "morphcore.identify.auto_links",
        "Band": "morphcore.identify.bands",
        "Identification": "morphcore.identify.identification",
        "IdentifyResult": "morphcore.identify.result",
        "Interrupted": "morphcore.stopping",
        "SearchSettings": "morphcore.identify.settings",
        "Step": "morphcore.search.step",
        "predict_bands": "morphcore.identify.bands",
    },
)

__all__ = [
    "AutoIdentification",
    "Band",
    "Identification",
    "IdentifyResult",
    "Interrupted",
    "SearchSettings",
    "Step",
    "identification_from_request",
    "identify",
    "predict_bands",
]


LINKS = EquivalentModel().links_per_wing


def identify(
    aircraft: AircraftDocument,
    flight: FlightDocument,
    samples: Sequence[Trajectory],
    *,
    links_per_wing: AskedLinks = LINKS,
    seed: int = IdentifySearch().seed,
    model: EquivalentModel | None = None,
    search: IdentifySearch | None = None,
    measurement: Measurement | None = None,
    uncertainty: UncertaintySettings | None = None,
) -> IdentifyResult:
    """Identify an equivalent model from sample flights, from start to end.

    Parameters
    ----------
    aircraft : Aircraft
        The aircraft.
    flight : Flight
        Its flight condition.
    samples : sequence of Trajectory
        Sample flights, angles in rad; those with role "held_out" are reported, not fitted.
    links_per_wing : int, mapping of str to int, or "auto"
        Links of all flexible surfaces, or of each by name, or "auto" for the number under which the flights
        are most likely; without effect where ``model`` is given.
    seed : int
        Seed of the search; without effect where ``search`` is given.
    model : EquivalentModel, optional
        The model whose parameters are searched: links, bounds, lattice, time step.
    search : IdentifySearch, optional
        Method and effort of the search.
    measurement : Measurement, optional
        How the samples were measured: channels, noise, biases, delays. What is left out is decided from the
        data.
    uncertainty : UncertaintySettings, optional
        Posterior draws and profile likelihoods to compute beside standard errors and intervals.

    Returns
    -------
    IdentifyResult
        Parameters in SI units, the fit to each sample, uncertainty and warnings.

    Raises
    ------
    InvalidInput
        The samples or settings make no sense.
    NotFlyable
        No model was found that flies the samples.

    Examples
    --------
    >>> from morphcore import identify, load_aircraft, load_flight, load_trajectory
    >>> from morphdata.identify import EquivalentModel, IdentifySearch
    >>> result = identify(
    ...     load_aircraft("examples/aircraft.json"),
    ...     load_flight("examples/flight.json"),
    ...     [load_trajectory("examples/train_rate_0.8.csv")],
    ...     model=EquivalentModel(links_per_wing=1, lattice={"chordwise": 1, "spanwise": 4}, step_s=0.01),
    ...     search=IdentifySearch(method="least_squares", generations=1),
    ... )
    >>> result.parameters["ac_offset_m"].shape
    (1,)
    """
    run = _identification(
        Aircraft.of(aircraft),
        Flight.of(flight),
        samples,
        model or EquivalentModel(links_per_wing=links_per_wing),
        search or IdentifySearch(seed=seed),
        measurement=measurement,
        uncertainty=uncertainty,
    )
    checkpoint = b""
    for step in run.steps():
        checkpoint = step.checkpoint
    return run.result(checkpoint)


def _identification(
    aircraft: Aircraft,
    flight: Flight,
    samples: Sequence[Trajectory],
    model: EquivalentModel,
    search: IdentifySearch,
    *,
    measurement: Measurement | None,
    uncertainty: UncertaintySettings | None,
) -> Identification | AutoIdentification:
    """An identification with one number of links, or one that chooses it."""
    from morphcore.identify.auto_links import AutoIdentification
    from morphcore.identify.identification import Identification
    from morphcore.identify.settings import search_settings

    kind = AutoIdentification if to_choose(model.links_per_wing) else Identification
    return kind(
        aircraft,
        flight,
        samples,
        model,
        search_settings(search),
        measurement=measurement,
        uncertainty=uncertainty,
    )


def identification_from_request(
    request: IdentifyRequest, threads: int | None = None
) -> Identification | AutoIdentification:
    """The identification that a request (the body of ``POST /identify``) asks for.

    Parameters
    ----------
    request : IdentifyRequest
        The request; its samples are inline.
    threads : int, optional
        Threads of the whole process; by default one for each core.

    Returns
    -------
    Identification or AutoIdentification
        The problem, of which nothing is flown yet; the latter where the number of links is to be chosen.

    Raises
    ------
    InvalidInput
        It refers to something by an id, which only a service knows.

    Examples
    --------
    >>> from morphcore import identification_from_request
    >>> from morphdata.identify import EXAMPLE_REQUEST, IdentifyRequest
    >>> run = identification_from_request(IdentifyRequest.parse(EXAMPLE_REQUEST))
    >>> run.model.links_per_wing
    3
    """
    if threads is not None:
        use_threads(threads)
    return _identification(
        *flown_inputs(request),
        request.model,
        request.search,
        measurement=request.measurement,
        uncertainty=request.uncertainty,
    )


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
