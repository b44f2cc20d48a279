"""What all flights of one sample share: the time grid, hinge motion, wind and the lattice along the morph."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from morphcore.aero.operator import LatticeOperator, lattice_operator
from morphcore.errors import InvalidInput
from morphcore.frames import skew
from morphcore.geometry.aircraft import Aircraft
from morphcore.geometry.surface import Surface
from morphcore.models.equivalent import ChainModel
from morphcore.multibody.kernels.hinge import H_ORIGIN, H_RATE, H_SUBSPACE, HINGE_ROWS
from morphcore.shown import Shown
from morphcore.simulate.kernels.interpolate import blend
from morphcore.simulate.schedule import HingeMotion, Schedule

Array = NDArray[np.float64]

# holds attitude within 1e-4 rad of the converged solution on the reference aircraft (tests/simulate)
STEP_S = 0.01
NODE_SPACING_RAD = (
    0.025  # of the lattice table along the morph; interpolated by cubics (see tests/simulate/test_plan.py)
)
ALIKE_RAD = 1e-9  # hinges of both sides that differ by less move alike: their flight rolls by less than that
RANGE_SLACK = 1e-9  # of a path's width: round-off of a schedule that ends at its end


@dataclass(frozen=True)
class TimeGrid:
    """Equal steps from ``start_s``; rows ``at`` of the grid are the output times (None: they differ)."""

    start_s: float
    step_s: float
    steps: int
    at: NDArray[np.int64] | None

    @property
    def times_s(self) -> Array:
        """(steps + 1,) times."""
        return np.asarray(self.start_s + self.step_s * np.arange(self.steps + 1), dtype=np.float64)

    @property
    def middles_s(self) -> Array:
        """(steps,) times in the middles of the steps."""
        return np.asarray(self.start_s + self.step_s * (np.arange(self.steps) + 0.5), dtype=np.float64)

    @property
    def halves_s(self) -> Array:
        """(2 steps + 1,) times and middles, in turn."""
        times = np.empty(2 * self.steps + 1)
        times[::2], times[1::2] = self.times_s, self.middles_s
        return times

    def halved(self, times: int = 1) -> TimeGrid:
        """The grid with all steps halved so many times."""
        parts = 2**times
        at = None if self.at is None else self.at * parts
        return TimeGrid(self.start_s, self.step_s / parts, self.steps * parts, at)


def time_grid(output_s: ArrayLike, longest_step_s: float = STEP_S) -> TimeGrid:
    """Make a grid that hits evenly spaced output times; others need interpolation (``at`` is None)."""
    times = np.asarray(output_s, dtype=np.float64)
    spacing = (times[-1] - times[0]) / (times.size - 1)
    if np.allclose(np.diff(times), spacing, rtol=1e-6, atol=1e-9):
        substeps = int(np.ceil(spacing / longest_step_s - 1e-9))
        steps = substeps * (times.size - 1)
        return TimeGrid(float(times[0]), spacing / substeps, steps, np.arange(times.size) * substeps)
    steps = int(np.ceil((times[-1] - times[0]) / longest_step_s - 1e-9))
    return TimeGrid(float(times[0]), float(times[-1] - times[0]) / steps, steps, None)


@dataclass(frozen=True, repr=False)
class OperatorTable(Shown):
    """Reduced lattice operators at nodes along the morph, interpolated by local cubics in the path length.

    matrices : (nodes, rows, columns); strips : (nodes, strips, 3); position : (steps + 1,) of each grid time
    among the nodes, in node spacings.
    """

    matrices: Array
    strips: Array
    position: Array

    def between(self, first: int, last: int) -> tuple[Array, Array]:
        """Operators (k, rows, columns) and strips (k, strips, 3) at the grid times first..last - 1."""
        nodes = self.matrices.shape[0]
        position = self.position[first:last]
        if nodes == 1:
            base = np.zeros(position.size, dtype=np.int64)
            weights = np.ones((position.size, 1))
        else:
            base = np.clip(np.floor(position).astype(np.int64) - 1, 0, nodes - 4)
            s = position - base
            # Lagrange's cubic through four neighbours
            cubic = [np.prod([(s - j) / (i - j) for j in range(4) if j != i], axis=0) for i in range(4)]
            weights = np.stack(cubic, axis=1)
        return _blended(self.matrices, weights, base), _blended(self.strips, weights, base)


@dataclass(frozen=True, repr=False)
class Middles(Shown):
    """What the stages of a flight read, in the middles of its steps.

    hinges : (steps, s, HINGE_ROWS) for the kernels. wind_N : (steps, 3) m/s. table : the plan's own, at the
    positions of the middles.
    """

    hinges: Array
    wind_N: Array
    table: OperatorTable


@dataclass(frozen=True, repr=False)
class FlightPlan(Shown):
    """Everything about a flight that does not depend on the parameters.

    angles, rates, accelerations : (steps + 1, s), rad, rad/s, rad/s^2. hinges : (steps + 1, s, HINGE_ROWS)
    for the kernels. wind_N : (steps + 1, 3) m/s. middle : hinges, wind and lattices between the grid times.
    halved : the s surfaces are one half of a symmetric aircraft whose other half does the same.
    """

    grid: TimeGrid
    angles: Array
    rates: Array
    accelerations: Array
    hinges: Array
    wind_N: Array
    table: OperatorTable
    middle: Middles
    halved: bool = False

    def flown(self, model: ChainModel) -> ChainModel:
        """What flies this plan: the model, or one half of it."""
        return _flown(model, halved=self.halved)

    def coarser(self, grid: TimeGrid) -> FlightPlan:
        """The same flight on a grid that gives this plan's by ``halved``: nothing is computed anew.

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
        position = self.table.position
        return replace(
            self,
            grid=grid,
            angles=self.angles[own],
            rates=self.rates[own],
            accelerations=self.accelerations[own],
            hinges=np.ascontiguousarray(self.hinges[own]),
            wind_N=np.ascontiguousarray(self.wind_N[own]),
            table=replace(self.table, position=position[own]),
            middle=Middles(
                np.ascontiguousarray(self.hinges[between]),
                np.ascontiguousarray(self.wind_N[between]),
                replace(self.table, position=position[between]),
            ),
        )

    def instants(self, rows: NDArray[np.int64]) -> FlightPlan:
        """What the plan has at some grid times alone, to evaluate there; it cannot be flown."""
        return replace(
            self,
            angles=self.angles[rows],
            rates=self.rates[rows],
            accelerations=self.accelerations[rows],
            hinges=np.ascontiguousarray(self.hinges[rows]),
            wind_N=np.ascontiguousarray(self.wind_N[rows]),
            table=replace(self.table, position=self.table.position[rows]),
        )

    @property
    def mean_accelerations(self) -> Array:
        """(steps, s) mean acceleration of the hinges over each step, rad/s^2."""
        return np.diff(self.rates, axis=0) / self.grid.step_s

    def at_rest(self) -> FlightPlan:
        """The plan's first moment with its hinges held: where a flight is trimmed."""
        hinges, accelerations = self.hinges[:1].copy(), self.accelerations[:1]
        hinges[:, :, H_RATE] = 0.0
        return replace(self, hinges=hinges, accelerations=np.zeros_like(accelerations))


