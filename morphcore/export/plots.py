"""Plots of an identification: attitude, residuals, convergence. SVG and PNG, drawn without global state."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter

from morphcore.export.curves import SWEEPS, file_stems
from morphcore.export.figure import (
    ANGLES,
    BLUE,
    GREEN,
    ORANGE,
    SILENT_RAD,
    SILENT_SPAN_DEG,
    SKY,
    VERMILION,
    Array,
    Document,
    draw,
    draw_drive,
    drive_panels,
    headline,
    is_cost,
    is_silent,
    label_axis,
    legend_above,
    light_grid,
    power_of_ten,
    printable,
    quiet,
    rendered,
    scientific,
    series,
    stack,
    time_axis,
)
from morphcore.export.uncertainty_plots import uncertainty_plots
from morphcore.frames import wrap_angle

STYLES: dict[str, dict[str, Any]] = {
    "measured": {"color": "0.72", "linewidth": 4.5, "linestyle": "-", "solid_capstyle": "butt"},
    "rigid": {"color": VERMILION, "linewidth": 1.4, "linestyle": (0, (5, 2))},
    "initial": {"color": GREEN, "linewidth": 0.9, "linestyle": (0, (1, 1.4))},
    "identified": {"color": BLUE, "linewidth": 1.5, "linestyle": "-"},
}
LABELS = {
    "measured": "sample",
    "rigid": "rigid model",
    "initial": "equivalent, physical guess",
    "identified": "equivalent, identified",
}
PHASES = {"swarm": ORANGE, "polish": BLUE}
OTHER_PHASE = SKY
ROLES = {"train": "fitted", "held_out": "held out"}

BAND = "#BBD9EE"  # of probable attitudes
SILENT_SPAN_MRAD = 0.01  # half the height of the axis of an error within round-off


def identification_plots(document: Document, curves: Document) -> dict[str, bytes]:
    """Draw all plots of an identification's result.

    Parameters
    ----------
    document : the result; ``search.history`` provides the convergence.
    curves : ``{"samples": [{"name", "role", "time_s", "drives": ["sweep_left", "sweep_right"],
        "sweep_left_rad", "sweep_right_rad", "measured": {"phi_rad", "theta_rad", "psi_rad"}, "rigid": {...},
        "initial": {...}, "identified": {...}}]}``; the drives' columns bear their names; a value that a
        diverged flight never reached is None. ``"band": {"phi_rad": {"low": [...], "high": [...]}, ...}`` of
        a sample, where it is there, is drawn as a band of probable attitudes.

    Returns
    -------
    File name -> content: ``attitude_<sample>``, ``residuals_<sample>``, ``autocorrelation_<sample>``,
    ``intervals`` (where there are any) and ``convergence``, each as ``.svg`` and ``.png``. The same input
    gives the same bytes.
    """
    samples = curves["samples"]
    named = dict(zip(file_stems(str(s["name"]) for s in samples), samples, strict=True))
    files: dict[str, bytes] = {}
    for stem, sample in named.items():
        files |= rendered(f"attitude_{stem}", attitude_figure(sample))
        files |= rendered(f"residuals_{stem}", residual_figure(sample))
    files |= uncertainty_plots(document, named)
    return files | rendered("convergence", convergence_figure(document))


def attitude_figure(sample: Document) -> Figure:
    """Roll, pitch and yaw over time in degrees, of the sample and of each model, above the drives."""
    time_s = series(sample["time_s"])
    measured = {key: np.unwrap(series(sample["measured"][key])) for key, _ in ANGLES}
    flown = {
        model: {key: measured[key] + angle_error(sample, model, key) for key, _ in ANGLES}
        for model in ("rigid", "initial", "identified")
        if sample.get(model)
    }
    silent = {key: is_silent([measured[key], *(f[key] for f in flown.values())]) for key, _ in ANGLES}
    drives = drive_panels(sample, sample.get("drives", SWEEPS))
    heights = [0.45 if silent[key] else 1.0 for key, _ in ANGLES] + [0.45] * len(drives)
    figure = Figure(figsize=(7.2, 1.3 + 1.75 * sum(heights)))
    rows = stack(figure, heights)
    for axes, (key, label) in zip(rows, ANGLES, strict=False):
        label_axis(axes, f"{label}, deg")
        for model, values in (("measured", measured), *flown.items()):
            draw(axes, time_s, np.degrees(values[key]), **_line(model))
        _draw_band(axes, time_s, measured[key], (sample.get("band") or {}).get(key))
        if silent[key]:
            quiet(axes, SILENT_SPAN_DEG)
    for axes, panel in zip(rows[len(ANGLES) :], drives, strict=True):
        draw_drive(axes, time_s, panel)
    time_axis(figure, rows, time_s)
    _legend(figure, ["measured", *flown], _title(sample, "attitude"))
    return figure


def residual_figure(sample: Document) -> Figure:
    """Errors of roll, pitch and yaw in mrad: all models on the left, the identified one on the right."""
    time_s = series(sample["time_s"])
    models = [model for model in ("rigid", "initial", "identified") if sample.get(model)]
    figure = Figure(figsize=(9.0, 6.2))
    grid = figure.add_gridspec(3, 2, hspace=0.22, wspace=0.2, left=0.085, right=0.985, top=0.85, bottom=0.085)
    for row, (key, label) in enumerate(ANGLES):
        errors = {model: angle_error(sample, model, key) for model in models}
        for column, shown in enumerate((models, ["identified"])):
            axes = figure.add_subplot(grid[row, column])
            label_axis(axes, f"{label} error, mrad" if column == 0 else "")
            axes.axhline(0.0, color="0.5", linewidth=0.6)
            for model in shown:
                if model in errors:
                    draw(axes, time_s, 1e3 * errors[model], **_line(model))
            if is_silent([errors[model] for model in shown if model in errors]):
                quiet(axes, SILENT_SPAN_MRAD)
            axes.set_xlim(time_s[0], time_s[-1])
            if row < len(ANGLES) - 1:
                axes.tick_params(labelbottom=False)
            else:
                axes.set_xlabel("time, s")
            if column == 1 and "identified" in errors:
                axes.set_title(_rms_text(errors["identified"]), loc="right", fontsize=8.5, pad=2.0)
            if row == 0:
                heading = "all models" if column == 0 else "identified model alone"
                axes.set_title(heading, loc="left", fontsize=9, pad=4.0)
    _legend(figure, models, _title(sample, "model − sample"))
    return figure


def convergence_figure(document: Document) -> Figure:
    """Minimum cost J so far against flights flown (or generations, if not counted), logarithmic."""
    history = [row for row in document.get("search", {}).get("history", []) if is_cost(row.get("best_cost"))]
    figure = Figure(figsize=(7.2, 3.8))
    axes = figure.add_axes((0.115, 0.13, 0.865, 0.77))
    by_flights = all(row.get("flights") is not None for row in history)
    position = [
        float(row["flights"] if by_flights else row.get("generation", i)) for i, row in enumerate(history)
    ]
    cost = [float(row["best_cost"]) for row in history]
    axes.set_xlabel("flights flown" if by_flights else "generation")
    axes.set_ylabel("best J so far, rad²")
    light_grid(axes)
    if not history:
        axes.text(0.5, 0.5, "no generation was finished", transform=axes.transAxes, ha="center", fontsize=9)
        return figure
    axes.plot(position, cost, color="0.6", linewidth=1.0, drawstyle="steps-post")
    phases = [str(row.get("phase", "search")) for row in history]
    for phase in dict.fromkeys(phases):
        chosen = [i for i, name in enumerate(phases) if name == phase]
        axes.plot(
            [position[i] for i in chosen],
            [cost[i] for i in chosen],
            linestyle="none",
            marker="o",
            markersize=3.5,
            color=PHASES.get(phase, OTHER_PHASE if phase != "baseline" else "0.3"),
            label=printable(phase),
        )
    axes.set_yscale("log")
    low, high = min(cost), max(cost)
    axes.set_title(f"convergence of the search to J = {scientific(low)} rad²", fontsize=10)
    axes.set_ylim(low / 1.6, high * 1.6)
    axes.yaxis.set_major_formatter(FuncFormatter(power_of_ten))
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.0f}"))
    if by_flights:
        axes.set_xlim(left=0.0)
    axes.legend(frameon=False, fontsize=8.5, loc="upper right")
    return figure


# pieces of figures


def _draw_band(axes: Axes, time_s: Array, measured: Array, band: Document | None) -> None:
    """The band in which a predictive distribution sees an angle, on the branch of the measured one."""
    if band is None:
        return
    low, high = (
        np.degrees(measured + wrap_angle(series(band[end]) - wrap_angle(measured))) for end in ("low", "high")
    )
    axes.fill_between(time_s, low, high, color=BAND, linewidth=0, zorder=1.5, label="band")


def _line(model: str) -> dict[str, Any]:
    return {"label": LABELS[model], **STYLES[model]}


def _legend(figure: Figure, models: Sequence[str], title: str) -> None:
    headline(figure, title)
    wanted = {LABELS[model] for model in models}
    legend_above(figure, [line for line in figure.axes[0].get_lines() if line.get_label() in wanted])


def _title(sample: Document, subject: str) -> str:
    role = ROLES.get(str(sample.get("role")), "")
    name = printable(str(sample["name"]))
    return f"{name} ({role}): {subject}" if role else f"{name}: {subject}"


# numbers


def angle_error(sample: Document, model: str, key: str) -> Array:
    """Wrapped difference between a model's angle and the sample's, rad."""
    return wrap_angle(series(sample[model][key]) - series(sample["measured"][key]))


def _rms_text(errors: Array) -> str:
    if not np.all(np.isfinite(errors)):
        return "diverged"
    rms = float(np.sqrt(np.mean(errors**2)))
    return "rms below 0.001 mrad" if rms < SILENT_RAD else f"rms {1e3 * rms:.2g} mrad"
