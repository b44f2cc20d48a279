"""Amount of work for the paper's tables and figures: all of it, or just enough to exercise everything."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from morphcore.identify.settings import SearchSettings
from morphcore.search.swarm import SwarmSettings
from morphcore.simulate.flexible import FLEXIBLE_STEP_S
from morphdata.lattice import CoreLaw, Lattice, VortexCore
from morphdata.simulate import DEFAULT_ELEMENTS


@dataclass(frozen=True)
class Effort:
    """Sizes of the stages.

    flexible_step_s : step of the flights that are not timed. links : numbers of links per wing of the study.
    iterations : of our search, maximum. swarm_particles, swarm_generations : of the paper's search.
    timing_rounds : repetitions of every timed flight. all_flights_timed : whether to time all flights, not
    only that of two seconds.
    batch : parameter sets flown together. finer_lattice : whether the truth's convergence in the lattice
    is shown. schedule_generations : of the paper's swarm of schedules. front_durations_s : of morphs on the
    Pareto front. free_values : whether the angles at the knots are free too.
    """

    flexible_step_s: float
    links: tuple[int, ...]
    iterations: int
    swarm_particles: int
    swarm_generations: int
    timing_rounds: int
    all_flights_timed: bool
    batch: int
    finer_lattice: bool
    schedule_generations: int
    free_values: bool
    front_durations_s: tuple[float, ...]


FULL = Effort(
    flexible_step_s=FLEXIBLE_STEP_S,
    links=(1, 2, 3, 4, 5, 6),
    iterations=40,
    swarm_particles=2500,
    swarm_generations=80,
    timing_rounds=5,
    all_flights_timed=True,
    batch=2500,
    finer_lattice=True,
    schedule_generations=60,
    free_values=True,
    front_durations_s=(1.2, 1.5, 1.75, 2.0, 2.5, 3.0, 3.5),
)
QUICK = Effort(
    flexible_step_s=2.0 * FLEXIBLE_STEP_S,
    links=(1, 2, 3),
    iterations=16,
    swarm_particles=128,
    swarm_generations=8,
    timing_rounds=2,
    all_flights_timed=False,
    batch=480,
    finer_lattice=False,
    schedule_generations=4,
    free_values=False,
    front_durations_s=(1.5, 2.5),
)


@dataclass(frozen=True)
class PaperSettings:
    """The user's choices.

    samples : folder with an independent program's flights (aircraft.json, flight.json, train_*.csv), or None.
    """

    seed: int = 1
    quick: bool = False
    core: CoreLaw = "line"
    samples: Path | None = field(default=None)

    @property
    def effort(self) -> Effort:
        """The sizes."""
        return QUICK if self.quick else FULL

    @property
    def lattice(self) -> Lattice:
        """The lattice of all three models."""
        return Lattice(core=VortexCore(law=self.core))

    @property
    def elements(self) -> int:
        """Beam elements of each wing of the flexible model."""
        return DEFAULT_ELEMENTS

    @property
    def search(self) -> SearchSettings:
        """Our search."""
        return SearchSettings(seed=self.seed, iterations=self.effort.iterations)

    @property
    def swarm_search(self) -> SearchSettings:
        """The paper's search, with as many generations as time allows."""
        effort = self.effort
        swarm = SwarmSettings(particles=effort.swarm_particles, generations=effort.swarm_generations)
        return SearchSettings(method="pso", seed=self.seed, swarm=swarm)
