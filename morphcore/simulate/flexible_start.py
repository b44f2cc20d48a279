"""The start of a flight of the flexible model: its trim, and the angles of the trim drives."""

from __future__ import annotations

from collections.abc import Callable, Sequence

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
from morphcore.simulate.steady import described
from morphcore.simulate.time_grid import TimeGrid
from morphcore.simulate.trim import StartMode
from morphcore.simulate.trim_controls import MIN_AUTHORITY, TrimControl, no_authority, trim_controls
from morphcore.simulate.wake import NominalStart, trimmed_schedules

Array = NDArray[np.float64]
Trimmed = Callable[[Array], FlexibleTrim]  # at angles of the trim drives, rad

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

    With trim drives the moments that they balance vanish: the angles are found by the secant method over
    whole trims (Broyden's for several), from those of the rigid model. Their schedules count from their first
    values.

    Raises
    ------
    InvalidInput
        ``start="given"`` and the flight has none; a trim drive does not exist, cannot balance its moment, or
        its schedule leaves its range.
    TrimNotFound
        There is no such steady flight.
    """
    model, controls = flight.model, trim_controls(flight.model.aircraft, flight.model.flight)
    schedules = of_every_part(model.aircraft, schedules)
    if not controls or start == "given":
        path = hinge_path(model, schedules, grid)
        return path, trim_flexible(flight, path, wind_N, start=start)
    times = grid.times_s

    def trimmed(drives_rad: Array) -> FlexibleTrim:
        first = trimmed_schedules(model, schedules, times[:1], NominalStart(0.0, tuple(drives_rad.tolist())))
        return trim_flexible(flight, hinge_path(model, first, grid), wind_N, start=start)

    angles = _rigid_angles(model, schedules, float(times[0]), len(controls))
    for k, control in enumerate(controls):
        angles[k] = np.clip(angles[k], control.low, control.high)
    find = _by_secants if len(controls) == 1 else _by_broyden
    found, angles = find(model, controls, trimmed, angles)
    flown = trimmed_schedules(model, schedules, times, NominalStart(found.alpha, tuple(angles.tolist())))
    return hinge_path(model, flown, grid), found


def _by_secants(
    model: FlexibleModel, controls: Sequence[TrimControl], trimmed: Trimmed, angles: Array
) -> tuple[FlexibleTrim, Array]:
    """The trim in which the moment of one control vanishes, and its angle (1,), from a guess."""
    (control,), angle = controls, float(angles[0])
    axis, low, high, scale = control.axis, control.low, control.high, _scale(model)
    found = trimmed(np.array([angle]))
    step = PROBE_RAD if angle + PROBE_RAD <= high else -PROBE_RAD
    for _ in range(MAX_ROUNDS):
        new = trimmed(np.array([angle + step]))
        slope = float(new.moment_B[axis] - found.moment_B[axis]) / step
        angle, found = angle + step, new
        if not abs(slope) > MIN_AUTHORITY * scale:
            raise no_authority(control, angle, float(found.moment_B[axis]))
        wanted = angle - float(found.moment_B[axis]) / slope
        step = float(np.clip(wanted, low, high)) - angle
        if step == 0.0 and wanted != angle:
            raise no_authority(control, angle, float(found.moment_B[axis]))
        if abs(step) < TOLERANCE_RAD:
            return found, np.array([angle])
    raise TrimNotFound(residual=abs(step), iterations=MAX_ROUNDS, flight=described(model.flight))


def _by_broyden(
    model: FlexibleModel, controls: Sequence[TrimControl], trimmed: Trimmed, angles: Array
) -> tuple[FlexibleTrim, Array]:
    """The trim in which the moments of several controls vanish, and their angles, from a guess."""
    axes = [control.axis for control in controls]
    low, high = (np.array([getattr(each, end) for each in controls]) for end in ("low", "high"))
    found, slopes = trimmed(angles), np.zeros((len(controls), len(controls)))
    for k, control in enumerate(controls):
        probe = np.zeros(angles.size)
        probe[k] = PROBE_RAD if angles[k] + PROBE_RAD <= high[k] else -PROBE_RAD
        new = trimmed(angles + probe)
        slopes[:, k] = (new.moment_B[axes] - found.moment_B[axes]) / probe[k]
        angles, found = angles + probe, new
        if not abs(slopes[k, k]) > MIN_AUTHORITY * _scale(model):
            raise no_authority(control, float(angles[k]), float(found.moment_B[axes[k]]))
    step = np.zeros(angles.size)
    for _ in range(MAX_ROUNDS):
        wanted = angles - np.linalg.solve(slopes, found.moment_B[axes])
        step = np.clip(wanted, low, high) - angles
        for k in np.flatnonzero((step == 0.0) & (wanted != angles)).tolist():
            raise no_authority(controls[k], float(angles[k]), float(found.moment_B[axes[k]]))
        if np.abs(step).max() < TOLERANCE_RAD:
            return found, angles
        new = trimmed(angles + step)
        change = new.moment_B[axes] - found.moment_B[axes]
        slopes += np.outer(change - slopes @ step, step) / (step @ step)
        angles, found = angles + step, new
    raise TrimNotFound(
        residual=float(np.abs(step).max()), iterations=MAX_ROUNDS, flight=described(model.flight)
    )


def _scale(model: FlexibleModel) -> float:
    """Moment of a coefficient of one, N m."""
    area = sum(surface.area_m2 for surface in model.aircraft.surfaces)
    chord = max(surface.mean_chord_m for surface in model.aircraft.surfaces)
    return model.flight.dynamic_pressure_pa * area * chord


def _rigid_angles(model: FlexibleModel, schedules: Sequence[Schedule], time_s: float, count: int) -> Array:
    """Angles of the trim drives of the rigid model, rad; 0 if that has no trim."""
    unbent = model.lattice.settings.model_copy(update={"shape": "undeformed"})
    rigid = chain_model(model.aircraft, model.flight, 1, unbent)
    angles = np.array([each.motion([time_s]).angle[0] for each in schedules])
    try:
        return np.array(start_at(rigid, angles, "trim").drives_rad or np.zeros(count))
    except (InvalidInput, TrimNotFound):
        return np.zeros(count)
