"""Starts off the trim that are unknown: which parts of one are free, and what they do to the readings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from morphcore.identify.cost import SampleCase, reading_derivatives, shared_trims
from morphcore.identify.measurement import START, START_SPREAD, Measured
from morphcore.models.equivalent import ChainModel, ParameterBatch
from morphcore.simulate.trim import StartMode

Array = NDArray[np.float64]

START_PROBE = 1e-4  # of the spread of each part of the start
# parts of the start that keep a symmetric flight symmetric: theta, q, u, w
LONGITUDINAL = (1, 3, 5, 7)


def with_start(model: ChainModel, batch: ParameterBatch, case: SampleCase, start: StartMode) -> Measured:
    """The readings of a sample whose start is free, with the derivatives by it for one parameter set."""
    setup, parts = case.setup, list(free_parts(case))
    spread = start_spread(model)[parts]
    ((_, found),) = shared_trims(model, batch, (case,), start)
    flights = [(case, found)]
    for part, probe in zip(parts, START_PROBE * spread, strict=True):
        moved = [*setup.openness.start_value]
        moved[part] += float(probe)
        openness = replace(setup.openness, start_value=tuple(moved))
        flights.append((replace(case, given=replace(setup, openness=openness)), found))
    columns = reading_derivatives(model, batch, flights, START_PROBE * spread)
    return replace(setup, start_columns=columns, start_spread=spread)


def free_parts(case: SampleCase) -> tuple[int, ...]:
    """Numbers of the parts of a start that may differ from the trim, as in `START`."""
    return LONGITUDINAL if case.plan.halved else tuple(range(len(START)))


def start_spread(model: ChainModel) -> Array:
    """Standard deviations of the parts of a start, SI units and rad."""
    spread = np.array(START_SPREAD)
    spread[5:] *= model.flight.airspeed_m_s
    return spread
