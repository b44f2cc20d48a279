"""The search methods that work on any problem, by name. A new method is a class and a line here."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from morphcore.errors import InvalidInput
from morphcore.search.evolution import EvolutionStrategy
from morphcore.search.solver import Problem, Solver
from morphcore.search.swarm import ParticleSwarm

# makes a solver from a problem and the settings of its search
Factory = Callable[[Any, Any], Solver[Any, Any]]

METHODS: dict[str, Factory] = {
    "pso": lambda problem, settings: ParticleSwarm(problem, settings.swarm, settings.seed),
    "cma": lambda problem, settings: EvolutionStrategy(problem, settings.evolution, settings.seed),
}


def register(name: str, factory: Factory) -> None:
    """Register a method under a name."""
    METHODS[name] = factory


def method(name: str, problem: Problem[Any], settings: Any, own: Mapping[str, Factory]) -> Solver[Any, Any]:
    """Return the named method, made for a problem.

    Parameters
    ----------
    name : str
    problem, settings : arguments of the method.
    own : methods specific to this kind of problem.

    Raises
    ------
    InvalidInput : no method has that name.
    """
    methods = {**METHODS, **own}
    if name not in methods:
        raise InvalidInput(
            f"there is no search method {name!r}",
            pointer="/search/method",
            hint=f"choose one of {', '.join(sorted(methods))}",
        )
    return methods[name](problem, settings)
