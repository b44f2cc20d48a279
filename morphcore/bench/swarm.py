"""The swarm that benchmarks fly, and one flight of it."""

from __future__ import annotations

import numpy as np

from morphcore.bench.setting import Clock
from morphcore.identify.cost import SampleCase
from morphcore.models.equivalent import ChainModel, ParameterBatch, lane_constants, physical_guess
from morphcore.simulate.batch import fly_batch
from morphcore.simulate.trim import Trim, trimmed_state

SWARM_SEED = 1
# spread of the benchmark's swarm around the physical guess: as wide as an identification's candidates
STIFFNESS_SPREAD = 0.3  # standard deviation of the logarithm
DIVISION_CONCENTRATION = 20.0  # of the Dirichlet distribution of the links' shares


def benchmark_swarm(model: ChainModel, particles: int, seed: int = SWARM_SEED) -> ParameterBatch:
    """Parameter sets around the physical guess, as a search has them."""
    rng = np.random.default_rng(seed)
    n = model.links_per_wing
    division = rng.dirichlet(np.full(n, DIVISION_CONCENTRATION), (particles, 1))
    batch = physical_guess(model, division)
    stiffness = batch["stiffness_nm_rad"]
    factor = np.exp(rng.normal(0.0, STIFFNESS_SPREAD, stiffness.shape))
    return batch.changed(stiffness_nm_rad=stiffness * factor)


def flown(clock: Clock, model: ChainModel, batch: ParameterBatch, case: SampleCase, found: Trim) -> float:
    """Fly a batch through a plan, attitudes recorded as in an identification; gives its time, s."""
    begin = clock()
    model = case.plan.flown(model)
    constants = lane_constants(model, batch, case.plan.grid.step_s)
    constants.set_thrust(found.force_B, found.moment_B)
    state = trimmed_state(model, batch, case.plan, found)
    for _ in fly_batch(model, case.plan, constants, state, record_rows=4):
        pass
    return clock() - begin
