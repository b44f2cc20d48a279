"""Particle swarm search on the operators of pyswarms, in a loop of our own that can stop, report and resume.

The paper's search: Kennedy & Eberhart (1995) with inertia (Shi & Eberhart 1998), one global best. pyswarms
draws from numpy's global generator; its state is part of ours, put in place before each use and taken back
after it, so that a resumed search goes on to the bit.
"""

from __future__ import annotations

import logging.config
from dataclasses import dataclass, field
from functools import cache, partial
from types import SimpleNamespace
from typing import Any, cast
from unittest import mock

import numpy as np
from numpy.typing import NDArray

from morphcore.geometry.fields import WholeNumbers

Array = NDArray[np.float64]


@dataclass(frozen=True)
class SwarmSettings(WholeNumbers):
    """Coefficients of the swarm; ``inertia`` 0.7 keeps c1 = c2 = 1 inside the stable region (Trelea 2003)."""

    particles: int = 200
    generations: int = 100
    c1: float = 1.0
    c2: float = 1.0
    inertia: float = 0.7


@dataclass(frozen=True)
class SwarmState:
    """A swarm after some generations: (p, d) in the unit cube, costs (p,), the generator's state."""

    position: Array
    velocity: Array
    best_position: Array
    best_cost: Array
    generation: int
    random: tuple[Any, ...] = field(repr=False)

    @property
    def leader(self) -> Array:
        """(d,) the best position so far."""
        return np.asarray(self.best_position[int(np.argmin(self.best_cost))])


@cache
def operators() -> SimpleNamespace:
    """What is used of pyswarms; loaded for the first swarm, for it brings matplotlib along.

    It configures the root logger and opens report.log in the working directory, on import and with every
    handler that it makes; neither is its to do.
    """
    with mock.patch.object(logging.config, "dictConfig"):
        from pyswarms.backend import compute_pbest, compute_position, compute_velocity
        from pyswarms.backend.handlers import BoundaryHandler, VelocityHandler
        from pyswarms.backend.swarms import Swarm

        return SimpleNamespace(
            Swarm=Swarm,
            best=compute_pbest,
            velocity=partial(compute_velocity, clamp=None, vh=VelocityHandler("unmodified")),
            position=partial(compute_position, bh=BoundaryHandler("nearest")),
        )


def first_swarm(settings: SwarmSettings, guess: Array, seed: int) -> SwarmState:
    """A swarm spread evenly over the unit cube, its first particles the guess (d,) or guesses (k, d)."""
    generator = np.random.RandomState(seed % 2**32)  # the kind of generator that pyswarms draws from
    guesses = np.atleast_2d(guess)[: settings.particles]
    position = generator.uniform(size=(settings.particles, guesses.shape[1]))
    position[: guesses.shape[0]] = guesses
    velocity = generator.uniform(-0.1, 0.1, size=position.shape)
    unknown = np.full(settings.particles, np.inf)
    return SwarmState(
        position,
        velocity,
        position.copy(),
        unknown,
        0,
        cast("tuple[Any, ...]", generator.get_state(legacy=True)),
    )


def next_swarm(state: SwarmState, settings: SwarmSettings, cost: Array) -> SwarmState:
    """The next generation, given the costs (p,) of the present positions."""
    pyswarms = operators()
    swarm = pyswarms.Swarm(
        position=state.position,
        velocity=state.velocity,
        options={"c1": settings.c1, "c2": settings.c2, "w": settings.inertia},
    )
    swarm.pbest_pos, swarm.pbest_cost, swarm.current_cost = state.best_position, state.best_cost, cost
    swarm.pbest_pos, swarm.pbest_cost = pyswarms.best(swarm)
    swarm.best_pos = swarm.pbest_pos[int(np.argmin(swarm.pbest_cost))]
    unit = (np.zeros(state.position.shape[1]), np.ones(state.position.shape[1]))
    others = np.random.get_state(legacy=True)  # noqa: NPY002 - pyswarms knows no other
    np.random.set_state(state.random)  # noqa: NPY002
    try:
        swarm.velocity = pyswarms.velocity(swarm, bounds=unit)
        position = pyswarms.position(swarm, unit)
        random = np.random.get_state(legacy=True)  # noqa: NPY002
    finally:
        np.random.set_state(others)  # noqa: NPY002
    return SwarmState(
        position, swarm.velocity, swarm.pbest_pos, swarm.pbest_cost, state.generation + 1, tuple(random)
    )
