"""Plots of an identification: attitude, residuals, convergence. SVG and PNG, drawn without global state."""

from __future__ import annotations

import io
import threading
import unicodedata
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties, findfont, get_font
from matplotlib.ticker import FuncFormatter, MaxNLocator, NullFormatter
from numpy.typing import NDArray

from morphcore.export.curves import file_stems
from morphcore.frames import wrap_angle

Array = NDArray[np.float64]
Document = dict[str, Any]

ANGLES = (("phi_rad", "roll φ"), ("theta_rad", "pitch θ"), ("psi_rad", "yaw ψ"))
# Okabe & Ito's palette: told apart by colour-blind eyes; line styles differ too, for print without colour
STYLES: dict[str, dict[str, Any]] = {
    "measured": {"color": "0.72", "linewidth": 4.5, "linestyle": "-", "solid_capstyle": "butt"},
    "rigid": {"color": "#D55E00", "linewidth": 1.4, "linestyle": (0, (5, 2))},
    "initial": {"color": "#009E73", "linewidth": 0.9, "linestyle": (0, (1, 1.4))},
    "identified": {"color": "#0072B2", "linewidth": 1.5, "linestyle": "-"},
}
LABELS = {
    "measured": "sample",
    "rigid": "rigid model",
    "initial": "equivalent, physical guess",
    "identified": "equivalent, identified",
}
PHASES = {"swarm": "#E69F00", "polish": "#0072B2"}
OTHER_PHASE = "#56B4E9"
ROLES = {"train": "fitted", "held_out": "held out"}

SILENT_RAD = 1e-6  # an angle that stays below is round-off, not motion
SILENT_SPAN_DEG = 0.1  # half the height of the axis on which it is drawn, as a flat line
SILENT_SPAN_MRAD = 0.01
PNG_DPI = 110
LONGEST_TITLE = 70  # characters
MOST_POINTS = 4000  # of a curve: more than the pixels of a page
HASH_SALT = "morphid"  # element ids in SVG depend on nothing else
SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")

_drawing = threading.Lock()


def identification_plots(document: Document, curves: Document) -> dict[str, bytes]:
    """Draw everything that an identification's result has to show.

    Parameters
    ----------
    document : the result; its ``search.history`` gives the convergence.
    curves : ``{"samples": [{"name", "role", "time_s", "sweep_left_rad", "sweep_right_rad", "measured":
        {"phi_rad", "theta_rad", "psi_rad"}, "rigid": {...}, "initial": {...}, "identified": {...}}]}``; a
        value that a diverged flight never reached is None.

    Returns
    -------
    File name -> content: ``attitude_<sample>``, ``residuals_<sample>`` and ``convergence``, each as ``.svg``
    and ``.png``. The same input gives the same bytes.
    """
    samples = curves["samples"]
    files: dict[str, bytes] = {}
    for stem, sample in zip(file_stems(str(s["name"]) for s in samples), samples, strict=True):
        files |= _rendered(f"attitude_{stem}", attitude_figure(sample))
        files |= _rendered(f"residuals_{stem}", residual_figure(sample))
    return files | _rendered("convergence", convergence_figure(document))


def attitude_figure(sample: Document) -> Figure:
    """Roll, pitch and yaw over time in degrees, of the sample and of each model, above the sweep."""
    time_s = _series(sample["time_s"])
    measured = {key: np.unwrap(_series(sample["measured"][key])) for key, _ in ANGLES}
    flown = {
        model: {key: measured[key] + _error(sample, model, key) for key, _ in ANGLES}
        for model in ("rigid", "initial", "identified")
        if sample.get(model)
    }
    silent = {key: _is_silent([measured[key], *(f[key] for f in flown.values())]) for key, _ in ANGLES}
    has_sweep = "sweep_left_rad" in sample
    heights = [0.45 if silent[key] else 1.0 for key, _ in ANGLES] + [0.45] * has_sweep
    figure = Figure(figsize=(7.2, 1.3 + 1.75 * sum(heights)))
    rows = _stack(figure, heights)
    for axes, (key, label) in zip(rows, ANGLES, strict=False):
        _label(axes, f"{label}, deg")
        for model, values in (("measured", measured), *flown.items()):
            _draw(axes, time_s, np.degrees(values[key]), model)
        if silent[key]:
            _quiet(axes, SILENT_SPAN_DEG)
    if has_sweep:
        _draw_sweep(rows[-1], time_s, sample)
    _finish(figure, rows, time_s, _title(sample, "attitude"), list(flown))
    return figure


