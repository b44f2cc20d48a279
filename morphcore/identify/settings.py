"""How an identification is searched for, with every choice made that a request may leave to the method."""

from __future__ import annotations

from dataclasses import dataclass, field

from morphcore.errors import InvalidInput
from morphcore.geometry.fields import WholeNumbers
from morphcore.models.equivalent import ParameterBatch
from morphcore.models.parameters_document import parameter_batch
from morphcore.search.evolution import EvolutionSettings
from morphcore.search.swarm import SwarmSettings
from morphdata.identify import IdentifySearch, Method, Search
from morphdata.parameters import parameters_in

PAPER_PARTICLES = 2500
# starts of the hybrid's second descent
DEFAULT_STARTS = 4
DEFAULT_ITERATIONS = 40
DEFAULT_SCREEN = 64  # candidates flown to find them
# from a known model there is less to find: its surroundings, and the physical guess in case it is a bad one
WARM_STARTS = 3
WARM_SCREEN = 32
UNCHOSEN = IdentifySearch()


@dataclass(frozen=True)
class SearchSettings(WholeNumbers):
    """The choices of all methods: ``swarm`` is of "pso", ``evolution`` of "cma".

    "least_squares" descends from what is known beforehand (the physical guess, ``warm_start``) in up to
    ``iterations``; "hybrid" does the same and, where that ends in a poor fit, flies ``screen`` candidates and
    descends from the best ``starts`` of them.

    ``warm_start`` : a model (one particle) to begin from instead of the physical guess, which stays among the
    candidates.
    """

    method: Method = UNCHOSEN.method
    seed: int = UNCHOSEN.seed
    max_seconds: float | None = None
    swarm: SwarmSettings = field(default_factory=SwarmSettings)
    evolution: EvolutionSettings = field(default_factory=EvolutionSettings)
    screen: int = DEFAULT_SCREEN
    starts: int = DEFAULT_STARTS
    iterations: int = DEFAULT_ITERATIONS
    warm_start: ParameterBatch | None = None


def search_settings(search: Search) -> SearchSettings:
    """Choose what a request leaves to the method; ``preset: "paper"`` is the swarm of the 2021 paper.

    Raises
    ------
    InvalidInput : the model to begin from is named by an id.
    """
    paper = search.preset == "paper"
    swarm = search.swarm_settings()
    evolution = {name: swarm[name] for name in ("particles", "generations") if name in swarm}
    warm_start = search.warm_start if isinstance(search, IdentifySearch) else None
    known = None if warm_start is None else parameters_in(warm_start.parameters)
    if warm_start is not None and known is None:
        raise InvalidInput(
            "only a service knows a model by an id",
            pointer=f"/search/warm_start/{'job_id' if warm_start.model_id is None else 'model_id'}",
            hint="give the model's parameters instead",
        )
    return SearchSettings(
        method="pso" if paper else search.method,
        seed=search.seed,
        max_seconds=search.max_seconds,
        swarm=SwarmSettings(**{**({"particles": PAPER_PARTICLES} if paper else {}), **swarm}),
        evolution=EvolutionSettings(**evolution),
        screen=search.particles or (DEFAULT_SCREEN if known is None else WARM_SCREEN),
        starts=DEFAULT_STARTS if known is None else WARM_STARTS,
        iterations=search.generations or DEFAULT_ITERATIONS,
        warm_start=None if known is None else parameter_batch(known),
    )
