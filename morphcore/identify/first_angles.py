"""What an error of a drive's first angle does to a flight.

An aircraft is trimmed at the first angles of its drives, so their errors are forces and moments that nothing
balances. An error of 0.1 mrad on one side rolls the example aircraft by as much as a third of the stiffness
does. It is a nuisance of the measurement, whose size the noise of the drive limits.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from morphcore.identify.cost import SampleCase, reading_derivatives, sample_schedules
from morphcore.identify.drive_histories import DriveHistory
from morphcore.identify.measurement import Measured, angle_noise
from morphcore.identify.nuisance import PRIOR_RAD
from morphcore.models.equivalent import ChainModel, ParameterBatch
from morphcore.simulate.plan import flight_plan
from morphcore.simulate.time_grid import time_grid
from morphcore.simulate.trajectory import Trajectory
from morphcore.simulate.trim import StartMode, Trim, trim

Array = NDArray[np.float64]

PROBE_RAD = 1e-5  # of an angle: the flights' derivative is good to a thousandth
STILL_ROWS = 3  # of the flight at rest that is trimmed


def first_angle_columns(
    model: ChainModel,
    batch: ParameterBatch,
    case: SampleCase,
    histories: Mapping[str, DriveHistory],
    start: StartMode,
) -> Array:
    """Derivatives (k, c, n) of a sample's readings by the first angle of each of its n noisy drives.

    Parameters
    ----------
    model : ChainModel
    batch : ParameterBatch
        One parameter set, at which the derivatives are taken.
    case : SampleCase
    histories : mapping of str to DriveHistory
        Of the sample's drives.
    start : {"trim", "given"}
        With a given start nothing is trimmed but the joints, and no angle counts.
    """
    noisy = _start_errors(histories)
    if not noisy or start == "given":
        return np.zeros((0, 0, 0))
    flights = ((case, _trimmed(model, batch, case, name, start)) for name in (None, *noisy))
    return reading_derivatives(model, batch, flights, PROBE_RAD)


def with_first_angles(
    setup: Measured, sample: Trajectory, histories: Mapping[str, DriveHistory], columns: Array
) -> Measured:
    """The readings of a sample, with the derivatives that `first_angle_columns` found."""
    if not columns.size:
        return setup
    noisy = _start_errors(histories)
    # an error of one standard deviation costs as much as the noise of one angle's row
    unit = max(PRIOR_RAD, *angle_noise(sample).values())
    return replace(
        setup,
        angle_columns=columns,
        angle_spread=np.array(list(noisy.values())),
        angle_unit_rad=unit,
        angle_names=tuple(noisy),
    )


def _start_errors(histories: Mapping[str, DriveHistory]) -> dict[str, float]:
    """Standard errors of the first angles of noisy drives, rad."""
    return {name: each.start_error_rad for name, each in histories.items() if each.start_error_rad}


def _trimmed(
    model: ChainModel, batch: ParameterBatch, case: SampleCase, moved: str | None, start: StartMode
) -> Trim:
    """The trim at a sample's first angles, one of them moved by the probe."""
    sample, time_s = case.sample, case.sample.time_s[:STILL_ROWS]
    drives = {
        name: np.full(STILL_ROWS, angles[0] + (PROBE_RAD if name == moved else 0.0))
        for name, angles in sample.drives.items()
    }
    still: Trajectory = replace(sample, time_s=time_s, drives=drives, unreadable={})
    schedules = sample_schedules(model.aircraft, still, "")
    flown = case.plan.flown(model)
    plan = flight_plan(model, schedules, time_grid(time_s), may_halve=case.plan.halved, start=start)
    return trim(flown, batch, plan, start=start)
