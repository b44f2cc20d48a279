"""Particle swarm search with the operators of pyswarms and a driver that can stop, report and resume.

The paper's search: Kennedy & Eberhart (1995) with inertia (Shi & Eberhart 1998), one global best. pyswarms
draws from numpy's global generator; its state is part of ours, installed before each use and read back after
it, so that a resumed search is bit-identical.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache, partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from morphcore.geometry.fields import WholeNumbers
from morphcore.search.checkpoint import stored
from morphcore.search.solver import Batch, Outcome, Problem, Solver

Array = NDArray[np.float64]

FIRST_SPEED = 0.1  # largest velocity of the first generation, in widths of the box


@dataclass(frozen=True)
class SwarmSettings(WholeNumbers):
    """Coefficients of the swarm; ``inertia`` 0.7 keeps c1 = c2 = 1 inside the stable region (Trelea 2003)."""

    particles: int = 200
    generations: int = 100
    c1: float = 1.0
    c2: float = 1.0
    inertia: float = 0.7


@stored
@dataclass(frozen=True)
class SwarmState:
    """A swarm after some generations: (p, d) in the unit cube, costs (p,), the generator's state."""

    position: Array
    velocity: Array
    best_position: Array
    best_cost: Array
    generation: int
    random: tuple[Any, ...] = field(repr=False)


class ParticleSwarm(Solver[SwarmState, Outcome]):
    """A swarm in a problem's box.

    Parameters
    ----------
    problem : gives the box, and the order of the coordinates of its first particles.
    settings : SwarmSettings
    seed : int
    """

    name = "swarm"

    def __init__(self, problem: Problem[Any], settings: SwarmSettings, seed: int) -> None:
        self._problem, self._box = problem, problem.box
        self._settings, self._seed = settings, seed

    def init(self, known: Outcome) -> SwarmState:
        """Spread the swarm evenly over the box, with the known points among its first particles."""
        settings = self._settings
        generator = np.random.RandomState(
            self._seed % 2**32
        )  # the kind of generator that pyswarms draws from
        guesses = self._box.to_unit(known.points)[: settings.particles]
        count = guesses.shape[0]
        position = generator.uniform(size=(settings.particles, guesses.shape[1]))
        position[:count] = guesses
        velocity = generator.uniform(-FIRST_SPEED, FIRST_SPEED, size=position.shape)
        position[count:] = self._problem.arranged(position[count:])
        random = tuple(generator.get_state(legacy=True))
        unknown = np.full(settings.particles, np.inf)
        return SwarmState(position, velocity, position.copy(), unknown, 0, random)

    def ask(self, state: SwarmState) -> Batch:
        """Return the present positions."""
        return Batch(self._box.from_unit(state.position))

    def tell(self, state: SwarmState, outcome: Outcome) -> SwarmState:
        """Move every particle, given the costs of the present positions."""
        pyswarms, settings = operators(), self._settings
        swarm = pyswarms.Swarm(
            position=state.position,
            velocity=state.velocity,
            options={"c1": settings.c1, "c2": settings.c2, "w": settings.inertia},
        )
        swarm.pbest_pos, swarm.pbest_cost = state.best_position, state.best_cost
        swarm.current_cost = outcome.cost
        swarm.pbest_pos, swarm.pbest_cost = pyswarms.best(swarm)
        swarm.best_pos = swarm.pbest_pos[int(np.argmin(swarm.pbest_cost))]
        others = np.random.get_state(legacy=True)  # noqa: NPY002 - pyswarms knows no other
        np.random.set_state(state.random)  # noqa: NPY002
        try:
            swarm.velocity = pyswarms.velocity(swarm)
            random = np.random.get_state(legacy=True)  # noqa: NPY002
        finally:
            np.random.set_state(others)  # noqa: NPY002
        return SwarmState(
            pyswarms.position(swarm),
            swarm.velocity,
            swarm.pbest_pos,
            swarm.pbest_cost,
            state.generation + 1,
            tuple(random),
        )

    def done(self, state: SwarmState) -> bool:
        """Return whether all generations have been flown."""
        return state.generation >= self._settings.generations

    def share(self, state: SwarmState) -> float:
        """Return the share of the generations that have been flown."""
        return state.generation / self._settings.generations

    def remarks(self, outcome: Outcome) -> dict[str, float]:
        """Return the mean cost of a generation."""
        return {"mean_cost": float(outcome.cost.mean())}


@cache
def operators() -> SimpleNamespace:
    """Import pyswarms only when the first swarm is made, since it imports matplotlib."""
    with _default_logging_off():
        from pyswarms.backend import compute_pbest, compute_position, compute_velocity
        from pyswarms.backend.swarms import Swarm

    return SimpleNamespace(
        Swarm=Swarm,
        best=compute_pbest,
        velocity=partial(compute_velocity, clamp=None, vh=lambda velocity, *_, **__: velocity),
        position=partial(
            compute_position, bounds=(0.0, 1.0), bh=lambda position, bounds: position.clip(*bounds)
        ),
    )


@contextmanager
def _default_logging_off() -> Iterator[None]:
    """Set the variable by which pyswarms lets its users configure logging.

    By default each of its modules configures the root logger and opens report.log in the working directory.
    """
    before = os.environ.get("LOG_CFG")
    os.environ["LOG_CFG"] = str(Path(__file__).with_name("pyswarms_logging.yaml"))
    try:
        yield
    finally:
        if before is None:
            del os.environ["LOG_CFG"]
        else:
            os.environ["LOG_CFG"] = before
