"""One flight of any of the three models: schedules in, trajectory out."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from morphcore.aero.environment import MovingAir, moving_air
from morphcore.errors import InvalidInput
from morphcore.geometry.aircraft import Aircraft, Flight
from morphcore.geometry.obstacle import Obstacle, naming_obstacles, obstacle
from morphcore.models.equivalent import ChainModel, ParameterBatch, chain_model, fitted, physical_guess
from morphcore.models.flexible import flexible_model
from morphcore.models.soft_joints import chain_obstacle
from morphcore.shown import Shown, Summary
from morphcore.simulate.chain_flight import chain_flight
from morphcore.simulate.channels import channel_columns
from morphcore.simulate.flexible import FLEXIBLE_STEP_S
from morphcore.simulate.flexible_flight import flexible_flight
from morphcore.simulate.hinge_schedules import (
    Schedules,
    followed_schedules,
    hinge_schedules,
    require_ranges,
)
from morphcore.simulate.output_request import SurfaceStrips, requested_outputs
from morphcore.simulate.record import FlightRecord, Outputs, air_at_reference, recorded_trajectory
from morphcore.simulate.schedule import Schedule
from morphcore.simulate.shape import Shape
from morphcore.simulate.step_choice import busiest_part, choose_step
from morphcore.simulate.time_grid import STEP_S, TimeGrid, time_grid
from morphcore.simulate.trajectory import Trajectory
from morphcore.simulate.trim import StartMode, Trim
from morphcore.simulate.trim_controls import trim_controls
from morphcore.stopping import Stop
from morphcore.validity import (
    ResultWarning,
    air_motion,
    air_warnings,
    bending_warnings,
    deflection_warnings,
    gust_warnings,
    light_wing_warnings,
    overlap_warnings,
    steep_warning,
    trim_warnings,
    wake_warnings,
)
from morphdata.aircraft import Aircraft as AircraftDocument
from morphdata.environment import Environment
from morphdata.faults import refuse
from morphdata.flight import Flight as FlightDocument
from morphdata.lattice import DEFAULT_LATTICE, Lattice, LatticeShape
from morphdata.points import Point
from morphdata.samplefiles.channel_titles import channel_meant
from morphdata.samplefiles.csv_table import write_table
from morphdata.samplefiles.flight import LONGEST_FLIGHT_S, MAX_ROWS, MIN_ROWS
from morphdata.simulate import DEFAULT_ELEMENTS, OUTPUT_STEP_S
from morphdata.telescopes import unsupported_faults

Array = NDArray[np.float64]
ModelChoice = Literal["rigid", "flexible"] | ParameterBatch


@dataclass(frozen=True, repr=False)
class Simulation(Shown):
    """A flown flight.

    Attributes
    ----------
    trajectory : Trajectory
        Attitude and drives (rad) over time; in ``extra`` the columns of the channels that were requested, by
        default p, q, r (rad/s, in B), vx, vy, vz (m/s) and x, y, z (m) of the reference point in N,
        tip_left_z and tip_right_z (m, below the wing's root along z of B).
    trim : Trim
        The start: angle of attack (rad), constant force (N) and moment (N m) in B, joint angles (rad; none of
        the flexible model).
    step_s : float
        The longest allowed time step, s.
    warnings : tuple of ResultWarning
        Where the flight left the method's range of validity.
    start_tips_z : mapping of str to float
        By side, the tip of its first hinged surface at the start, m below its root.
    trim_drives : mapping of str to float
        Angles, rad, of the flight's trim drives at the start; empty without one.
    shape : Shape or None
        Poses and edges of all surfaces at the requested times.
    strips : tuple of SurfaceStrips
        Where the strips of the surfaces are, if a channel of theirs was requested.
    """

    trajectory: Trajectory
    trim: Trim
    step_s: float
    warnings: tuple[ResultWarning, ...] = ()
    start_tips_z: Mapping[str, float] = field(default_factory=dict)
    trim_drives: Mapping[str, float] = field(default_factory=dict)
    shape: Shape | None = None
    strips: tuple[SurfaceStrips, ...] = ()

    def summary(self) -> Summary:
        """The start of the flight, and the range of its attitude."""
        flown = self.trajectory
        return Summary(
            f"Simulation: {flown.duration_s:g} s in steps of {1e3 * self.step_s:g} ms",
            {"angle of attack at the start, rad": self.trim.alpha}
            | ({"bank angle at the start, rad": self.trim.bank} if self.trim.bank.any() else {})
            | {f"{name} in trim, rad": np.array([angle]) for name, angle in self.trim_drives.items()},
            ("", "from", "to"),
            [
                [f"{name}, rad", values.min(), values.max()]
                for name, values in (
                    *((name.replace("_", " "), flown.drives[name]) for name in flown.drive_order),
                    *zip(("phi", "theta", "psi"), flown.euler.T, strict=True),
                )
            ],
        )


@dataclass(frozen=True)
class FlightStep:
    """Progress of a flight: the fraction flown and, at the end, the result."""

    fraction: float
    simulation: Simulation | None = None


def simulate(  # noqa: PLR0913 - each argument is one condition of the flight
    aircraft: AircraftDocument,
    flight: FlightDocument,
    schedules: Schedules,
    *,
    model: ModelChoice = "rigid",
    duration_s: float | None = None,
    output_step_s: float = OUTPUT_STEP_S,
    step_s: float | None = None,
    start: StartMode = "trim",
    environment: Environment | None = None,
    rng: np.random.Generator | None = None,
    lattice: Lattice = DEFAULT_LATTICE,
    elements: int = DEFAULT_ELEMENTS,
    channels: Sequence[str] | None = None,
    points: Sequence[Point] | None = None,
    shape_times_s: Sequence[float] | None = None,
    stop: Stop | None = None,
) -> Simulation:
    """Fly one aircraft through prescribed motions of its drives.

    Parameters
    ----------
    aircraft : Aircraft
        The aircraft.
    flight : Flight
        Its flight condition.
    schedules : mapping of str to schedule, Schedules or Trajectory
        The motion of the drives by name (``{"sweep_left": ..., "fold": ...}``). A word such as ``fold`` moves
        both sides; ``both``, ``left`` and ``right`` are accepted if they are unambiguous. Alternatively a
        document of such schedules, or a sample flight whose measured angles are followed. Other drives hold
        their hinges' ``angle_rad``.
    model : {"rigid", "flexible"} or ParameterBatch
        The model to fly; a batch holds the parameters of one equivalent model (`parameters_from_document`,
        `physical_guess`).
    duration_s : float, optional
        Time from zero, s. The default for a sample flight is its own duration, from its first time.
    output_step_s : float
        Time between the rows of the trajectory, s.
    step_s : float, optional
        Longest time step, s. None: 1 ms for the flexible model, for the others the longest of
        `step_choice.CANDIDATES_S` that keeps the attitude error within `step_choice.TOLERANCE_RAD` in this
        flight's smooth air.
    start : {"trim", "given"}
        The flight's steady motion in equilibrium of this model, or the flight's measured start.
    environment : Environment, optional
        Gust and turbulence on top of the flight's wind.
    rng : numpy.random.Generator, optional
        Source of the turbulence.
    lattice : Lattice
        Panels of each surface, core of their vortices, and the wings on which it is tabulated.
    elements : int
        Beam elements of each flexible surface, in the flexible model.
    channels : sequence of str, optional
        Names of ``morphdata.channels.CHANNELS``: the columns of ``trajectory.extra``, conventions in
        `morphcore.simulate.channels`. None: those of the example flights.
    points : sequence of Point, optional
        Points besides the reference point at which the channels fx, fy, fz, nx, ny and nz are reported.
    shape_times_s : sequence of float, optional
        Times at which ``Simulation.shape`` holds the shape of the bent aircraft: that of the nearest row.
    stop : callable, optional
        Called several times a second; True raises Interrupted.

    Returns
    -------
    Simulation
        The flight, its trim and warnings.

    Raises
    ------
    InvalidInput
        A schedule leaves its hinge's range or moves no drive, a channel or the surface of a point is unknown,
        or an argument is invalid.
    TrimNotFound
        There is no such steady flight.
    FlightDiverged
        The flight left the model's domain.

    Examples
    --------
    >>> from morphcore import load_aircraft, load_flight, load_trajectory, simulate
    >>> flown = simulate(
    ...     load_aircraft("examples/aircraft.json"),
    ...     load_flight("examples/flight.json"),
    ...     load_trajectory("examples/train_rate_0.8.csv"),
    ...     step_s=0.01,
    ... )
    >>> flown.trajectory.euler.shape
    (175, 3)
    """
    steps = flight_steps(
        Aircraft.of(aircraft), Flight.of(flight), schedules, model=model, duration_s=duration_s,
        output_step_s=output_step_s, step_s=step_s, start=start, environment=environment, rng=rng,
        lattice=lattice, elements=elements, channels=channels, points=points, shape_times_s=shape_times_s,
        stop=stop,
    )  # fmt: skip
    return next(step.simulation for step in steps if step.simulation is not None)


def flight_steps(  # noqa: PLR0913 - as above
    aircraft: Aircraft,
    flight: Flight,
    schedules: Schedules,
    *,
    model: ModelChoice = "rigid",
    duration_s: float | None = None,
    output_step_s: float = OUTPUT_STEP_S,
    step_s: float | None = None,
    start: StartMode = "trim",
    environment: Environment | None = None,
    rng: np.random.Generator | None = None,
    lattice: Lattice = DEFAULT_LATTICE,
    elements: int = DEFAULT_ELEMENTS,
    channels: Sequence[str] | None = None,
    points: Sequence[Point] | None = None,
    shape_times_s: Sequence[float] | None = None,
    stop: Stop | None = None,
) -> Iterator[FlightStep]:
    """Fly as `simulate` does, step by step: yield the fraction flown several times a second, then the flight.

    Aircraft and flight are resolved; they need not be within the limits of documents.
    """
    flyer = _flyer(aircraft, flight, model, lattice, elements)
    longest_s = flyer.step_s if step_s is None else step_s
    times = _output_times(schedules, duration_s, output_step_s, longest_s)
    wanted = requested_outputs(aircraft, flight, times, channels, points, shape_times_s)
    refuse(
        unsupported_faults(
            aircraft.telescoping,
            moving_air=environment is not None and not environment.still,
            channels=channels or (),
            flexible=model == "flexible",
        )
    )
    grid = time_grid(times, longest_s)
    followed = followed_schedules(aircraft, schedules)
    require_ranges(aircraft, followed, grid.times_s, "/schedules")
    each = hinge_schedules(aircraft, followed)
    air, smooth = _airs(environment, aircraft, flight, grid.times_s, rng)
    with naming_obstacles(flyer.obstacle):
        if step_s is None and flyer.chain is not None:
            chain, batch = flyer.chain
            longest_s = choose_step(
                chain, [(each, busiest_part(each, times))], batch, start=start,
                air=smooth, may_halve=chain.is_even(batch), stop=stop,
            ).step_s  # fmt: skip
            grid = time_grid(times, longest_s)
        at = np.arange(0, grid.steps + 1, grid.steps // (times.size - 1))
        flown = flyer.fly(each, grid, at, outputs=wanted.outputs, start=start, air=air, stop=stop)
        for fraction, record in flown:
            if record is None:
                yield FlightStep(fraction)
            else:
                columns = channel_columns(wanted.channels, record, aircraft, flight)
                trajectory = recorded_trajectory(aircraft, times, record, columns)
                warnings = _warnings(aircraft, flight, times, record, smooth, lattice.shape)
                warnings += tuple(gust_warnings(environment, flight, grid.step_s))
                drives = _trim_angles(aircraft, flight, record) if start == "trim" else {}
                if start == "trim":
                    balanced = [control.axis for control in trim_controls(aircraft, flight)]
                    warnings += tuple(trim_warnings(aircraft, flight, record.trim.moment_B[0], balanced))
                tips = _start_tips(aircraft, record)
                yield FlightStep(
                    1.0,
                    Simulation(
                        trajectory, record.trim, longest_s, warnings, tips, drives, record.shape,
                        wanted.strips(aircraft, lattice),
                    ),
                )  # fmt: skip


def _warnings(
    aircraft: Aircraft,
    flight: Flight,
    times: Array,
    record: FlightRecord,
    smooth: MovingAir | None,
    shape: LatticeShape,
) -> tuple[ResultWarning, ...]:
    """Warnings where the flight left the method's validity; turbulence does not count as incidence."""
    wind_N = air_at_reference(flight, smooth, times)
    motion = air_motion(aircraft, times, record.euler, record.velocity_N, wind_N, record.angles)
    motion = replace(motion, stall=record.stall)
    bending = np.zeros((0, 0)) if record.bending is None else record.bending
    return (
        *air_warnings(flight, [("the flight", "/flight", motion)]),
        *bending_warnings(aircraft, bending, "the flight", "/model", shape),
        *([] if record.bending is None else _wake_warnings(aircraft, flight, record)),
        *steep_warning("the flight", "/schedules", record.euler[:, 1]),
        *light_wing_warnings(aircraft, flight),
        *overlap_warnings(aircraft, record.angles),
        *deflection_warnings(aircraft, record.angles),
    )


def _wake_warnings(aircraft: Aircraft, flight: Flight, record: FlightRecord) -> list[ResultWarning]:
    """Surfaces in the wakes of others at the start."""
    alpha = float(record.trim.alpha[0])
    return wake_warnings(
        aircraft, record.angles[0], alpha, "/aircraft/surfaces", sideslip_rad=flight.sideslip_rad
    )


def _is_one_of(channels: Mapping[str, Array], title: str) -> bool:
    """Whether a further column gives one of some channels, in whatever unit."""
    meant = channel_meant(title)
    return meant is not None and meant[0] in channels


def _cell(value: float) -> str:
    """Nine digits, or nothing for a gap of a measured channel."""
    return "" if math.isnan(value) else f"{value:.9g}"


def _trim_angles(aircraft: Aircraft, flight: Flight, record: FlightRecord) -> dict[str, float]:
    """Angles of the trim drives at the start, rad, by name."""
    columns = [k for control in trim_controls(aircraft, flight) for k in control.columns]
    return {aircraft.moved_parts[k].drive: float(record.angles[0, k]) for k in columns}


def _start_tips(aircraft: Aircraft, record: FlightRecord) -> dict[str, float]:
    """By side, z of the tip of its first hinged surface at the start, m below its root."""
    tips: dict[str, float] = {}
    for number, surface in enumerate(aircraft.surfaces):
        if surface.hinges:
            tips.setdefault(surface.side, float(record.tips_z[0, number]))
    return tips


def write_trajectory_csv(trajectory: Trajectory, path: str | Path) -> None:
    """Write a trajectory with the columns of the example flights, SI units and radians.

    Columns of drives that slide name their unit, ``span_left_m``.

    Cells are empty where a measured channel has a gap. `load_trajectory` reads it back.
    """
    measured = trajectory.channels
    columns = {
        "t": trajectory.time_s,
        **{
            trajectory.field_of(name) if trajectory.units.get(name) == "m" else name: trajectory.drives[name]
            for name in trajectory.drive_order
        },
        "phi": trajectory.phi,
        "theta": trajectory.theta,
        "psi": trajectory.psi,
        **measured,
        **{title: values for title, values in trajectory.extra.items() if not _is_one_of(measured, title)},
    }
    with Path(path).open("w", newline="", encoding="utf-8") as stream:
        # nine digits: a nanoradian of an attitude of one radian
        rows = (list(map(_cell, row)) for row in zip(*columns.values(), strict=True))
        write_table(stream, columns, rows)


class _Fly(Protocol):
    """A model's function to fly a grid: it yields fractions, and the record with the last."""

    def __call__(
        self,
        schedules: Sequence[Schedule],
        grid: TimeGrid,
        at: NDArray[np.int64],
        *,
        outputs: Outputs,
        start: StartMode,
        air: MovingAir | None,
        stop: Stop | None,
    ) -> Iterator[tuple[float, FlightRecord | None]]: ...


@dataclass(frozen=True)
class _Flyer:
    """How to fly one kind of model.

    step_s : default time step. obstacle : finds the likely cause of a failed flight. chain : model and
    parameters for which a step can be chosen, if any.
    """

    fly: _Fly
    step_s: float
    obstacle: Callable[[], Obstacle | None]
    chain: tuple[ChainModel, ParameterBatch] | None = None


def _flyer(aircraft: Aircraft, flight: Flight, model: ModelChoice, lattice: Lattice, elements: int) -> _Flyer:
    if isinstance(model, ParameterBatch):
        if model.particles != 1:
            raise InvalidInput(
                f"{model.particles} parameter sets for one flight",
                pointer="/model",
                hint="choose one with ParameterBatch.select, or fly them together with fly_batch",
            )
        chain = chain_model(aircraft, flight, model.links_per_wing, lattice)
        return _chain_flyer(chain, fitted(chain, model))
    if model == "rigid":
        chain = chain_model(aircraft, flight, 1, lattice)
        return _chain_flyer(chain, physical_guess(chain))
    if model == "flexible":
        beams = flexible_model(aircraft, flight, elements=elements, lattice=lattice)
        return _Flyer(partial(flexible_flight, beams), FLEXIBLE_STEP_S, partial(obstacle, aircraft, flight))
    raise InvalidInput(
        f"model is {model!r}",
        pointer="/model",
        hint='give "rigid", "flexible" or the parameters of an equivalent model',
    )


def _chain_flyer(chain: ChainModel, batch: ParameterBatch) -> _Flyer:
    return _Flyer(
        partial(chain_flight, chain, batch), STEP_S, partial(chain_obstacle, chain, batch), (chain, batch)
    )


def _airs(
    environment: Environment | None,
    aircraft: Aircraft,
    flight: Flight,
    times_s: Array,
    rng: np.random.Generator | None,
) -> tuple[MovingAir | None, MovingAir | None]:
    """The flight's gust and turbulence, and the gust alone."""
    if environment is None:
        return None, None
    gust = environment.model_copy(update={"turbulence": None})
    air, smooth = (moving_air(each, flight, times_s, rng, aircraft) for each in (environment, gust))
    return air, smooth


def _output_times(
    schedules: Schedules,
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
    if duration_s > LONGEST_FLIGHT_S:
        raise InvalidInput(
            f"duration_s is {duration_s:g}",
            pointer="/duration_s",
            hint=f"it must be at most {LONGEST_FLIGHT_S:g}",
        )
    rows = int(np.floor(min(duration_s / output_step_s, 1e9) + 1e-9)) + 1
    if not MIN_ROWS <= rows <= MAX_ROWS:
        raise InvalidInput(
            f"{duration_s:g} s in steps of {output_step_s:g} s make {rows} rows",
            pointer="/output_step_s",
            hint=f"choose duration_s and output_step_s for {MIN_ROWS} to {MAX_ROWS} rows",
        )
    return begin + output_step_s * np.arange(rows, dtype=np.float64)
