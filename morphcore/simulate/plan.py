"""The plan shared by all flights of one sample: time grid, hinge motion, wind and lattice along the morph."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from morphcore.aero.operator import LatticeOperator, lattice_operator
from morphcore.errors import InvalidInput
from morphcore.geometry.aircraft import Aircraft
from morphcore.geometry.control import Control
from morphcore.geometry.hinge import Hinge
from morphcore.models.equivalent import ChainModel
from morphcore.multibody.kernels.hinge import H_TWIST
from morphcore.shown import Shown
from morphcore.simulate.control_motion import (
    control_angles,
    deflections,
    lagged_deflections,
    of_every_part,
)
from morphcore.simulate.operator_table import ControlTable, OperatorTable
from morphcore.simulate.schedule import Hold, Schedule
from morphcore.simulate.surface_motion import surface_accelerations, surface_rows
from morphcore.simulate.time_grid import STEP_S, TimeGrid
from morphcore.simulate.trim import StartMode
from morphcore.simulate.wake import (
    NominalStart,
    nominal_start,
    refuse_moved_trim,
    trim_columns,
    trimmed_schedules,
    wake_direction,
)

Array = NDArray[np.float64]

NODE_SPACING_RAD = (
    0.025  # of the lattice table along the morph; interpolated by cubics (see tests/simulate/test_plan.py)
)
ALIKE_RAD = 1e-9  # hinges of both sides that differ by less move alike: the flight rolls by less than that
RANGE_SLACK = 1e-9  # of a path's width: round-off of a schedule that ends at the path's end


@dataclass(frozen=True, repr=False)
class Middles(Shown):
    """Data in the middles of the steps, read by the stages of a flight.

    angles, rates : (steps, h) of all hinges, rad and rad/s. hinges : (steps, s, HINGE_ROWS) for the kernels.
    wind_N : (steps, 3) m/s. table : the plan's own, at the positions of the middles.
    """

    angles: Array
    rates: Array
    hinges: Array
    wind_N: Array
    table: OperatorTable


@dataclass(frozen=True, repr=False)
class FlightPlan(Shown):
    """Everything about a flight that does not depend on the parameters.

    aircraft : the model, with s surfaces on h hinges. angles, rates, accelerations : (steps + 1, h) of all
    hinges, rad, rad/s, rad/s^2. hinges : (steps + 1, s, HINGE_ROWS) for the kernels. wind_N : (steps + 1, 3)
    m/s. middle : hinges, wind and lattices between the grid times. halved : the aircraft is one half of a
    symmetric one whose other half moves alike.
    """

    grid: TimeGrid
    aircraft: Aircraft
    angles: Array
    rates: Array
    accelerations: Array
    hinges: Array
    wind_N: Array
    table: OperatorTable
    middle: Middles
    halved: bool = False

    def flown(self, model: ChainModel) -> ChainModel:
        """The model that flies this plan: the given one, or one half of it."""
        return _flown(model, halved=self.halved)

    def coarser(self, grid: TimeGrid) -> FlightPlan:
        """The same flight on a coarser grid, whose ``halved`` is this plan's grid; nothing is recomputed.

        Raises
        ------
        ValueError : the grid's steps and middles are not among this plan's.
        """
        every, rest = divmod(self.grid.steps, grid.steps)
        if every == 1:
            return self
        if rest or every % 2:
            raise ValueError(f"{grid.steps} steps and their middles are not among {self.grid.steps}")
        own, between = slice(None, None, every), slice(every // 2, None, every)
        return replace(
            self,
            grid=grid,
            angles=self.angles[own],
            rates=self.rates[own],
            accelerations=self.accelerations[own],
            hinges=np.ascontiguousarray(self.hinges[own]),
            wind_N=np.ascontiguousarray(self.wind_N[own]),
            table=self.table.at(own),
            middle=Middles(
                self.angles[between],
                self.rates[between],
                np.ascontiguousarray(self.hinges[between]),
                np.ascontiguousarray(self.wind_N[between]),
                self.table.at(between),
            ),
        )

    def instants(self, rows: NDArray[np.int64]) -> FlightPlan:
        """The plan restricted to some grid times, for evaluation there; it cannot be flown."""
        return replace(
            self,
            angles=self.angles[rows],
            rates=self.rates[rows],
            accelerations=self.accelerations[rows],
            hinges=np.ascontiguousarray(self.hinges[rows]),
            wind_N=np.ascontiguousarray(self.wind_N[rows]),
            table=self.table.at(rows),
        )

    @cached_property
    def mean_accelerations(self) -> Array:
        """(steps, s, 6) of the surfaces relative to the fuselage over each step, in W, rad/s^2 and m/s^2.

        From the mean accelerations of the hinges, at their position in the middle of the step.
        """
        mean = np.diff(self.rates, axis=0) / self.grid.step_s
        return surface_accelerations(self.aircraft, self.middle.angles, self.middle.rates, mean)

    @cached_property
    def surface_accelerations(self) -> Array:
        """(steps + 1, s, 6) of the surfaces relative to the fuselage at the grid times, in W."""
        return surface_accelerations(self.aircraft, self.angles, self.rates, self.accelerations)

    @property
    def first_deflections(self) -> Array:
        """(m,) of the controls' parts at the first grid time, for which a flight is trimmed."""
        controls = self.table.controls
        return np.zeros(0) if controls is None else controls.deflection[0]

    def at_rest(self) -> FlightPlan:
        """The plan's first moment with its hinges held: where a flight is trimmed."""
        hinges, still = self.hinges[:1].copy(), np.zeros_like(self.rates[:1])
        hinges[:, :, H_TWIST : H_TWIST + 6] = 0.0
        return replace(self, angles=self.angles[:1], rates=still, accelerations=still, hinges=hinges)