def _hinged(aircraft: Aircraft) -> NDArray[np.bool_]:
    """(s,) which surfaces have a hinge."""
    return np.array([surface.hinge is not None for surface in aircraft.surfaces])


def _blended(nodes: Array, weights: Array, base: NDArray[np.int64]) -> Array:
    out = np.empty((base.size, *nodes.shape[1:]))
    blend(weights, base, nodes.reshape(nodes.shape[0], -1), out.reshape(base.size, -1))
    return out


def flight_plan(
    model: ChainModel,
    schedules: Sequence[Schedule],
    grid: TimeGrid,
    *,
    air_velocity_N: Callable[[Array], Array] | None = None,
    node_spacing_rad: float = NODE_SPACING_RAD,
    may_halve: bool = False,
) -> FlightPlan:
    """Prepare a flight: one schedule per surface (of fixed surfaces it is not looked at).

    With ``may_halve``, and if the aircraft is symmetric, its hinges move alike and the air is uniform, the
    plan is one for half of it: ``plan.flown(model)`` is what flies it, if both wings have the same
    parameters.
    """
    times = grid.halves_s
    motions = [schedule.motion(times) for schedule in schedules]
    if may_halve and air_velocity_N is None:
        model, motions = _halved(model, motions)
    angles = np.stack([motion.angle for motion in motions], axis=1)
    wind_N = None if air_velocity_N is None else air_velocity_N(times)
    table = _operator_table(model, angles * _hinged(model.aircraft), node_spacing_rad)
    return _plan(model, grid, motions, table, wind_N)


