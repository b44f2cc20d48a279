"""The search methods that work on any problem, by name; a new one is a class and a line here."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from morphcore.errors import InvalidInput
from morphcore.search.evolution import EvolutionStrategy
from morphcore.search.solver import Problem, Solver
from morphcore.search.swarm import ParticleSwarm

# makes a solver of a problem and the settings of its search
Factory = Callable[[Any, Any], Solver[Any, Any]]

METHODS: dict[str, Factory] = {
    "pso": lambda problem, settings: ParticleSwarm(problem, settings.swarm, settings.seed),
    "cma": lambda problem, settings: EvolutionStrategy(problem, settings.evolution, settings.seed),
}


def register(name: str, factory: Factory) -> None:
    """Let searches choose a method by a name."""
    METHODS[name] = factory


def method(name: str, problem: Problem[Any], settings: Any, own: Mapping[str, Factory]) -> Solver[Any, Any]:
    """Return the method of a name, made for a problem.

    Parameters
    ----------
    name : str
    problem, settings : what the method is made of.
    own : methods that only this kind of problem has.

    Raises
    ------
    InvalidInput : there is no such method.
    """
    methods = {**METHODS, **own}
    if name not in methods:
        raise InvalidInput(
            f"there is no search method {name!r}",
            pointer="/search/method",
            hint=f"choose one of {', '.join(sorted(methods))}",
        )
    return methods[name](problem, settings)