def flight_plan(
    model: ChainModel,
    schedules: Sequence[Schedule],
    grid: TimeGrid,
    *,
    air_velocity_N: Callable[[Array], Array] | None = None,
    node_spacing_rad: float = NODE_SPACING_RAD,
    may_halve: bool = False,
    start: StartMode = "trim",
    wake_alpha: float | None = None,
) -> FlightPlan:
    """Prepare a flight: one schedule for each of the aircraft's hinges, then one for each control, or none.

    The wake leaves along the free stream at the angle of attack ``wake_alpha``, rad; None: that of the start
    at the first hinge angles (`wake.nominal_start`), where also the trim drive is. With ``wake_alpha`` or
    ``start="given"`` all drives follow their schedules.

    With ``may_halve``, and if the aircraft is symmetric, its hinges move alike and the air is uniform, the
    plan is for half of it: ``plan.flown(model)`` is the model to fly, provided that both wings have the same
    parameters.
    """
    times = grid.halves_s
    schedules = of_every_part(model.aircraft, schedules)
    if wake_alpha is None:
        begin = start_at(model, np.array([each.motion(times[:1]).angle[0] for each in schedules]), start)
        schedules, wake_alpha = trimmed_schedules(model, schedules, times, begin), begin.alpha
    motion = _motion(model.aircraft, schedules, times)
    if may_halve and air_velocity_N is None:
        model, motion = _halved(model, motion)
    wind_N = None if air_velocity_N is None else air_velocity_N(times)
    table = _operator_table(model, motion, node_spacing_rad, wake_alpha, 0.5 * grid.step_s)
    return _plan(model, grid, motion, table, wind_N)


@dataclass(frozen=True)
class _Motion:
    """Angles, rates and accelerations (k, h) of all hinges, rad, rad/s, rad/s^2.

    deflected : (k, c) deflections of all controls, trailing edge down, rad.
    """

    angles: Array
    rates: Array
    accelerations: Array
    deflected: Array

    def columns(self, chosen: Sequence[int], controls: Sequence[int]) -> _Motion:
        """The motion of some of the hinges and controls."""
        kept = list(chosen)
        own = self.angles[:, kept], self.rates[:, kept], self.accelerations[:, kept]
        return _Motion(*own, self.deflected[:, list(controls)])


