"""Work-precision diagram of the candidate time steppers: attitude error against stages; seconds a stage."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from benchmarks.stage import Course, Stages
from benchmarks.steppers import FORMER, SHIPPED, STEPPERS, Stepper
from morphcore.export.figure import (
    BLUE,
    GREEN,
    INK,
    ORANGE,
    SKY,
    VERMILION,
    headline,
    light_grid,
    power_of_ten,
    rendered,
)
from morphcore.frames import euler_from_quaternion, wrap_angle
from morphcore.geometry.aircraft import Aircraft, Flight
from morphcore.identify.cost import sample_schedules
from morphcore.models.equivalent import ChainModel, chain_model, lane_constants, physical_guess
from morphcore.simulate.batch import fly_batch
from morphcore.simulate.plan import FlightPlan, flight_plan
from morphcore.simulate.time_grid import TimeGrid
from morphcore.simulate.trajectory import Trajectory
from morphcore.simulate.trim import trim, trimmed_state

Array = NDArray[np.float64]
Figures = dict[str, Any]
Clock = Callable[[], float]

GOAL_RAD = 1e-4
PARTS = (1, 2, 3, 4, 6)  # steps in the time between two rows of a sample
QUICK_PARTS = (1, 2, 4)
QUICK = (SHIPPED, FORMER)
FINE_PARTS = 40  # of the reference, which is extrapolated from these and half as many: right to 1e-9 rad
LINKS = 3
LARGEST_SHOWN_RAD = 1e-2


def work_precision(
    aircraft: Aircraft,
    flight: Flight,
    samples: Sequence[Trajectory],
    *,
    links: int = LINKS,
    steppers: Mapping[str, Stepper] = STEPPERS,
    parts: Sequence[int] = PARTS,
    clock: Clock = time.thread_time,
) -> Figures:
    """Fly every sample with every stepper at several steps.

    Parameters
    ----------
    samples : flights with evenly spaced rows; their sweep is followed by the physical guess. parts : steps in
        the time between two rows. clock : rising seconds, for the cost of a stage.

    Returns
    -------
    JSON-able: links, goal_rad, ``flights``: for each its name and ``steppers``: name -> step_s,
    stages_per_s (of flight), error_rad (largest of all angles at the rows; None where it diverged) as lists;
    ``holding``: stepper -> the longest step_s tried that, with all shorter ones, holds the goal on all
    flights, and its stages_per_s (None: none does); ``stage_s``: median seconds of one stage of one flight.
    """
    model = chain_model(aircraft, flight, links)
    flights, stage_s = [], []
    for number, sample in enumerate(samples):
        flown = _Flight(model, sample, number)
        rows: Figures = {}
        for name, stepper in steppers.items():
            found = [flown.error(stepper, count) for count in parts]
            rows[name] = {
                "step_s": [flown.row_s / count for count in parts],
                "stages_per_s": [stages for _, stages in found],
                "error_rad": [error for error, _ in found],
            }
        flights.append({"name": sample.name, "steppers": rows})
        stage_s.append(flown.stage_seconds(clock))
    return {
        "links": links,
        "goal_rad": GOAL_RAD,
        "flights": flights,
        "holding": {name: _holding(flights, name) for name in steppers},
        "stage_s": statistics.median(stage_s),
    }


def quick_work_precision(aircraft: Aircraft, flight: Flight, samples: Sequence[Trajectory]) -> Figures:
    """The shipped stepper and the one before it at three steps: a few seconds of work."""
    chosen = {name: STEPPERS[name] for name in QUICK}
    return work_precision(aircraft, flight, samples, steppers=chosen, parts=QUICK_PARTS)


def work_precision_table(figures: Figures) -> list[tuple[str, str, str, str]]:
    """Stepper, longest step that holds the goal, stages a second then, and cost over the cheapest."""
    held = figures["holding"]
    minimum = min((row["stages_per_s"] for row in held.values() if row), default=1.0)
    lines = []
    for name, row in sorted(held.items(), key=lambda item: item[1]["stages_per_s"] if item[1] else np.inf):
        if row is None:
            lines.append((name, "none tried", "-", "-"))
            continue
        step, stages = f"{1e3 * row['step_s']:.3g} ms", f"{row['stages_per_s']:.0f}"
        lines.append((name, step, stages, f"{row['stages_per_s'] / minimum:.1f}"))
    return lines


def work_precision_plot(figures: Figures) -> dict[str, bytes]:
    """``work_precision.svg``: attitude error against stages per simulated second, one panel a flight."""
    flights = figures["flights"]
    figure = Figure(figsize=(7.2, 3.9 * len(flights) + 1.6))
    inches = float(figure.get_figheight())
    grid = figure.add_gridspec(
        len(flights), 1, hspace=0.28, left=0.11, right=0.98, top=1.0 - 0.55 / inches, bottom=1.95 / inches
    )
    names = list(figures["holding"])
    styles = {name: _style(i) for i, name in enumerate(names)}
    for i, flight in enumerate(flights):
        axes = figure.add_subplot(grid[i, 0])
        for name, row in flight["steppers"].items():
            error = np.array([np.nan if e is None else e for e in row["error_rad"]])
            error[error > LARGEST_SHOWN_RAD] = np.nan
            axes.plot(row["stages_per_s"], error, markersize=3.5, **styles[name])
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.axhline(figures["goal_rad"], color=INK, linewidth=0.8)
        axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
        axes.xaxis.set_minor_formatter(lambda value, _: f"{value:g}" if f"{value:g}"[0] in "25" else "")
        axes.yaxis.set_major_formatter(power_of_ten)
        axes.tick_params(which="both", labelsize=8.5)
        axes.set_ylabel("largest error of attitude, rad", fontsize=9)
        axes.set_title(flight["name"], fontsize=9, loc="left")
        light_grid(axes)
    figure.axes[-1].set_xlabel("stages a simulated second", fontsize=9)
    headline(figure, f"Time steppers of the equivalent model, {figures['links']} links a wing")
    figure.legend(
        handles=[Line2D([], [], markersize=3.5, label=name, **styles[name]) for name in names],
        loc="lower center",
        ncols=2,
        frameon=False,
        fontsize=8.5,
        handlelength=3.0,
    )
    return rendered("work_precision", figure, ("svg",))


def _style(number: int) -> dict[str, Any]:
    colours = (VERMILION, ORANGE, BLUE, GREEN, SKY, INK)
    marks = ("o", "s", "^")
    lines = ("-", (0, (4, 2)), (0, (1, 1.5)))
    return {
        "color": colours[number % len(colours)],
        "marker": marks[number // len(colours)],
        "linestyle": lines[number // len(colours)],
        "linewidth": 1.8 if number == 0 else 1.1,
    }


def _holding(flights: Sequence[Figures], name: str) -> Figures | None:
    """The longest step from which on all errors of all flights are within the goal."""
    rows = [flight["steppers"][name] for flight in flights]
    worst = [
        max(np.inf if error is None else error for error in errors)
        for errors in zip(*(row["error_rad"] for row in rows), strict=True)
    ]
    order = np.argsort(rows[0]["step_s"])
    held = None
    for i in order:
        if not worst[i] <= GOAL_RAD:
            break
        held = {"step_s": rows[0]["step_s"][i], "stages_per_s": max(row["stages_per_s"][i] for row in rows)}
    return held


class _Flight:
    """A sample's flight with its reference, for steppers in Python."""

    def __init__(self, model: ChainModel, sample: Trajectory, number: int) -> None:
        self.model, self.sample = model, sample
        self.rows = sample.time_s.size - 1
        self.row_s = float(sample.time_s[-1] - sample.time_s[0]) / self.rows
        self.batch = physical_guess(model)
        schedules = sample_schedules(model.aircraft, sample, f"/samples/{number}")
        start = float(sample.time_s[0])
        self.shipped, coarse, fine = (
            flight_plan(model, schedules, TimeGrid(start, self.row_s / parts, parts * self.rows, None))
            for parts in (1, FINE_PARTS // 2, FINE_PARTS)
        )
        self.course = Course(model, schedules, fine)
        self.found = trim(model, self.batch, fine).require()
        flown = [self._compiled(plan)[:: plan.grid.steps // self.rows] for plan in (coarse, fine)]
        self.reference = flown[1] + wrap_angle(flown[1] - flown[0]) / 3.0

    def _compiled(self, plan: FlightPlan) -> Array:
        """Euler angles (steps + 1, 3) of the compiled, shipped stepper."""
        constants = lane_constants(self.model, self.batch, plan.grid.step_s)
        constants.set_thrust(*self.found.acting_B)
        state = trimmed_state(self.model, self.batch, plan, self.found)
        rows = [chunk.rows[..., 0] for chunk in fly_batch(self.model, plan, constants, state, record_rows=4)]
        return euler_from_quaternion(np.concatenate(rows))

    def attitude(self, stepper: Stepper, parts: int) -> tuple[Array, int]:
        """Euler angles (rows + 1, 3) with so many steps a row, and the stages that took."""
        stages = Stages(self.model, self.batch, self.course, self.found)
        with np.errstate(over="ignore", invalid="ignore"):  # a step that is too long diverges
            flown = [u[:4, 0] for u in stepper(stages, self.row_s / parts, parts * self.rows)]
        return euler_from_quaternion(np.stack(flown)[::parts]), stages.count

    def error(self, stepper: Stepper, parts: int) -> tuple[float | None, float]:
        """Largest error, rad (None: diverged), and stages a simulated second."""
        attitude, stages = self.attitude(stepper, parts)
        apart = np.abs(wrap_angle(attitude - self.reference))
        error = float(apart.max()) if np.all(np.isfinite(apart)) else None
        return error, stages / (self.row_s * self.rows)

    def stage_seconds(self, clock: Clock) -> float:
        """Seconds of one stage of the compiled stepper, one flight alone; median of five flights."""
        times = []
        for _ in range(5):
            begin = clock()
            self._compiled(self.shipped)
            times.append((clock() - begin) / (self.rows + 1))
        return statistics.median(times)
