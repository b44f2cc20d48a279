"""Complete settings of the search for a schedule, including those that a request may leave open."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from morphcore.geometry.fields import WholeNumbers
from morphcore.search.evolution import EvolutionSettings
from morphcore.search.swarm import SwarmSettings
from morphdata.optimize import ScheduleSearch

PAPER_PARTICLES = 50  # of the paper's swarm
DEFAULT_SCREEN = 16  # schedules flown to find the descent's starts
DEFAULT_STARTS = 3
DEFAULT_ITERATIONS = 25
UNCHOSEN = ScheduleSearch()


@dataclass(frozen=True)
class ScheduleSettings(WholeNumbers):
    """The settings of all methods.

    "hybrid" descends from ``starts`` of ``screen`` schedules by constrained Gauss-Newton steps,
    ``iterations`` at most; "pso" is the swarm. max_seconds : for all searches together, in equal parts.
    """

    method: Literal["hybrid", "pso"] = UNCHOSEN.method
    seed: int = UNCHOSEN.seed
    max_seconds: float | None = None
    swarm: SwarmSettings = field(default_factory=lambda: SwarmSettings(particles=PAPER_PARTICLES))
    evolution: EvolutionSettings = field(default_factory=EvolutionSettings)
    screen: int = DEFAULT_SCREEN
    starts: int = DEFAULT_STARTS
    iterations: int = DEFAULT_ITERATIONS


def schedule_settings(search: ScheduleSearch) -> ScheduleSettings:
    """Fill in what a request leaves open; ``preset: "paper"`` is the swarm of the 2021 paper."""
    return ScheduleSettings(
        method="pso" if search.preset == "paper" else search.method,
        seed=search.seed,
        max_seconds=search.max_seconds,
        swarm=SwarmSettings(**{"particles": PAPER_PARTICLES, **search.swarm_settings()}),
        screen=search.particles or DEFAULT_SCREEN,
        iterations=search.generations or DEFAULT_ITERATIONS,
    )