def _motion(aircraft: Aircraft, schedules: Sequence[Schedule], times: Array) -> _Motion:
    of_hinges = np.zeros((3, times.size, len(aircraft.hinges)))
    for column, schedule in enumerate(schedules[: len(aircraft.hinges)]):
        motion = schedule.motion(times)
        of_hinges[:, :, column] = motion.angle, motion.rate, motion.acceleration
    angles, rates, accelerations = of_hinges
    deflected = deflections(aircraft, control_angles(aircraft, schedules, times))
    return _Motion(angles, rates, accelerations, deflected)


def start_at(model: ChainModel, angles: Array, start: StartMode) -> NominalStart:
    """The start (`wake.nominal_start`) of a plan whose schedules begin at angles (h + c,), rad."""
    return nominal_start(model, angles, start, _instant)


def _instant(model: ChainModel, angles: Array, wake_alpha: float) -> FlightPlan:
    """A plan of one short step with everything held at angles (h + c,), rad."""
    held = [Hold(float(angle)) for angle in angles]
    return flight_plan(model, held, TimeGrid(0.0, STEP_S, 1, None), may_halve=True, wake_alpha=wake_alpha)


@dataclass(frozen=True)
class CommonPath:
    """Some drives of an aircraft at a common angle: the lattice over a range of it, for schedules within it.

    Plans of different schedules share its nodes, so that a further schedule needs no new lattice; models that
    differ only in their links may share them too.

    low_rad, high_rad : the range. drives : names of those that move together; None: all. Others hold their
    hinges' own angles. matrices, strips : as in ``OperatorTable``, at equal spacing over the range. halved :
    as in ``FlightPlan``. begin : the start for which the lattice was tabulated. controls : as in
    ``ControlTable``; None without control surfaces.
    """

    low_rad: float
    high_rad: float
    drives: tuple[str, ...] | None
    matrices: Array
    strips: Array
    halved: bool
    begin: NominalStart
    controls: Array | None = None

    def flown(self, model: ChainModel) -> ChainModel:
        """The model that flies the plans: the given one, or one half of it."""
        return _flown(model, halved=self.halved)

    def moves(self, hinge: Hinge) -> bool:
        """Whether a hinge moves."""
        return _moves(hinge, self.drives)

    def plan(self, model: ChainModel, schedule: Schedule, grid: TimeGrid) -> FlightPlan:
        """Prepare a flight in which the hinges of the path's drives follow one schedule.

        Raises
        ------
        InvalidInput : the schedule leaves the range.
        """
        motion = schedule.motion(grid.halves_s)
        width = self.high_rad - self.low_rad
        share = (motion.angle - self.low_rad) / width
        if share.min() < -RANGE_SLACK or share.max() > 1.0 + RANGE_SLACK:
            raise InvalidInput(
                f"the schedule runs from {motion.angle.min():g} to {motion.angle.max():g} rad",
                pointer="/schedule",
                hint=f"this path's range is {self.low_rad:g}..{self.high_rad:g} rad",
            )
        position = share * (self.matrices.shape[0] - 1)
        flown = self.flown(model)
        schedules = path_schedules(flown.aircraft, self.drives, schedule)
        schedules = trimmed_schedules(flown, schedules, grid.halves_s, self.begin)
        moved = _motion(flown.aircraft, schedules, grid.halves_s)
        controls = _control_table(flown, self.controls, moved, 0.5 * grid.step_s)
        return _plan(flown, grid, moved, OperatorTable(self.matrices, self.strips, position, controls))


