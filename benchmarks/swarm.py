"""One flight of the swarm that benchmarks fly."""

from __future__ import annotations

from benchmarks.setting import Clock
from morphcore.identify.cost import SampleCase
from morphcore.models.equivalent import ChainModel, ParameterBatch, lane_constants
from morphcore.simulate.batch import fly_batch
from morphcore.simulate.trim import Trim, trimmed_state


def flown(clock: Clock, model: ChainModel, batch: ParameterBatch, case: SampleCase, found: Trim) -> float:
    """Fly a batch through a plan, attitudes recorded as in an identification; gives its time, s."""
    begin = clock()
    model = case.plan.flown(model)
    constants = lane_constants(model, batch, case.plan.grid.step_s)
    constants.set_thrust(*found.acting_B)
    state = trimmed_state(model, batch, case.plan, found)
    for _ in fly_batch(model, case.plan, constants, state, record_rows=4):
        pass
    return clock() - begin
