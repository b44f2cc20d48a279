"""What an identification is asked to do, read from its JSON document."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from morphcore.errors import InvalidInput
from morphcore.geometry.fields import Fields, WholeNumbers
from morphcore.geometry.lattice import DEFAULT_LATTICE, LatticeSettings, lattice_settings
from morphcore.identify.parameters import BOUND_NAMES
from morphcore.models.equivalent import MOST_LINKS, ParameterBatch
from morphcore.models.parameters_document import parameters_from_document
from morphcore.search.evolution import FEWEST, EvolutionSettings
from morphcore.search.swarm import SwarmSettings
from morphcore.simulate.plan import STEP_S
from morphcore.simulate.trim import StartMode

Method = Literal["hybrid", "least_squares", "cma", "pso"]

METHODS: tuple[Method, ...] = ("hybrid", "least_squares", "cma", "pso")
LARGEST_SEED = 2**53 - 1
SHORTEST_STEP_S = 5e-4
PAPER_PARTICLES = 2500
# starts of the hybrid's second polish
DEFAULT_STARTS = 4
DEFAULT_ITERATIONS = 40
DEFAULT_SCREEN = 64  # candidates flown to find them
# from a known model there is less to find: its surroundings, and the physical guess in case it is a bad one
WARM_STARTS = 3
WARM_SCREEN = 32


@dataclass(frozen=True)
class ModelSettings(WholeNumbers):
    """The model whose parameters are sought.

    ``aero_coefficients`` : the corrections to seek; None: those that the flights to fit can tell (see
    ``morphcore/identify/sought.py``). ``step_s`` : s; None: the longest that holds the tolerance of
    ``morphcore/simulate/step_choice.py`` on the flights to fit.
    """

    links_per_wing: int = 3
    separate_wings: bool = False
    aero_coefficients: tuple[str, ...] | None = None
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    lattice: LatticeSettings = DEFAULT_LATTICE
    step_s: float | None = None
    start: StartMode = "trim"


@dataclass(frozen=True)
class SearchSettings(WholeNumbers):
    """How they are sought: ``swarm`` rules "pso", ``evolution`` "cma".

    "least_squares" descends from what is known beforehand (the physical guess, ``warm_start``) in up to
    ``iterations``; "hybrid" does the same and, where that ends in a poor fit, flies ``screen`` candidates and
    descends from the best ``starts`` of them.

    ``warm_start`` : a model (one particle) to begin from instead of the physical guess, which stays among the
    candidates.
    """

    method: Method = "hybrid"
    seed: int = 1
    max_seconds: float | None = None
    swarm: SwarmSettings = field(default_factory=SwarmSettings)
    evolution: EvolutionSettings = field(default_factory=EvolutionSettings)
    screen: int = DEFAULT_SCREEN
    starts: int = DEFAULT_STARTS
    iterations: int = DEFAULT_ITERATIONS
    warm_start: ParameterBatch | None = None


def model_settings(document: dict[str, Any], pointer: str = "/model") -> ModelSettings:
    """Read the model's part of a request."""
    fields = Fields(document, pointer)
    default = ModelSettings()
    bounds = fields.optional_child("bounds")
    pairs = {name: _pair(bounds, name) for name in BOUND_NAMES if bounds.has(name)}
    bounds.done()
    listed = fields.raw("aero_coefficients", None)
    settings = ModelSettings(
        links_per_wing=fields.whole(
            "links_per_wing", default=default.links_per_wing, least=1, most=MOST_LINKS
        ),
        separate_wings=fields.flag("separate_wings", default=False),
        aero_coefficients=None if listed is None else tuple(listed),
        bounds=pairs,
        lattice=lattice_settings(fields.raw("lattice", {}), f"{pointer}/lattice"),
        step_s=fields.optional_number("step_s", least=SHORTEST_STEP_S, most=STEP_S),
        start=fields.choice("start", ("trim", "given")) if fields.has("start") else "trim",  # type: ignore[arg-type]
    )
    fields.done()
    return settings


def search_settings(document: dict[str, Any], pointer: str = "/search") -> SearchSettings:
    """Read the search's part of a request; ``preset: "paper"`` is the swarm of the 2021 paper."""
    fields = Fields(document, pointer)
    paper = fields.choice("preset", ("paper",)) == "paper" if fields.has("preset") else False
    method = fields.choice("method", METHODS) if fields.has("method") else ("pso" if paper else "hybrid")
    default = SwarmSettings(particles=PAPER_PARTICLES) if paper else SwarmSettings()
    swarm = SwarmSettings(
        particles=fields.whole("particles", default=default.particles, least=1, most=100_000),
        generations=fields.whole("generations", default=default.generations, least=1, most=100_000),
        c1=fields.number("c1", default=default.c1, least=0.0, most=4.0),
        c2=fields.number("c2", default=default.c2, least=0.0, most=4.0),
        inertia=fields.number("inertia", default=default.inertia, least=0.0, most=1.5),
    )
    evolution = _evolution_settings(fields) if method == "cma" and not paper else EvolutionSettings()
    warm_start = None
    if fields.has("warm_start"):
        known = fields.child("warm_start")
        warm_start = parameters_from_document(known.raw("parameters"), f"{known.pointer}/parameters")
        known.done()
    warm = warm_start is not None
    settings = SearchSettings(
        method="pso" if paper else method,  # type: ignore[arg-type]
        seed=fields.whole("seed", default=1, least=0, most=LARGEST_SEED),
        max_seconds=fields.optional_number("max_seconds", above=0.0),
        swarm=swarm,
        evolution=evolution,
        screen=swarm.particles if fields.has("particles") else WARM_SCREEN if warm else DEFAULT_SCREEN,
        starts=WARM_STARTS if warm else DEFAULT_STARTS,
        iterations=swarm.generations if fields.has("generations") else DEFAULT_ITERATIONS,
        warm_start=warm_start,
    )
    fields.done()
    return settings


def _evolution_settings(fields: Fields) -> EvolutionSettings:
    default = EvolutionSettings()
    return EvolutionSettings(
        particles=fields.whole("particles", default=default.particles, least=FEWEST, most=100_000),
        generations=fields.whole("generations", default=default.generations, least=1, most=100_000),
    )


def _pair(fields: Fields, name: str) -> tuple[float, float]:
    value = fields.raw(name)
    if not isinstance(value, list) or len(value) != 2:
        raise InvalidInput(
            f"{name} is not [low, high]", pointer=f"{fields.pointer}/{name}", hint="give two numbers"
        )
    numbers = Fields({"low": value[0], "high": value[1]}, f"{fields.pointer}/{name}")
    return numbers.number("low"), numbers.number("high")