def residual_figure(sample: Document) -> Figure:
    """Errors of roll, pitch and yaw in mrad: all models at the left, the identified one at the right."""
    time_s = _series(sample["time_s"])
    models = [model for model in ("rigid", "initial", "identified") if sample.get(model)]
    figure = Figure(figsize=(9.0, 6.2))
    grid = figure.add_gridspec(3, 2, hspace=0.22, wspace=0.2, left=0.085, right=0.985, top=0.85, bottom=0.085)
    for row, (key, label) in enumerate(ANGLES):
        errors = {model: _error(sample, model, key) for model in models}
        for column, shown in enumerate((models, ["identified"])):
            axes = figure.add_subplot(grid[row, column])
            _label(axes, f"{label} error, mrad" if column == 0 else "")
            axes.axhline(0.0, color="0.5", linewidth=0.6)
            for model in shown:
                if model in errors:
                    _draw(axes, time_s, 1e3 * errors[model], model)
            if _is_silent([errors[model] for model in shown if model in errors]):
                _quiet(axes, SILENT_SPAN_MRAD)
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
    """Least cost J so far against flights flown (or generations, if flights are not told), logarithmic."""
    history = [row for row in document.get("search", {}).get("history", []) if _is_cost(row.get("best_cost"))]
    figure = Figure(figsize=(7.2, 3.8))
    axes = figure.add_axes((0.115, 0.13, 0.865, 0.77))
    by_flights = all(row.get("flights") is not None for row in history)
    position = [
        float(row["flights"] if by_flights else row.get("generation", i)) for i, row in enumerate(history)
    ]
    cost = [float(row["best_cost"]) for row in history]
    axes.set_xlabel("flights flown" if by_flights else "generation")
    axes.set_ylabel("least cost J so far, rad²")
    axes.grid(visible=True, which="major", linewidth=0.4, color="0.88")
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
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
            label=_printable(phase),
        )
    axes.set_yscale("log")
    low, high = min(cost), max(cost)
    axes.set_title(f"convergence of the search to J = {_scientific(low)} rad²", fontsize=10)
    axes.set_ylim(low / 1.6, high * 1.6)
    axes.yaxis.set_major_formatter(FuncFormatter(_power_of_ten))
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.0f}"))
    if by_flights:
        axes.set_xlim(left=0.0)
    axes.legend(frameon=False, fontsize=8.5, loc="upper right")
    return figure


# pieces of figures


def _stack(figure: Figure, heights: Sequence[float]) -> list[Axes]:
    """Panels one above the other with a common time axis."""
    inches = float(figure.get_figheight())
    grid = figure.add_gridspec(
        len(heights),
        1,
        height_ratios=list(heights),
        hspace=0.14,
        left=0.115,
        right=0.98,
        top=1.0 - 0.62 / inches,
        bottom=0.5 / inches,
    )
    rows: list[Axes] = []
    for i in range(len(heights)):
        rows.append(figure.add_subplot(grid[i, 0], sharex=rows[0] if rows else None))
    return rows


def _draw(axes: Axes, time_s: Array, values: Array, model: str) -> None:
    every = -(-time_s.size // MOST_POINTS)
    axes.plot(time_s[::every], values[::every], label=LABELS[model], **STYLES[model])


def _draw_sweep(axes: Axes, time_s: Array, sample: Document) -> None:
    left, right = (np.degrees(_series(sample[name])) for name in ("sweep_left_rad", "sweep_right_rad"))
    axes.plot(time_s, right, color="0.15", linewidth=1.2, label="right")
    if np.abs(left - right).max() > np.degrees(SILENT_RAD):
        axes.plot(time_s, left, color="0.15", linewidth=1.2, linestyle=(0, (4, 2)), label="left")
        axes.legend(frameon=False, fontsize=8, loc="best", handlelength=2.2)
    _label(axes, "sweep, deg")


def _label(axes: Axes, text: str) -> None:
    axes.set_ylabel(text, fontsize=9)
    axes.yaxis.set_major_locator(MaxNLocator(nbins=5, steps=[1, 2, 2.5, 5, 10]))
    axes.ticklabel_format(axis="y", style="plain", useOffset=False)
    axes.grid(visible=True, linewidth=0.4, color="0.88")
    axes.tick_params(labelsize=8.5)
    axes.margins(x=0.0)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)


