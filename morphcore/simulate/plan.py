"""The plan shared by all flights of one sample: time grid, hinge motion, wind and lattice along the morph."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from morphcore.aero.bent_shape import BentShape
from morphcore.aero.environment import MovingAir
from morphcore.aero.gust_lag import KUESSNER
from morphcore.aero.operator import LatticeOperator, lattice_operator
from morphcore.geometry.aircraft import Aircraft
from morphcore.models.equivalent import ChainModel
from morphcore.multibody.kernels.hinge import H_TWIST
from morphcore.shown import Shown
from morphcore.simulate.control_motion import (
    control_angles,
    deflections,
    lagged_deflections,
    of_every_part,
)
from morphcore.simulate.gust_table import GustTable, air_rows
from morphcore.simulate.operator_table import ControlTable, OperatorTable
from morphcore.simulate.schedule import Hold, Schedule
from morphcore.simulate.surface_motion import surface_accelerations, surface_rows
from morphcore.simulate.time_grid import STEP_S, TimeGrid
from morphcore.simulate.trim import StartMode
from morphcore.simulate.wake import (
    NominalStart,
    nominal_start,
    trimmed_schedules,
    wake_direction,
)

Array = NDArray[np.float64]

NODE_SPACING_RAD = (
    0.025  # of the lattice table along the morph; interpolated by cubics (see tests/simulate/test_plan.py)
)
ALIKE_RAD = 1e-9  # hinges of both sides that differ by less move alike: the flight rolls by less than that


@dataclass(frozen=True, repr=False)
class Middles(Shown):
    """Data in the middles of the steps, read by the stages of a flight.

    angles, rates : (steps, h) of all hinges, rad and rad/s. hinges : (steps, s, HINGE_ROWS) for the kernels.
    wind_N : (steps, 3) m/s. table : the plan's own, at the positions of the middles. gusts : None without.
    """

    angles: Array
    rates: Array
    hinges: Array
    wind_N: Array
    table: OperatorTable
    gusts: GustTable | None = None

    def air(self, first: int, last: int) -> Array:
        """Rows of the air for the kernels: the uniform wind (3), then what `GustTable.between` gives."""
        return air_rows(self.wind_N, self.gusts, first, last)


@dataclass(frozen=True, repr=False)
class FlightPlan(Shown):
    """Everything about a flight that does not depend on the parameters.

    aircraft : the model, with s surfaces on h hinges. angles, rates, accelerations : (steps + 1, h) of all
    hinges, rad, rad/s, rad/s^2. hinges : (steps + 1, s, HINGE_ROWS) for the kernels. wind_N : (steps + 1, 3)
    m/s, the uniform wind. middle : hinges, wind and lattices between the grid times. halved : the aircraft is
    one half of a symmetric one whose other half moves alike. gusts : None without. shape : of the surfaces on
    which the lattice was tabulated; None: unbent.
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
    gusts: GustTable | None = None
    shape: BentShape | None = None

    def air(self, first: int, last: int) -> Array:
        """Rows of the air at grid times, as `Middles.air`."""
        return air_rows(self.wind_N, self.gusts, first, last)

    def flown(self, model: ChainModel) -> ChainModel:
        """The model that flies this plan: the given one, or one half of it."""
        return half_if(model, halved=self.halved)

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
            gusts=self.gusts and self.gusts.at(own),
            middle=Middles(
                self.angles[between],
                self.rates[between],
                np.ascontiguousarray(self.hinges[between]),
                np.ascontiguousarray(self.wind_N[between]),
                self.table.at(between),
                self.gusts and self.gusts.at(between),
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
            gusts=self.gusts and self.gusts.at(rows),
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
    air: MovingAir | None = None,
    node_spacing_rad: float = NODE_SPACING_RAD,
    may_halve: bool = False,
    start: StartMode = "trim",
    wake_alpha: float | None = None,
    shape: BentShape | None = None,
) -> FlightPlan:
    """Prepare a flight: one schedule for each of the aircraft's hinges, then one for each control, or none.

    The wake leaves along the free stream at the angle of attack ``wake_alpha``, rad, and the lattice is that
    of the ``shape``; None: those of the start at the first hinge angles (`wake.nominal_start`), where also
    the trim drives are. With ``wake_alpha`` or ``start="given"`` all drives follow their schedules.

    air : gust and turbulence. They begin with the flight, whose start is trimmed in the uniform wind.

    With ``may_halve``, and if the aircraft is symmetric, its hinges move alike and the air is uniform, the
    plan is for half of it: ``plan.flown(model)`` is the model to fly, provided that both wings have the same
    parameters.
    """
    times = grid.halves_s
    schedules = of_every_part(model.aircraft, schedules)
    if wake_alpha is None:
        begin = start_at(model, np.array([each.motion(times[:1]).angle[0] for each in schedules]), start)
        schedules = trimmed_schedules(model, schedules, times, begin)
        wake_alpha, shape = begin.alpha, begin.shape
    motion = motion_of(model.aircraft, schedules, times)
    if may_halve and air is None:
        model, motion, shape = halved_motion(model, motion, shape)
    gusts = None
    if air is not None:
        gusts = GustTable(air, model.lattice, wake_alpha, KUESSNER, times, motion.angles)
    table = _operator_table(model, motion, node_spacing_rad, wake_alpha, shape, 0.5 * grid.step_s)
    return assembled_plan(model, grid, motion, table, shape, gusts)


