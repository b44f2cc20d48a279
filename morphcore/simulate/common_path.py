"""Plans of flights whose drives move along one path: they share the lattice that is tabulated along it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from morphcore.aero.bent_shape import BentShape
from morphcore.aero.operator import lattice_operator
from morphcore.errors import InvalidInput
from morphcore.geometry.aircraft import Aircraft
from morphcore.geometry.control import Control
from morphcore.geometry.hinge import Hinge
from morphcore.models.equivalent import ChainModel
from morphcore.simulate.control_motion import deflections
from morphcore.simulate.operator_table import OperatorTable
from morphcore.simulate.plan import (
    NODE_SPACING_RAD,
    FlightPlan,
    Motion,
    assembled_plan,
    control_table,
    half_if,
    halved_motion,
    motion_of,
    node_count,
    path_lengths,
    stacked_controls,
    start_at,
)
from morphcore.simulate.schedule import Hold, Schedule
from morphcore.simulate.time_grid import TimeGrid
from morphcore.simulate.trim import StartMode
from morphcore.simulate.trim_controls import trim_controls
from morphcore.simulate.wake import NominalStart, refuse_moved_trim, trimmed_schedules, wake_direction

Array = NDArray[np.float64]

RANGE_SLACK = 1e-9  # of a path's width: round-off of a schedule that ends at the path's end


@dataclass(frozen=True)
class CommonPath:
    """Some drives of an aircraft at a common angle: the lattice over a range of it, for schedules within it.

    Plans of different schedules share its nodes, so that a further schedule needs no new lattice; models that
    differ only in their links may share them too.

    low_rad, high_rad : the range. drives : names of those that move together; None: all. Others hold their
    hinges' own angles. matrices, strips : as in ``OperatorTable``, at equal spacing over the range. halved :
    as in ``FlightPlan``. begin : the start for which the lattice was tabulated. controls : as in
    ``ControlTable``; None without control surfaces. shape : of the surfaces, or of the half that flies.
    """

    low_rad: float
    high_rad: float
    drives: tuple[str, ...] | None
    matrices: Array
    strips: Array
    halved: bool
    begin: NominalStart
    controls: Array | None = None
    shape: BentShape | None = None

    def flown(self, model: ChainModel) -> ChainModel:
        """The model that flies the plans: the given one, or one half of it."""
        return half_if(model, halved=self.halved)

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
                f"the schedule runs from {motion.angle.min():g} to {motion.angle.max():g}",
                pointer="/schedule",
                hint=f"this path's range is {self.low_rad:g}..{self.high_rad:g}",
            )
        position = share * (self.matrices.shape[0] - 1)
        flown = self.flown(model)
        schedules = path_schedules(flown.aircraft, self.drives, schedule)
        schedules = trimmed_schedules(flown, schedules, grid.halves_s, self.begin)
        moved = motion_of(flown.aircraft, schedules, grid.halves_s)
        controls = control_table(flown, self.controls, moved, 0.5 * grid.step_s)
        table = OperatorTable(self.matrices, self.strips, position, controls)
        return assembled_plan(flown, grid, moved, table, self.shape)


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
    InvalidInput : a trim drive is among the path's drives.
    """
    chosen = None if drives is None else tuple(drives)
    sizes = [
        size
        for part, size in zip(model.aircraft.hinges, path_lengths(model.aircraft), strict=True)
        if _moves(part, chosen)
    ]
    width = (high_rad - low_rad) * max(sizes, default=1.0)
    path = np.linspace(low_rad, high_rad, node_count(width, node_spacing_rad))
    angles = path_angles(model.aircraft, chosen, path)
    still = np.zeros_like(angles)
    deflected = deflections(model.aircraft, path_controls(model.aircraft, chosen, path))
    motion = Motion(angles, still, still, deflected)
    begin = NominalStart(wake_alpha) if wake_alpha is not None else None
    if begin is None:
        refuse_moved_trim(model, [_moves(part, chosen) for part in model.aircraft.moved_parts], start)
        at = np.array([low_rad if initial_rad is None else initial_rad])
        first = np.concatenate(
            [path_angles(model.aircraft, chosen, at)[0], path_controls(model.aircraft, chosen, at)[0]]
        )
        begin = start_at(model, first, start)
        if begin.drives_rad:
            held = trim_controls(model.aircraft, model.flight)
            for control, angle in zip(held, begin.drives_rad, strict=True):
                angles[:, control.columns[control.columns < angles.shape[1]]] = angle
    shape = begin.shape
    if may_halve:
        model, motion, shape = halved_motion(model, motion, shape)
    mach, wake = model.flight.mach or 0.0, wake_direction(begin.alpha, model.flight.sideslip_rad)
    # a path of controls alone has one lattice
    rows = motion.angles if np.ptp(motion.angles, axis=0).any() else motion.angles[:1]
    operators = [
        lattice_operator(model.lattice, tuple(row), mach=mach, wake_direction_B=wake, shape=shape)
        for row in rows
    ]
    return CommonPath(
        low_rad,
        high_rad,
        chosen,
        np.stack([item.matrix for item in operators]),
        np.stack([item.strips for item in operators]),
        bool(model.lattice.images),
        begin,
        stacked_controls(operators),
        shape,
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