def _finish(figure: Figure, rows: Sequence[Axes], time_s: Array, title: str, models: Sequence[str]) -> None:
    for axes in rows[:-1]:
        axes.tick_params(labelbottom=False)
    rows[-1].set_xlabel("time, s", fontsize=9)
    rows[0].set_xlim(time_s[0], time_s[-1])
    figure.align_ylabels(rows)
    _legend(figure, ["measured", *models], title)


def _legend(figure: Figure, models: Sequence[str], title: str) -> None:
    inches = float(figure.get_figheight())
    figure.text(0.5, 1.0 - 0.1 / inches, title, ha="center", va="top", fontsize=10, parse_math=False)
    handles = [
        line for axes in figure.axes[:1] for line in axes.get_lines() if line.get_label() in LABELS.values()
    ]
    wanted = {LABELS[model] for model in models}
    figure.legend(
        handles=[line for line in handles if line.get_label() in wanted],
        loc="upper center",
        bbox_to_anchor=(0.5, 1.0 - 0.27 / inches),
        ncols=4,
        frameon=False,
        fontsize=8.5,
        handlelength=2.6,
        columnspacing=1.4,
    )


def _quiet(axes: Axes, span: float) -> None:
    """An axis for an angle that does not move: round-off is a flat line on it."""
    axes.set_ylim(-span, span)
    axes.set_yticks([-span, 0.0, span])


def _title(sample: Document, subject: str) -> str:
    role = ROLES.get(str(sample.get("role")), "")
    return (
        f"{_printable(str(sample['name']))} ({role}): {subject}" if role else f"{sample['name']}: {subject}"
    )


# numbers


def _series(values: Sequence[float | None]) -> Array:
    """Numbers as an array, None as NaN, which no line crosses."""
    return np.array(values, dtype=np.float64)


def _error(sample: Document, model: str, key: str) -> Array:
    """Wrapped difference of a model's angle to the sample's, rad."""
    return wrap_angle(_series(sample[model][key]) - _series(sample["measured"][key]))


def _is_silent(curves: Sequence[Array]) -> bool:
    return all(np.all(np.isnan(values) | (np.abs(values) < SILENT_RAD)) for values in curves)


def _rms_text(errors: Array) -> str:
    if not np.all(np.isfinite(errors)):
        return "diverged"
    rms = float(np.sqrt(np.mean(errors**2)))
    return "rms below 0.001 mrad" if rms < SILENT_RAD else f"rms {1e3 * rms:.2g} mrad"


def _is_cost(value: object) -> bool:
    return isinstance(value, int | float) and bool(np.isfinite(value)) and value > 0.0


def _power_of_ten(value: float, _position: object = None) -> str:
    exponent = int(np.floor(np.log10(value) + 1e-9))
    lead = value / 10.0**exponent
    power = "10" + str(exponent).translate(SUPERSCRIPTS)
    return power if abs(lead - 1.0) < 1e-6 else f"{lead:.0f}·{power}"


def _scientific(value: float) -> str:
    lead, exponent = f"{value:.2e}".split("e")
    return f"{lead}·10{str(int(exponent)).translate(SUPERSCRIPTS)}"


def _printable(text: str) -> str:
    """A name as the font can show it: on one line, no control characters, not too long."""
    known = get_font(findfont(FontProperties(family="DejaVu Sans"))).get_charmap()
    shown = "".join(
        (c if ord(c) in known else "?") if unicodedata.category(c)[0] != "C" else " "
        for c in text[: 2 * LONGEST_TITLE]
    )
    return shown if len(shown) <= LONGEST_TITLE else f"{shown[: LONGEST_TITLE - 1]}…"


# rendering


def _rendered(stem: str, figure: Figure) -> dict[str, bytes]:
    with _drawing:
        vector, pixels = io.BytesIO(), io.BytesIO()
        with _fixed_ids():
            figure.set_canvas(FigureCanvasSVG(figure))
            figure.savefig(vector, format="svg", metadata={"Date": None, "Creator": "MorphID"})
        figure.set_canvas(FigureCanvasAgg(figure))
        figure.savefig(pixels, format="png", dpi=PNG_DPI, metadata={"Software": "MorphID"})
    return {f"{stem}.svg": vector.getvalue(), f"{stem}.png": pixels.getvalue()}


@contextmanager
def _fixed_ids() -> Iterator[None]:
    """Element ids that depend on the picture only; matplotlib reads the salt from its global settings."""
    former = mpl.rcParams["svg.hashsalt"]
    mpl.rcParams["svg.hashsalt"] = HASH_SALT
    try:
        yield
    finally:
        mpl.rcParams["svg.hashsalt"] = former