@dataclass(frozen=True)
class Motion:
    """Angles, rates and accelerations (k, h) of all hinges, rad, rad/s, rad/s^2.

    deflected : (k, c) deflections of all controls, trailing edge down, rad.
    """

    angles: Array
    rates: Array
    accelerations: Array
    deflected: Array

    def columns(self, chosen: Sequence[int], controls: Sequence[int]) -> Motion:
        """The motion of some of the hinges and controls."""
        kept = list(chosen)
        own = self.angles[:, kept], self.rates[:, kept], self.accelerations[:, kept]
        return Motion(*own, self.deflected[:, list(controls)])


def motion_of(aircraft: Aircraft, schedules: Sequence[Schedule], times: Array) -> Motion:
    """Angles, rates and accelerations of all hinges and controls at some times (k,)."""
    of_hinges = np.zeros((3, times.size, len(aircraft.hinges)))
    for column, schedule in enumerate(schedules[: len(aircraft.hinges)]):
        motion = schedule.motion(times)
        of_hinges[:, :, column] = motion.angle, motion.rate, motion.acceleration
    angles, rates, accelerations = of_hinges
    deflected = deflections(aircraft, control_angles(aircraft, schedules, times))
    return Motion(angles, rates, accelerations, deflected)


def start_at(model: ChainModel, angles: Array, start: StartMode) -> NominalStart:
    """The start (`wake.nominal_start`) of a plan whose schedules begin at angles (h + c,), rad."""
    return nominal_start(model, angles, start, _instant)


def _instant(model: ChainModel, angles: Array, wake_alpha: float, shape: BentShape | None) -> FlightPlan:
    """A plan of one short step with everything held at angles (h + c,), rad."""
    held = [Hold(float(angle)) for angle in angles]
    grid = TimeGrid(0.0, STEP_S, 1, None)
    return flight_plan(model, held, grid, may_halve=True, wake_alpha=wake_alpha, shape=shape)


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


def half_if(model: ChainModel, *, halved: bool) -> ChainModel:
    """Return one half of a model where the plan is for one."""
    half = model.half if halved else None
    return model if half is None else half


def assembled_plan(
    model: ChainModel,
    grid: TimeGrid,
    motion: Motion,
    table: OperatorTable,
    shape: BentShape | None,
    gusts: GustTable | None = None,
) -> FlightPlan:
    """A plan from a motion, a table and gusts at the grid's times and middles in alternation."""
    hinges = surface_rows(model.aircraft, motion.angles, motion.rates)
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
            gusts and gusts.at(slice(1, None, 2)),
        ),
        halved=bool(model.lattice.images),
        gusts=gusts and gusts.at(slice(0, None, 2)),
        shape=shape,
    )


def halved_motion(
    model: ChainModel, motion: Motion, shape: BentShape | None
) -> tuple[ChainModel, Motion, BentShape | None]:
    """One half of an aircraft whose halves move alike, its motion and shape; the whole if they do not."""
    mirror, half = model.mirror, model.half
    if mirror is None or half is None:
        return model, motion, shape
    own, image = (motion.angles[:, list(side)] for side in (mirror.own_hinges, mirror.image_hinges))
    up, down = (motion.deflected[:, list(side)] for side in (mirror.own_controls, mirror.image_controls))
    if max(np.abs(own - image).max(initial=0.0), np.abs(up - down).max(initial=0.0)) > ALIKE_RAD:
        return model, motion, shape
    own_shape = shape and tuple(shape[k] for k in mirror.own)
    return half, motion.columns(mirror.own_hinges, mirror.own_controls), own_shape


def node_count(length_rad: float, spacing_rad: float) -> int:
    """Number of nodes of a lattice table over a path: a cubic needs four."""
    return max(4, int(np.ceil(length_rad / spacing_rad)) + 1)


def stacked_controls(operators: Sequence[LatticeOperator]) -> Array | None:
    """Columns of the controls of several operators; None without controls."""
    controls = np.stack([item.controls for item in operators])
    return controls if controls.shape[2] else None


def control_table(
    model: ChainModel, controls: Array | None, motion: Motion, spacing_s: float
) -> ControlTable | None:
    """Responses to the controls along a flight; None without controls."""
    if controls is None:
        return None
    lagged = lagged_deflections(model.aircraft, model.flight.airspeed_m_s, motion.deflected, spacing_s)
    lattice = model.lattice
    return ControlTable(controls, lattice.control_columns, lagged[:, lattice.slopes.control])


def _operator_table(
    model: ChainModel,
    motion: Motion,
    spacing: float,
    wake_alpha: float,
    shape: BentShape | None,
    spacing_s: float,
) -> OperatorTable:
    mach, angles = model.flight.mach or 0.0, motion.angles
    wake = wake_direction(wake_alpha, model.flight.sideslip_rad)
    moved = np.abs(np.diff(angles, axis=0)) * path_lengths(model.aircraft)
    # a surface turns by no more than all its hinges together
    turned = np.stack([moved[:, own].sum(axis=1) for own in model.aircraft.hinge_columns])
    travelled = np.concatenate([[0.0], np.cumsum(turned.max(axis=0))])

    def operator(row: Array) -> LatticeOperator:
        return lattice_operator(model.lattice, tuple(row), mach=mach, wake_direction_B=wake, shape=shape)

    if travelled[-1] < 1e-9:
        operators = [operator(angles[0])]
        position = np.zeros(travelled.size)
    else:
        count = node_count(travelled[-1], spacing)
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
        control_table(model, stacked_controls(operators), motion, spacing_s),
    )
