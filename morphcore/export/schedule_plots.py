"""Figures of an optimised morph: schedules, the resulting attitude, duration against variation."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from morphcore.export.figure import (
    ANGLES,
    BLUE,
    GRID,
    SILENT_SPAN_DEG,
    VERMILION,
    Document,
    draw,
    headline,
    is_silent,
    label_axis,
    legend_above,
    light_grid,
    printable,
    quiet,
    rendered,
    series,
    stack,
    time_axis,
)
from morphdata.extensions import knot_values

# Okabe & Ito's colours, also distinguished by line style
STYLES: dict[str, dict[str, Any]] = {
    "constant": {"color": "0.55", "linewidth": 2.6, "linestyle": "-"},
    "rigid_optimum": {"color": VERMILION, "linewidth": 1.4, "linestyle": (0, (4, 4)), "zorder": 3},
    "optimum": {"color": BLUE, "linewidth": 1.5, "linestyle": "-"},
}
LABELS = {
    "constant": "constant rate",
    "rigid_optimum": "rigid model's optimum",
    "optimum": "equivalent model's optimum",
}
BEST_FIRST = ("flexible", "equivalent", "rigid")  # the model in which the attitude is drawn
ANGLE_HEIGHT, SILENT_HEIGHT = 1.0, 0.45  # relative heights of the panels
LIMIT: dict[str, Any] = {"color": "0.35", "linewidth": 0.8, "linestyle": (0, (1, 2))}


def schedule_plots(document: Document, curves: Document) -> dict[str, bytes]:
    """Draw all plots of an optimisation's result.

    Parameters
    ----------
    document : the result; its ``limits`` are drawn as lines, its ``variation`` appears in the legend, its
    ``pareto``, if present, is the front.
    curves : ``{"time_s", "schedules": {name: {"sweep_rad", "rate_rad_s", "acceleration_rad_s2"}}, "flights":
        {model: {name: {"phi_rad", "theta_rad", "psi_rad"}}}}``; the angles are departures from the start.

    Returns
    -------
    File name -> content: ``schedules`` (the paper's figure 10), ``departures`` (figure 11, in the most
    accurate model flown) and, for a front, ``pareto``, each as ``.svg`` and ``.png``. The same input gives
    the same bytes.
    """
    files = rendered("schedules", schedule_figure(document, curves))
    files |= rendered("departures", departure_figure(document, curves))
    if document.get("pareto"):
        files |= rendered("pareto", front_figure(document))
    return files


def schedule_figure(document: Document, curves: Document) -> Figure:
    """Angle (deg), rate (deg/s) and acceleration (deg/s²) of all schedules over the morph, with limits."""
    shown = curves["schedules"]
    end_s = float(document["duration_s"])
    time_s = series(curves["time_s"])
    inside = time_s <= end_s * (1.0 + 1e-9)
    drive = printable(str(curves.get("drive", "sweep"))).replace("_", " ")
    slides = "knot_extension_m" in document["schedule"]
    quantities = (
        ("sweep_rad", f"{drive}, deg", None),
        ("rate_rad_s", "rate, deg/s", "max_rate_rad_s"),
        ("acceleration_rad_s2", "acceleration, deg/s²", "max_accel_rad_s2"),
    )
    if slides:
        quantities = (
            ("extension_m", f"{drive}, m", None),
            ("rate_m_s", "rate, m/s", "max_rate_m_s"),
            ("acceleration_m_s2", "acceleration, m/s²", "max_accel_m_s2"),
        )
    factor = 1.0 if slides else np.degrees(1.0)
    heights = [1.0, 0.8, 0.8]
    figure = Figure(figsize=(7.2, 1.3 + 1.75 * sum(heights)))
    rows = stack(figure, heights)
    for axes, (key, label, limit) in zip(rows, quantities, strict=True):
        label_axis(axes, label)
        for name, motion in shown.items():
            draw(axes, time_s[inside], factor * series(motion[key])[inside], **STYLES[name])
        _draw_limit(axes, document["limits"].get(limit) if limit else None, factor)
    found = document["schedule"]
    times, values = np.array(found["knot_time_s"]), np.array(knot_values(found))
    rows[0].plot(
        times, factor * values, linestyle="none", marker="o", markersize=3.5, color=BLUE, clip_on=False
    )
    time_axis(figure, rows, time_s[inside])
    headline(figure, f"morph of {end_s:.3g} s: schedules")
    legend_above(figure, [_handle(name, LABELS[name]) for name in shown])
    return figure


def departure_figure(document: Document, curves: Document) -> Figure:
    """Departures of roll, pitch and yaw (deg) under all schedules, in the most accurate model flown."""
    model = next((name for name in BEST_FIRST if curves["flights"].get(name)), "equivalent")
    flown = curves["flights"].get(model) or {}
    time_s = series(curves["time_s"])
    silent = {key: is_silent([series(flight[key]) for flight in flown.values()]) for key, _ in ANGLES}
    heights = [SILENT_HEIGHT if silent[key] else ANGLE_HEIGHT for key, _ in ANGLES]
    figure = Figure(figsize=(7.2, 1.3 + 1.9 * sum(heights)))
    rows = stack(figure, heights)
    for axes, (key, label) in zip(rows, ANGLES, strict=True):
        label_axis(axes, f"Δ {label}, deg")
        axes.axhline(0.0, color="0.5", linewidth=0.6)
        axes.axvspan(0.0, float(document["duration_s"]), color=GRID, alpha=0.35, linewidth=0)
        for name, flight in flown.items():
            draw(axes, time_s, np.degrees(series(flight[key])), **STYLES[name])
        if silent[key]:
            quiet(axes, SILENT_SPAN_DEG)
    time_axis(figure, rows, time_s)
    headline(figure, f"departure from the attitude at the start, {model} model (its variation in rad²)")
    handles = []
    for name in flown:
        value = document["variation"][name].get(model)
        handles.append(_handle(name, LABELS[name] + ("" if value is None else f" ({value:.3g})")))
    legend_above(figure, handles)
    return figure


def front_figure(document: Document) -> Figure:
    """Variation (rad²) against duration (s): the front, the other durations searched, the constant rates."""
    front, searched = document["pareto"], document.get("searched") or document["pareto"]
    figure = Figure(figsize=(7.2, 4.0))
    axes = figure.add_axes((0.1, 0.13, 0.875, 0.76))
    axes.margins(x=0.04, y=0.08)
    constant = _points(searched, "constant_rad2")
    if constant:
        style = STYLES["constant"] | {"marker": "s", "markersize": 4}
        axes.plot(*zip(*constant, strict=True), label="constant rate", **style)
    beaten = _points([p for p in searched if p.get("beaten")], "variation_rad2")
    if beaten:
        style = {"linestyle": "none", "marker": "x", "markersize": 5, "color": VERMILION}
        axes.plot(*zip(*beaten, strict=True), label="optimum, but a shorter morph is as good", **style)
    axes.plot(
        [p["duration_s"] for p in front],
        [p["variation_rad2"] for p in front],
        marker="o",
        markersize=5,
        label="optimum: the front",
        **STYLES["optimum"],
    )
    axes.set_xlabel("duration of the morph, s", fontsize=9)
    axes.set_ylabel("variation of the attitude, rad²", fontsize=9)
    axes.set_ylim(bottom=0.0)  # after the curves, so that the top keeps its margin
    axes.tick_params(labelsize=8.5)
    light_grid(axes)
    axes.legend(frameon=False, fontsize=8.5, loc="best")
    headline(figure, "time against disturbance, equivalent model")
    return figure


# pieces


def _draw_limit(axes: Axes, limit: float | None, factor: float) -> None:
    """Draw lines at plus and minus a limit if the axis comes close to it."""
    if limit is None:
        return
    low, high = axes.get_ylim()
    for value in (factor * limit, -factor * limit):
        if 1.3 * min(low, 0.0) <= value <= 1.3 * high:
            axes.axhline(value, **LIMIT)


def _points(rows: Sequence[Document], key: str) -> list[tuple[float, float]]:
    """Duration and one figure, for the rows that have it."""
    return [(row["duration_s"], row[key]) for row in rows if row.get(key) is not None]


def _handle(name: str, label: str) -> Line2D:
    return Line2D([], [], label=label, **STYLES[name])