def common_path(
    model: ChainModel,
    low_rad: float,
    high_rad: float,
    node_spacing_rad: float = NODE_SPACING_RAD,
    *,
    drives: Sequence[str] | None = None,
    may_halve: bool = False,
    start: StartMode = "trim",
    wake_alpha: float | None = None,
    initial_rad: float | None = None,
) -> CommonPath:
    """Tabulate the lattice for some drives together between two angles, the others at their held angles.

    drives : names; None: all. may_halve, start, wake_alpha : as in ``flight_plan``. initial_rad : the angle
    at which flights begin; None: ``low_rad``.

    Raises
    ------
    InvalidInput : the trim drive is among the path's drives.
    """
    chosen = None if drives is None else tuple(drives)
    sizes = [
        size
        for part, size in zip(model.aircraft.hinges, path_lengths(model.aircraft), strict=True)
        if _moves(part, chosen)
    ]
    width = (high_rad - low_rad) * max(sizes, default=1.0)
    path = np.linspace(low_rad, high_rad, _nodes(width, node_spacing_rad))
    angles = path_angles(model.aircraft, chosen, path)
    still = np.zeros_like(angles)
    deflected = deflections(model.aircraft, path_controls(model.aircraft, chosen, path))
    motion = _Motion(angles, still, still, deflected)
    begin = NominalStart(wake_alpha) if wake_alpha is not None else None
    if begin is None:
        refuse_moved_trim(model, [_moves(part, chosen) for part in model.aircraft.moved_parts], start)
        at = np.array([low_rad if initial_rad is None else initial_rad])
        first = np.concatenate(
            [path_angles(model.aircraft, chosen, at)[0], path_controls(model.aircraft, chosen, at)[0]]
        )
        begin = start_at(model, first, start)
        if begin.drive_rad is not None:
            columns = trim_columns(model.aircraft, model.flight.trim_drive)
            angles[:, columns[columns < angles.shape[1]]] = begin.drive_rad
    if may_halve:
        model, motion = _halved(model, motion)
    mach, wake = model.flight.mach or 0.0, wake_direction(begin.alpha)
    # a path of controls alone has one lattice
    rows = motion.angles if np.ptp(motion.angles, axis=0).any() else motion.angles[:1]
    operators = [
        lattice_operator(model.lattice, tuple(row), mach=mach, wake_direction_B=wake) for row in rows
    ]
    return CommonPath(
        low_rad,
        high_rad,
        chosen,
        np.stack([item.matrix for item in operators]),
        np.stack([item.strips for item in operators]),
        bool(model.lattice.images),
        begin,
        _stacked_controls(operators),
    )


def path_lengths(aircraft: Aircraft) -> Array:
    """What (h,) a unit of each hinge counts in the path along which lattices are tabulated: 1 for an angle.

    Extensions count in lengths of their surface: by as much as an angle of the same size moves its tip.
    """
    return np.array(
        [
            1.0 / surface.length_m if hinge.prismatic else 1.0
            for surface in aircraft.surfaces
            for hinge in surface.hinges
        ]
    )


def path_angles(aircraft: Aircraft, drives: Sequence[str] | None, angle_rad: Array) -> Array:
    """Angles (k, h) of all hinges when some drives (None: all) are at angles (k,), rad, and others hold."""
    angles = np.empty((angle_rad.size, len(aircraft.hinges)))
    for column, hinge in enumerate(aircraft.hinges):
        angles[:, column] = angle_rad if _moves(hinge, drives) else hinge.angle_rad
    return angles


def path_controls(aircraft: Aircraft, drives: Sequence[str] | None, angle_rad: Array) -> Array:
    """Angles (k, c) of all controls' drives, like `path_angles`; None moves hinges alone."""
    angles = np.empty((angle_rad.size, len(aircraft.controls)))
    for column, control in enumerate(aircraft.controls):
        angles[:, column] = angle_rad if _moves(control, drives) else control.angle_rad
    return angles


def path_schedules(aircraft: Aircraft, drives: Sequence[str] | None, schedule: Schedule) -> list[Schedule]:
    """A schedule for each hinge, then for each control.

    The given one for the moving drives (None: those of all hinges), a held angle for the others.
    """
    return [schedule if _moves(part, drives) else Hold(part.angle_rad) for part in aircraft.moved_parts]


def _moves(part: Hinge | Control, drives: Sequence[str] | None) -> bool:
    return isinstance(part, Hinge) if drives is None else part.drive in drives


def _flown(model: ChainModel, *, halved: bool) -> ChainModel:
    half = model.half if halved else None
    return model if half is None else half


