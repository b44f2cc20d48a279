"""One flight of a rigid or an equivalent model: schedules in, trajectory out."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from morphcore.aero.environment import Environment, air_velocity
from morphcore.errors import FlightDiverged, InvalidInput
from morphcore.frames import euler_from_quaternion, rotation_from_quaternion
from morphcore.geometry.aircraft import Aircraft, Flight
from morphcore.geometry.lattice import DEFAULT_LATTICE, LatticeSettings
from morphcore.models.equivalent import (
    ChainModel,
    ParameterBatch,
    chain_model,
    lane_constants,
    physical_guess,
)
from morphcore.models.kernels.layout import JOINTS, OMEGA, POSITION, VELOCITY
from morphcore.models.kinematics import tip_positions
from morphcore.multibody.kernels.hinge import HINGE_ROWS
from morphcore.simulate.batch import fly_batch
from morphcore.simulate.plan import STEP_S, FlightPlan, flight_plan, time_grid
from morphcore.simulate.schedule import Schedule, Tabulated
from morphcore.simulate.trajectory import Trajectory, checked
from morphcore.simulate.trim import StartMode, Trim, trim, trimmed_state

Array = NDArray[np.float64]

OUTPUT_STEP_S = 0.01  # as the example flights
LARGEST_JOINT_ANGLE_RAD = 0.5 * np.pi  # there flap and lag of a gimbal turn about the same axis
LARGEST_SPEED_RATIO = 10.0  # of the airspeed at the start: no glide gets there
LARGEST_ROWS = 200_000  # of a trajectory
FORMULA_STARTS = ("=", "+", "-", "@", "\t", "\r")  # a spreadsheet would run a cell that begins so


@dataclass(frozen=True)
class Simulation:
    """A flown flight.

    trajectory : attitude and sweep (rad) over time; in ``extra`` p, q, r (rad/s, in B), vx, vy, vz (m/s)
    and x, y, z (m) of the reference point in N, tip_left_z and tip_right_z (m, below the wing's root along z
    of B).
    trim : the start: angle of attack (rad), constant force (N) and moment (N m) in B, joint angles (rad).
    """

    trajectory: Trajectory
    trim: Trim


def simulate(  # noqa: PLR0913 - the conditions of a flight are its arguments
    aircraft: Aircraft,
    flight: Flight,
    schedules: Sequence[Schedule] | Mapping[str, Schedule] | Trajectory,
    *,
    model: Literal["rigid"] | ParameterBatch = "rigid",
    duration_s: float | None = None,
    output_step_s: float = OUTPUT_STEP_S,
    step_s: float = STEP_S,
    start: StartMode = "trim",
    environment: Environment | None = None,
    rng: np.random.Generator | None = None,
    lattice: LatticeSettings = DEFAULT_LATTICE,
) -> Simulation:
    """Fly one aircraft through prescribed hinge motions.

    Parameters
    ----------
    schedules : one for each surface in the aircraft's order (of fixed ones it is not looked at), or one for
        each side as ``{"left": ..., "right": ...}``, or a sample flight whose measured sweep is followed.
    model : "rigid", or the parameters of one equivalent model (`parameters_from_document`, `physical_guess`).
    duration_s : s from time zero; of a sample flight, its own duration from its first time is the default.
    output_step_s : s between the rows of the trajectory. step_s : longest time step, s.
    start : "trim" for straight level flight of this model, "given" for the flight's measured start.
    environment : gust and turbulence on top of the flight's wind. rng : source of the turbulence.
    lattice : panels of each surface and core of their vortices.

    Raises
    ------
    InvalidInput : a schedule leaves its hinge's range, or an argument makes no sense.
    TrimNotFound : there is no steady level flight. FlightDiverged : the flight left the model's domain.
    """
    batch, chain = _model(aircraft, flight, model, lattice)
    times = _output_times(schedules, duration_s, output_step_s, step_s)
    grid = time_grid(times, step_s)
    air = None
    if environment is not None:
        steady = environment

        def air(moments: Array) -> Array:
            return air_velocity(steady, flight, moments, rng)

    plan = flight_plan(chain, _per_surface(aircraft, schedules), grid, air_velocity_N=air)
    _require_hinge_ranges(aircraft, plan)
    found = trim(chain, batch, plan, start=start).require()
    constants = lane_constants(chain, batch, grid.step_s)
    constants.set_thrust(found.force_B, found.moment_B)
    state = trimmed_state(chain, batch, plan, found)
    rows = JOINTS + chain.coordinates
    flown = [chunk.rows[..., 0] for chunk in fly_batch(chain, plan, constants, state, record_rows=rows)]
    history = np.concatenate(flown)
    _require_sound(history, flight, grid.times_s)
    at = np.arange(0, grid.steps + 1, grid.steps // (times.size - 1))
    return Simulation(_trajectory(chain, batch, plan, times, history[at], at), found)


def write_trajectory_csv(trajectory: Trajectory, path: str | Path) -> None:
    """Write a trajectory with the columns of the example flights, SI units and radians.

    `load_trajectory` reads it back.
    """
    columns = {
        "t": trajectory.time_s,
        "sweep_left": trajectory.sweep_left,
        "sweep_right": trajectory.sweep_right,
        "phi": trajectory.phi,
        "theta": trajectory.theta,
        "psi": trajectory.psi,
        **trajectory.extra,
    }
    with Path(path).open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(f"'{name}" if name.startswith(FORMULA_STARTS) else name for name in columns)
        # nine digits: a nanoradian of an attitude of one radian
        writer.writerows([f"{value:.9g}" for value in row] for row in zip(*columns.values(), strict=True))


def _model(
    aircraft: Aircraft, flight: Flight, model: Literal["rigid"] | ParameterBatch, lattice: LatticeSettings
) -> tuple[ParameterBatch, ChainModel]:
    if isinstance(model, ParameterBatch):
        if model.particles != 1:
            raise InvalidInput(
                f"{model.particles} parameter sets for one flight",
                pointer="/model",
                hint="choose one with ParameterBatch.select, or fly them together with fly_batch",
            )
        return model, chain_model(aircraft, flight, model.links, lattice)
    if model != "rigid":
        raise InvalidInput(
            f"model is {model!r}",
            pointer="/model",
            hint='give "rigid" or the parameters of an equivalent model',
        )
    chain = chain_model(aircraft, flight, 1, lattice)
    return physical_guess(chain), chain


def _output_times(
    schedules: Sequence[Schedule] | Mapping[str, Schedule] | Trajectory,
    duration_s: float | None,
    output_step_s: float,
    step_s: float,
) -> Array:
    begin = 0.0
    if isinstance(schedules, Trajectory):
        begin = float(schedules.time_s[0])
        duration_s = schedules.duration_s if duration_s is None else duration_s
    if duration_s is None:
        raise InvalidInput("duration_s is missing", pointer="/duration_s", hint="say how long to fly, s")
    for name, value in (("duration_s", duration_s), ("output_step_s", output_step_s), ("step_s", step_s)):
        if not (np.isfinite(value) and value > 0.0):
            raise InvalidInput(f"{name} is {value}", pointer=f"/{name}", hint="give a positive time in s")
    rows = int(np.floor(min(duration_s / output_step_s, 1e9) + 1e-9)) + 1
    if not 3 <= rows <= LARGEST_ROWS:
        raise InvalidInput(
            f"{duration_s:g} s in steps of {output_step_s:g} s make {rows} rows",
            pointer="/output_step_s",
            hint=f"choose duration_s and output_step_s for 3 to {LARGEST_ROWS} rows",
        )
    return begin + output_step_s * np.arange(rows, dtype=np.float64)


def _per_surface(
    aircraft: Aircraft, schedules: Sequence[Schedule] | Mapping[str, Schedule] | Trajectory
) -> Sequence[Schedule]:
    if isinstance(schedules, Trajectory):
        return [Tabulated(schedules.time_s, schedules.sweep(surface.side)) for surface in aircraft.surfaces]
    if isinstance(schedules, Mapping):
        missing = {surface.side for surface in aircraft.surfaces} - set(schedules)
        if missing:
            raise InvalidInput(
                f"no schedule for the {' and '.join(sorted(missing))} side",
                pointer="/schedules",
                hint='give {"left": ..., "right": ...}',
            )
        return [schedules[surface.side] for surface in aircraft.surfaces]
    if len(schedules) != len(aircraft.surfaces):
        raise InvalidInput(
            f"{len(schedules)} schedules for {len(aircraft.surfaces)} surfaces",
            pointer="/schedules",
            hint="give one for each surface, in the aircraft's order",
        )
    return schedules


def _require_hinge_ranges(aircraft: Aircraft, plan: FlightPlan) -> None:
    for number, (surface, angle) in enumerate(zip(aircraft.surfaces, plan.angles.T, strict=True)):
        if surface.hinge is None:
            continue
        low, high = surface.hinge.min_rad, surface.hinge.max_rad
        outside = surface.hinge.beyond_range(angle)
        if outside.size:
            raise InvalidInput(
                f"the hinge of {surface.name} is driven to {angle[outside[0]]:.4g} rad at "
                f"t = {plan.grid.times_s[outside[0]]:.3f} s, beyond its range {low:g}..{high:g} rad",
                pointer=f"/schedules/{number}",
                hint="lower the final angle, or widen the hinge's min_rad and max_rad",
            )


def _require_sound(history: Array, flight: Flight, times: Array) -> None:
    with np.errstate(over="ignore", invalid="ignore"):
        speed = np.sqrt(np.sum(history[:, VELOCITY:POSITION] ** 2, axis=1))
        largest = np.abs(history[:, JOINTS:]).max(axis=1, initial=0.0)
        sound = (
            np.all(np.isfinite(history), axis=1)
            & (speed < LARGEST_SPEED_RATIO * flight.airspeed_m_s)
            & (largest < LARGEST_JOINT_ANGLE_RAD)
        )
    if not np.all(sound):
        raise FlightDiverged(time_s=float(times[max(int(np.argmin(sound)) - 1, 0)]))


def _trajectory(
    chain: ChainModel,
    batch: ParameterBatch,
    plan: FlightPlan,
    times: Array,
    history: Array,
    at: NDArray[np.int64],
) -> Trajectory:
    quaternion = history[:, :OMEGA]
    euler = euler_from_quaternion(quaternion)
    velocity_N = np.einsum("kij,kj->ki", rotation_from_quaternion(quaternion), history[:, VELOCITY:POSITION])
    columns = np.concatenate([history[:, OMEGA:VELOCITY], velocity_N, history[:, POSITION:JOINTS]], axis=1)
    names = ("p", "q", "r", "vx", "vy", "vz", "x", "y", "z")
    extra = {name: column.copy() for name, column in zip(names, columns.T, strict=True)}
    tips_z = _tips_z(chain, batch, plan, history[:, JOINTS:], at)
    sweeps = {"left": np.zeros(times.size), "right": np.zeros(times.size)}
    for side in sweeps:
        # the first hinged surface of a side is its wing
        for number, surface in enumerate(chain.aircraft.surfaces):
            if surface.side == side and surface.hinge is not None:
                sweeps[side] = plan.angles[at, number]
                extra[f"tip_{side}_z"] = tips_z[:, number]
                break
    trajectory = Trajectory(
        name="simulated",
        time_s=times,
        sweep_left=sweeps["left"],
        sweep_right=sweeps["right"],
        phi=euler[:, 0].copy(),
        theta=euler[:, 1].copy(),
        psi=euler[:, 2].copy(),
        extra=extra,
    )
    return checked(trajectory, "/flight")


def _tips_z(
    chain: ChainModel, batch: ParameterBatch, plan: FlightPlan, q_joint: Array, at: NDArray[np.int64]
) -> Array:
    """Tips below their roots along z of B, (k, s), m."""
    surfaces = len(chain.aircraft.surfaces)
    level = np.zeros((surfaces, HINGE_ROWS))
    level[:, :9] = np.eye(3).ravel()
    # in wing axes all times are one batch; the hinge turns them afterwards
    tips_W = tip_positions(chain, batch.select(np.zeros(at.size, dtype=np.int64)), level, q_joint)
    down_W = plan.hinges[at][:, :, 6:9]  # third row of R_BW
    return np.asarray(np.einsum("ksi,ksi->ks", down_W, tips_W))
