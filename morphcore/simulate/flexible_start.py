"""The start of a flight of the flexible model: its trim, and the angle of the trim drive."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from morphcore.errors import InvalidInput, TrimNotFound
from morphcore.models.equivalent import chain_model
from morphcore.models.flexible import FlexibleModel
from morphcore.simulate.control_motion import of_every_part
from morphcore.simulate.flexible import FlexibleFlight, HingePath, hinge_path
from morphcore.simulate.flexible_trim import FlexibleTrim, trim_flexible
from morphcore.simulate.plan import start_at
from morphcore.simulate.schedule import Schedule
from morphcore.simulate.time_grid import TimeGrid
from morphcore.simulate.trim import StartMode
from morphcore.simulate.wake import (
    MIN_AUTHORITY,
    NominalStart,
    no_authority,
    trim_drives,
    trim_range,
    trimmed_schedules,
)

Array = NDArray[np.float64]

TOLERANCE_RAD = 1e-9  # of the drive, limit of the last step of the secant method
MAX_ROUNDS = 12  # trims; four are usual
PROBE_RAD = 5e-3  # second point, where the rigid model's drive is already exact


def start_flexible(
    flight: FlexibleFlight,
    schedules: Sequence[Schedule],
    grid: TimeGrid,
    wind_N: Array,
    start: StartMode,
) -> tuple[HingePath, FlexibleTrim]:
    """Trim at the start of a grid, and the hinges' motion from there.

    With a trim drive the pitching moment vanishes: its angle is found by the secant method over whole trims,
    from the angle of the rigid model. Its schedule counts from its first value.

    Raises
    ------
    InvalidInput
        ``start="given"`` and the flight has none; the trim drive does not exist, cannot balance the moment,
        or its schedule leaves its range.
    TrimNotFound
        There is no level flight.
    """
    model, name = flight.model, flight.model.flight.trim_drive
    schedules = of_every_part(model.aircraft, schedules)
    drives = trim_drives(model.aircraft, name)
    if not drives or start == "given":
        path = hinge_path(model, schedules, grid)
        return path, trim_flexible(flight, path, wind_N, start=start)
    times = grid.times_s

    def trimmed(drive_rad: float) -> FlexibleTrim:
        first = trimmed_schedules(model, schedules, times[:1], NominalStart(0.0, drive_rad))
        return trim_flexible(flight, hinge_path(model, first, grid), wind_N, start=start)

    low, high = trim_range(drives)
    area = sum(surface.area_m2 for surface in model.aircraft.surfaces)
    chord = max(surface.mean_chord_m for surface in model.aircraft.surfaces)
    scale = model.flight.dynamic_pressure_pa * area * chord
    angle = float(np.clip(_rigid_angle(model, schedules, float(times[0])), low, high))
    found = trimmed(angle)
    step = PROBE_RAD if angle + PROBE_RAD <= high else -PROBE_RAD
    for _ in range(MAX_ROUNDS):
        new = trimmed(angle + step)
        slope = float(new.moment_B[1] - found.moment_B[1]) / step
        angle, found = angle + step, new
        if not abs(slope) > MIN_AUTHORITY * scale:
            raise no_authority(name, angle, float(found.moment_B[1]))
        wanted = angle - float(found.moment_B[1]) / slope
        step = float(np.clip(wanted, low, high)) - angle
        if step == 0.0 and wanted != angle:
            raise no_authority(name, angle, float(found.moment_B[1]))
        if abs(step) < TOLERANCE_RAD:
            flown = trimmed_schedules(model, schedules, times, NominalStart(found.alpha, angle))
            return hinge_path(model, flown, grid), found
    raise TrimNotFound(residual=abs(step), iterations=MAX_ROUNDS)


def _rigid_angle(model: FlexibleModel, schedules: Sequence[Schedule], time_s: float) -> float:
    """Angle of the trim drive of the rigid model, rad; 0 if that has no trim."""
    unbent = model.lattice.settings.model_copy(update={"shape": "undeformed"})
    rigid = chain_model(model.aircraft, model.flight, 1, unbent)
    angles = np.array([each.motion([time_s]).angle[0] for each in schedules])
    try:
        return start_at(rigid, angles, "trim").drive_rad or 0.0
    except (InvalidInput, TrimNotFound):
        return 0.0