def _plan(
    model: ChainModel,
    grid: TimeGrid,
    motion: _Motion,
    table: OperatorTable,
    wind_N: Array | None = None,
) -> FlightPlan:
    """A plan from a motion, a table and wind at the grid's times and middles in alternation."""
    hinges = surface_rows(model.aircraft, motion.angles, motion.rates)
    if wind_N is None:
        wind_N = np.tile(model.flight.wind_N, (2 * grid.steps + 1, 1))
    own, between = (table.at(part) for part in (slice(0, None, 2), slice(1, None, 2)))
    return FlightPlan(
        grid,
        model.aircraft,
        motion.angles[::2],
        motion.rates[::2],
        motion.accelerations[::2],
        hinges[::2],
        wind_N[::2],
        own,
        Middles(
            motion.angles[1::2],
            motion.rates[1::2],
            np.ascontiguousarray(hinges[1::2]),
            np.ascontiguousarray(wind_N[1::2]),
            between,
        ),
        halved=bool(model.lattice.images),
    )


def _halved(model: ChainModel, motion: _Motion) -> tuple[ChainModel, _Motion]:
    """One half of an aircraft whose halves move alike, and its motion; the whole if they do not."""
    mirror, half = model.mirror, model.half
    if mirror is None or half is None:
        return model, motion
    own, image = (motion.angles[:, list(side)] for side in (mirror.own_hinges, mirror.image_hinges))
    up, down = (motion.deflected[:, list(side)] for side in (mirror.own_controls, mirror.image_controls))
    if max(np.abs(own - image).max(initial=0.0), np.abs(up - down).max(initial=0.0)) > ALIKE_RAD:
        return model, motion
    return half, motion.columns(mirror.own_hinges, mirror.own_controls)


def _nodes(length_rad: float, spacing_rad: float) -> int:
    """Number of nodes of a lattice table over a path: a cubic needs four."""
    return max(4, int(np.ceil(length_rad / spacing_rad)) + 1)


def _stacked_controls(operators: Sequence[LatticeOperator]) -> Array | None:
    controls = np.stack([item.controls for item in operators])
    return controls if controls.shape[2] else None


def _control_table(
    model: ChainModel, controls: Array | None, motion: _Motion, spacing_s: float
) -> ControlTable | None:
    if controls is None:
        return None
    lagged = lagged_deflections(model.aircraft, model.flight.airspeed_m_s, motion.deflected, spacing_s)
    lattice = model.lattice
    return ControlTable(controls, lattice.control_columns, lagged[:, lattice.slopes.control])


def _operator_table(
    model: ChainModel, motion: _Motion, spacing: float, wake_alpha: float, spacing_s: float
) -> OperatorTable:
    mach, angles, wake = model.flight.mach or 0.0, motion.angles, wake_direction(wake_alpha)
    moved = np.abs(np.diff(angles, axis=0)) * path_lengths(model.aircraft)
    # a surface turns by no more than all its hinges together
    turned = np.stack([moved[:, own].sum(axis=1) for own in model.aircraft.hinge_columns])
    travelled = np.concatenate([[0.0], np.cumsum(turned.max(axis=0))])

    def operator(row: Array) -> LatticeOperator:
        return lattice_operator(model.lattice, tuple(row), mach=mach, wake_direction_B=wake)

    if travelled[-1] < 1e-9:
        operators = [operator(angles[0])]
        position = np.zeros(travelled.size)
    else:
        count = _nodes(travelled[-1], spacing)
        nodes = np.linspace(0.0, travelled[-1], count)
        # strictly rising abscissae for the inverse: while a shape is held, many times have the same path
        # length
        moving = np.concatenate([[True], np.diff(travelled) > 0])
        rows = np.stack([np.interp(nodes, travelled[moving], column[moving]) for column in angles.T], axis=1)
        operators = [operator(row) for row in rows]
        position = travelled / nodes[1]
    return OperatorTable(
        np.stack([item.matrix for item in operators]),
        np.stack([item.strips for item in operators]),
        position,
        _control_table(model, _stacked_controls(operators), motion, spacing_s),
    )
