"""Figures of the paper's report: flights of the truth, verification, searches, predictions, the front."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter

from morphcore.export.figure import (
    ANGLES,
    BLUE,
    GREEN,
    ORANGE,
    SKY,
    VERMILION,
    Document,
    draw,
    draw_drive,
    drive_panels,
    is_cost,
    is_silent,
    label_axis,
    legend_above,
    light_grid,
    power_of_ten,
    printable,
    series,
    stack,
    time_axis,
)
from morphcore.export.plots import STYLES, angle_error
from morphcore.frames import wrap_angle

WIDTH_IN = 7.2
LEGEND_IN, TWO_ROWS_IN = 0.38, 0.56  # inches above the panels for names in one row, in two rows
FLIGHT_COLOURS = (BLUE, VERMILION, GREEN, ORANGE, SKY, "0.35")
DASHED = (0, (5, 2))
TRUTH, RIGID, EQUIVALENT = (STYLES[name] for name in ("measured", "rigid", "identified"))
OTHERS: tuple[dict[str, Any], ...] = (EQUIVALENT, {"color": ORANGE, "linewidth": 1.5, "linestyle": DASHED})
MRAD = 1e3  # in a radian
MIN_ERROR_MRAD = 1e-3  # half the height of the axis of an error within round-off


def truth_figure(flights: Sequence[Document]) -> Figure:
    """Pitch (deg), tip (m, up) and sweep (deg) of several flights over time.

    Parameters
    ----------
    flights : ``{"label", "sample": {"time_s", "theta_rad", "sweep_right_rad", "role"}, "tip_right_z_m"}``;
        held-out flights are dashed.
    """
    figure = Figure(figsize=(WIDTH_IN, 6.0))
    rows = stack(figure, (1.0, 0.7, 0.7), TWO_ROWS_IN)
    longest = max((series(each["sample"]["time_s"]) for each in flights), key=lambda times: times[-1])
    for number, each in enumerate(flights):
        sample = each["sample"]
        time_s = series(sample["time_s"])
        style: dict[str, Any] = {
            "label": printable(str(each["label"])),
            "color": FLIGHT_COLOURS[number % len(FLIGHT_COLOURS)],
            "linewidth": 1.3,
            "linestyle": "-" if sample["role"] == "train" else DASHED,
        }
        draw(rows[0], time_s, np.degrees(series(sample["theta_rad"])), **style)
        draw(rows[1], time_s, -series(each["tip_right_z_m"]), **style)  # body z points down
        draw(rows[2], time_s, np.degrees(series(sample["sweep_right_rad"])), **style)
    for axes, label in zip(rows, ("pitch θ, deg", "tip above root, m", "sweep, deg"), strict=True):
        label_axis(axes, label)
    time_axis(figure, rows, longest)
    legend_above(figure, rows[0].get_lines(), columns=3, below_top_in=0.0)
    return figure


def verification_figure(curves: Document) -> Figure:
    """One flight: the moving angles (deg) in all three models, the equivalent model's errors, the sweep.

    Parameters
    ----------
    curves : one sample of an identification's curves.
    """
    time_s = series(curves["time_s"])
    measured = {key: np.unwrap(series(curves["measured"][key])) for key, _ in ANGLES}
    moving = [(key, label) for key, label in ANGLES if not is_silent([measured[key]])] or [ANGLES[1]]
    heights = [1.0] * len(moving) + [0.55, 0.45]
    figure = Figure(figsize=(WIDTH_IN, 0.9 + 1.75 * sum(heights)))
    rows = stack(figure, heights, LEGEND_IN)
    errors = rows[-2]
    for axes, (key, label) in zip(rows, moving, strict=False):
        label_axis(axes, f"{label}, deg")
        draw(axes, time_s, np.degrees(measured[key]), label="flexible model", **TRUTH)
        for model, name, style in (
            ("rigid", "rigid model", RIGID),
            ("identified", "equivalent model", EQUIVALENT),
        ):
            error = angle_error(curves, model, key)
            draw(axes, time_s, np.degrees(measured[key] + error), label=name, **style)
            if model == "identified":
                draw(errors, time_s, MRAD * error, **EQUIVALENT)
    label_axis(errors, "error, mrad")
    errors.axhline(0.0, color="0.5", linewidth=0.6)
    _widened(errors, MIN_ERROR_MRAD)
    (panel,) = drive_panels(curves)
    draw_drive(rows[-1], time_s, panel)
    time_axis(figure, rows, time_s)
    legend_above(figure, rows[0].get_lines(), below_top_in=0.0)
    return figure


def search_figure(searches: Mapping[str, Sequence[Document]]) -> Figure:
    """Minimum cost J so far against flights flown, both logarithmic, for several searches.

    Parameters
    ----------
    searches : name -> history, rows of ``{"flights", "best_cost"}``.
    """
    figure = Figure(figsize=(WIDTH_IN, 3.6))
    axes = figure.add_axes((0.115, 0.14, 0.865, 0.82))
    light_grid(axes)
    for number, (name, history) in enumerate(searches.items()):
        rows = [row for row in history if is_cost(row.get("best_cost")) and is_cost(row.get("flights"))]
        axes.plot(
            [row["flights"] for row in rows],
            [row["best_cost"] for row in rows],
            label=printable(name),
            drawstyle="steps-post",
            marker="o",
            markersize=2.5,
            **OTHERS[number % len(OTHERS)],
        )
    axes.set_xscale("log")
    axes.set_yscale("log")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(FuncFormatter(power_of_ten))
        axis.set_minor_formatter(NullFormatter())
    axes.tick_params(labelsize=8.5)
    axes.set_xlabel("flights flown", fontsize=9)
    axes.set_ylabel("least J so far, rad²", fontsize=9)
    axes.legend(frameon=False, fontsize=8.5, loc="lower left")
    return figure


def front_figure(points: Sequence[Document]) -> Figure:
    """Attitude variation (rad²) against the duration of the morph: constant rate, optimum, optimum flown.

    Parameters
    ----------
    points : ``{"duration_s", "constant_rad2", "optimum_rad2", "flown_rad2"}`` in ascending order of duration.
    """
    figure = Figure(figsize=(WIDTH_IN, 3.4))
    axes = figure.add_axes((0.115, 0.15, 0.865, 0.81))
    duration_s = [point["duration_s"] for point in points]
    for name, label, style in (
        ("constant_rad2", "constant rate", {**RIGID, "marker": "s", "markerfacecolor": "white"}),
        ("optimum_rad2", "optimum", {**EQUIVALENT, "marker": "o"}),
        ("flown_rad2", "optimum, flexible model", {"color": "0.25", "linestyle": "none", "marker": "x"}),
    ):
        axes.plot(duration_s, [point[name] for point in points], label=label, markersize=5, **style)
    label_axis(axes, "variation, rad²")
    axes.margins(x=0.04)
    axes.set_ylim(bottom=0.0)
    axes.set_xlabel("duration of the morph, s", fontsize=9)
    axes.legend(frameon=False, fontsize=8.5, loc="lower left")
    return figure


def independent_figure(samples: Sequence[Document], laws: Sequence[Document]) -> Figure:
    """Another program's flights and ours: moving angles (deg) on the left, errors (mrad) on the right.

    Parameters
    ----------
    samples : ``{"name", "time_s", "phi_rad", "theta_rad", "psi_rad"}``.
    laws : ``{"core", "flights": [{"ours": {"phi_rad", ...}}]}``, flights in the order of the samples.
    """
    shown = [
        (number, key, label)
        for number, sample in enumerate(samples)
        for key, label in ANGLES
        if not is_silent([series(sample[key])])
    ]
    figure = Figure(figsize=(9.0, 0.8 + 1.35 * len(shown)))
    inches = float(figure.get_figheight())
    grid = figure.add_gridspec(
        len(shown), 2, hspace=0.42, wspace=0.19, left=0.085, right=0.985,
        top=1.0 - 0.58 / inches, bottom=0.5 / inches,
    )  # fmt: skip
    for row, (number, key, label) in enumerate(shown):
        sample = samples[number]
        time_s, theirs = series(sample["time_s"]), series(sample[key])
        left, right = figure.add_subplot(grid[row, 0]), figure.add_subplot(grid[row, 1])
        draw(left, time_s, np.degrees(theirs), label="their flight", **TRUTH)
        for law, style in zip(laws, OTHERS, strict=False):
            error = wrap_angle(series(law["flights"][number]["ours"][key]) - theirs)
            draw(
                left, time_s, np.degrees(theirs + error), label=f"ours, vortex core “{law['core']}”", **style
            )
            draw(right, time_s, MRAD * error, **style)
        right.axhline(0.0, color="0.5", linewidth=0.6)
        label_axis(left, f"{label}, deg")
        label_axis(right, "error, mrad")
        left.set_title(printable(str(sample["name"])), loc="left", fontsize=8.5, pad=3.0)
        for axes in (left, right):
            axes.set_xlim(time_s[0], time_s[-1])
            if row == len(shown) - 1:
                axes.set_xlabel("time, s", fontsize=9)
    legend_above(figure, figure.axes[0].get_lines(), below_top_in=0.0)
    return figure


def _widened(axes: Axes, minimum: float) -> None:
    """Axis limits at least ``least`` wide on both sides, so that round-off appears as a line."""
    low, high = axes.get_ylim()
    axes.set_ylim(min(low, -minimum), max(high, minimum))
