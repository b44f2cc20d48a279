"""How a schedule is searched for, with every choice made that a request may leave to the method."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from morphcore.geometry.fields import WholeNumbers
from morphcore.swarm import SwarmSettings
from morphdata import optimize
from morphdata.lattice import Lattice

PAPER_PARTICLES = 50  # of the paper's swarm
DEFAULT_SCREEN = 16  # schedules flown to find the descent's starts
DEFAULT_STARTS = 3
DEFAULT_ITERATIONS = 25
UNCHOSEN = optimize.ScheduleSearch()


@dataclass(frozen=True)
class ScheduleSearch(WholeNumbers):
    """The choices of all methods.

    "hybrid" descends from ``starts`` of ``screen`` schedules by constrained Gauss-Newton steps,
    ``iterations`` at most; "pso" is the swarm. max_seconds : for all searches together, in equal parts.
    """

    method: Literal["hybrid", "pso"] = UNCHOSEN.method
    seed: int = UNCHOSEN.seed
    max_seconds: float | None = None
    swarm: SwarmSettings = field(default_factory=lambda: SwarmSettings(particles=PAPER_PARTICLES))
    screen: int = DEFAULT_SCREEN
    starts: int = DEFAULT_STARTS
    iterations: int = DEFAULT_ITERATIONS


def schedule_search(search: optimize.ScheduleSearch) -> ScheduleSearch:
    """Choose what a request leaves to the method; ``preset: "paper"`` is the swarm of the 2021 paper."""
    return ScheduleSearch(
        method="pso" if search.preset == "paper" else search.method,
        seed=search.seed,
        max_seconds=search.max_seconds,
        swarm=SwarmSettings(**{"particles": PAPER_PARTICLES, **search.swarm_settings()}),
        screen=search.particles or DEFAULT_SCREEN,
        iterations=search.generations or DEFAULT_ITERATIONS,
    )


@dataclass(frozen=True)
class FlexibleSettings(WholeNumbers):
    """The flexible model that verifies.

    elements : of each surface. lattice : None for the equivalent model's.
    """

    elements: int = optimize.VerifyingModel().elements
    lattice: Lattice | None = None


def flexible_settings(model: optimize.VerifyingModel) -> FlexibleSettings:
    """Take the flexible model's part of a request."""
    return FlexibleSettings(model.elements, model.lattice)