@dataclass(frozen=True)
class CommonPath:
    """All hinges of an aircraft at one angle: the lattice over a range of it, for schedules within the range.

    Plans of different schedules share its nodes, so that another one costs no lattice; models that differ in
    their links alone may share them too.

    low_rad, high_rad : the range. matrices, strips : as of ``OperatorTable``, at equal distances over it.
    halved : as of ``FlightPlan``.
    """

    low_rad: float
    high_rad: float
    matrices: Array
    strips: Array
    halved: bool

    def flown(self, model: ChainModel) -> ChainModel:
        """What flies the plans: the model, or one half of it."""
        return _flown(model, halved=self.halved)

    def plan(self, model: ChainModel, schedule: Schedule, grid: TimeGrid) -> FlightPlan:
        """Prepare a flight in which all hinges follow one schedule.

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
        table = OperatorTable(self.matrices, self.strips, position)
        flown = self.flown(model)
        return _plan(flown, grid, [motion] * len(flown.aircraft.surfaces), table)


def common_path(
    model: ChainModel,
    low_rad: float,
    high_rad: float,
    node_spacing_rad: float = NODE_SPACING_RAD,
    *,
    may_halve: bool = False,
) -> CommonPath:
    """Tabulate the lattice for all hinges alike between two angles; ``may_halve`` as of ``flight_plan``."""
    if may_halve and model.half is not None:
        model = model.half
    mach = model.flight.mach or 0.0
    count = max(4, int(np.ceil((high_rad - low_rad) / node_spacing_rad)) + 1)
    rows = np.outer(np.linspace(low_rad, high_rad, count), _hinged(model.aircraft))
    operators = [lattice_operator(model.lattice, tuple(row), mach=mach) for row in rows]
    return CommonPath(
        low_rad,
        high_rad,
        np.stack([item.matrix for item in operators]),
        np.stack([item.strips for item in operators]),
        bool(model.lattice.images),
    )


def _flown(model: ChainModel, *, halved: bool) -> ChainModel:
    half = model.half if halved else None
    return model if half is None else half


def _plan(
    model: ChainModel,
    grid: TimeGrid,
    motions: Sequence[HingeMotion],
    table: OperatorTable,
    wind_N: Array | None = None,
) -> FlightPlan:
    """A plan of motions, table and wind at the grid's times and middles in turn."""
    hinges = np.stack(
        [
            hinge_rows(surface, motion.angle, motion.rate)
            for surface, motion in zip(model.aircraft.surfaces, motions, strict=True)
        ],
        axis=1,
    )
    angles, rates, accelerations = (
        np.stack([getattr(motion, name)[::2] for motion in motions], axis=1)
        for name in ("angle", "rate", "acceleration")
    )
    if wind_N is None:
        wind_N = np.tile(model.flight.wind_N, (2 * grid.steps + 1, 1))
    own, between = (
        replace(table, position=table.position[part]) for part in (slice(0, None, 2), slice(1, None, 2))
    )
    return FlightPlan(
        grid,
        angles,
        rates,
        accelerations,
        hinges[::2],
        wind_N[::2],
        own,
        Middles(np.ascontiguousarray(hinges[1::2]), np.ascontiguousarray(wind_N[1::2]), between),
        halved=bool(model.lattice.images),
    )


def _halved(model: ChainModel, motions: list[HingeMotion]) -> tuple[ChainModel, list[HingeMotion]]:
    """The half of an aircraft that does what the other one does, and its motions; all if there is none."""
    mirror, half = model.mirror, model.half
    if mirror is None or half is None:
        return model, motions
    hinged = _hinged(model.aircraft)
    differences = [
        np.abs(motions[own].angle - motions[image].angle).max()
        for own, image in zip(mirror.own, mirror.image, strict=True)
        if hinged[own]
    ]
    if max(differences, default=0.0) > ALIKE_RAD:
        return model, motions
    return half, [motions[own] for own in mirror.own]


def hinge_rows(surface: Surface, angle: Array, rate: Array) -> Array:
    """Rows of the hinge's motion for the kernels, (k, HINGE_ROWS); see multibody/kernels/hinge.py."""
    rows = np.zeros((angle.size, HINGE_ROWS))
    axis_offset = np.array([surface.elastic_axis_x_m, 0.0, 0.0])
    root = np.array(surface.position_m)
    if surface.hinge is None:
        rows[:, :9] = np.eye(3).ravel()
        rows[:, H_ORIGIN:] = root + axis_offset
        return rows
    sign, axis = surface.rotation_sign, surface.hinge.axis_index
    pivot = np.array(surface.hinge.position_m)
    direction = np.eye(3)[axis]
    along = np.outer(direction, direction)
    cosine, sine = np.cos(angle)[:, None, None], (sign * np.sin(angle))[:, None, None]
    R_BW = along + cosine * (np.eye(3) - along) + sine * skew(direction)  # Rodrigues' formula
    arm_W = root - pivot + axis_offset  # from the hinge axis to the first link's origin, constant in W
    direction = sign * direction
    rows[:, :9] = R_BW.reshape(-1, 9)
    rows[:, H_SUBSPACE : H_SUBSPACE + 3] = direction
    rows[:, H_SUBSPACE + 3 : H_SUBSPACE + 6] = np.cross(direction, arm_W)
    rows[:, H_RATE] = rate
    rows[:, H_ORIGIN:] = pivot + R_BW @ arm_W
    return rows


def _operator_table(model: ChainModel, angles: Array, spacing: float) -> OperatorTable:
    mach = model.flight.mach or 0.0
    travelled = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(angles, axis=0)).max(axis=1))])

    def operator(row: Array) -> LatticeOperator:
        return lattice_operator(model.lattice, tuple(row), mach=mach)

    if travelled[-1] < 1e-9:
        operators = [operator(angles[0])]
        position = np.zeros(travelled.size)
    else:
        count = max(4, int(np.ceil(travelled[-1] / spacing)) + 1)
        nodes = np.linspace(0.0, travelled[-1], count)
        # strictly rising abscissae for the inverse: a held shape has the same path length for many times
        moving = np.concatenate([[True], np.diff(travelled) > 0])
        rows = np.stack([np.interp(nodes, travelled[moving], column[moving]) for column in angles.T], axis=1)
        operators = [operator(row) for row in rows]
        position = travelled / nodes[1]
    return OperatorTable(
        np.stack([item.matrix for item in operators]), np.stack([item.strips for item in operators]), position
    )
