"""What may be believed of an identification, as pictures: parameters' intervals, whiteness of residuals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from morphcore.export.figure import (
    ANGLES,
    BLUE,
    SILENT_RAD,
    VERMILION,
    Array,
    Document,
    headline,
    light_grid,
    printable,
    rendered,
    series,
)
from morphcore.frames import wrap_angle
from morphcore.identify.statistics import autocorrelation, white_bound
from morphdata.renamed import current_name

ROW_IN = 0.24  # height of a parameter's row
HEAD_IN, FOOT_IN = 0.42, 0.6
WIDEST, NARROWEST = 30.0, 1.2  # factors at the ends of the axis, at most and at least
SHOWN_LAGS = 4.0  # a part of the rows: a fourth
MAX_LAGS = 100
GREY, PALE = "0.55", "0.93"
NOT_FLOWN = "the model does not fly the sample to its end"


def uncertainty_plots(document: Document, samples: Mapping[str, Document]) -> dict[str, bytes]:
    """Draw intervals and autocorrelations.

    Parameters
    ----------
    document : dict
        The result; of its ``uncertainty`` the values, intervals, and names of what is undetermined or at a
        bound.
    samples : mapping of str to dict
        Time histories of each sample by the stem of its file names; see `identification_plots`.

    Returns
    -------
    dict of str to bytes
        ``intervals`` (where there are any) and ``autocorrelation_<sample>``, each as ``.svg`` and ``.png``.
    """
    files: dict[str, bytes] = {}
    if (document.get("uncertainty") or {}).get("interval_95"):
        files |= rendered("intervals", interval_figure(document["uncertainty"]))
    for stem, sample in samples.items():
        if sample.get("identified"):
            files |= rendered(f"autocorrelation_{stem}", autocorrelation_figure(sample))
    return files


# intervals


def interval_figure(uncertainty: Document) -> Figure:
    """A bar from end to end of each interval, both over the value itself, on an axis of factors."""
    intervals = _current(uncertainty["interval_95"])
    values = _current(uncertainty.get("value") or {})
    names = [name for name in intervals if name in values]
    unseen = {current_name(name) for name in uncertainty.get("undetermined") or ()}
    bound = {current_name(name) for name in uncertainty.get("at_bound") or ()}
    bars = [_bar(values[name], intervals[name]) for name in names]
    figure = Figure(figsize=(8.2, HEAD_IN + FOOT_IN + ROW_IN * max(len(names), 1)))
    inches = float(figure.get_figheight())
    axes = figure.add_axes(
        (0.34, FOOT_IN / inches, 0.42, (inches - HEAD_IN - FOOT_IN) / inches), label="intervals"
    )
    reach = _reach([end for bar, name in zip(bars, names, strict=True) if name not in unseen for end in bar])
    axes.set_xscale("log")
    axes.set_xlim(1.0 / reach, reach)
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.axvline(1.0, color="0.4", linewidth=0.8)
    for row, (name, (low, high)) in enumerate(zip(names, bars, strict=True)):
        grey = name in unseen
        if grey:
            axes.axhspan(row - 0.5, row + 0.5, color=PALE, linewidth=0)
        _draw_bar(axes, row, low, high, reach, GREY if grey else BLUE)
        axes.plot([1.0], [row], marker="o", markersize=4.5, color=GREY if grey else BLUE)
        noted = "not determined" if grey else "at its bound" if name in bound else ""
        colour = GREY if grey else VERMILION if noted else "0.15"
        text = f"{values[name]:.4g}" + (f"  ({noted})" if noted else "")
        axes.text(
            1.02, row, text, transform=axes.get_yaxis_transform(), va="center", fontsize=8, color=colour
        )
    axes.set_yticks(range(len(names)), [printable(name) for name in names], fontsize=8)
    for label, name in zip(axes.get_yticklabels(), names, strict=True):
        label.set_color(GREY if name in unseen else "0.15")
    _factor_axis(axes, reach)
    axes.set_xlabel("95 % interval over the identified value", fontsize=9)
    headline(figure, "identified parameters with their 95 % intervals (SI units)")
    return figure


def _current(values: Mapping[str, Any]) -> dict[str, Any]:
    """Values under today's names, each once."""
    return {current_name(name): value for name, value in values.items()}


def _bar(value: float, interval: Sequence[float | None]) -> tuple[float, float]:
    """Ends of an interval over the value; 0 and infinity where it is open, or passes through zero."""
    ends = [None if end is None or value == 0.0 else end / value for end in interval]
    low, high = ends if value > 0.0 else ends[::-1]
    return (
        low if low is not None and low > 0.0 else 0.0,
        high if high is not None and high > 0.0 else float("inf"),
    )


def _reach(ends: Sequence[float]) -> float:
    """The factor at the ends of the axis: it shows all closed ends, within limits."""
    factors = [max(end, 1.0 / end) for end in ends if 0.0 < end < np.inf]
    return float(np.clip(1.15 * max(factors, default=1.0), NARROWEST, WIDEST))


def _draw_bar(axes: Axes, row: int, low: float, high: float, reach: float, colour: str) -> None:
    """A bar with an upright end where it is closed and an arrowhead where it leaves the picture."""
    begin, end = max(low, 1.0 / reach), min(high, reach)
    axes.plot([begin, end], [row, row], color=colour, linewidth=2.2, solid_capstyle="butt")
    for place, inside, arrow in ((begin, low >= 1.0 / reach, "<"), (end, high <= reach, ">")):
        axes.plot([place], [row], marker="|" if inside else arrow, markersize=7, color=colour, clip_on=False)


def _factor_axis(axes: Axes, reach: float) -> None:
    light_grid(axes)
    axes.tick_params(labelsize=8.5)
    if reach < 3.0:  # too narrow for decades
        ticks = np.linspace(1.0 / reach, reach, 7)[1:-1]
        around = [round(float(tick), 2) for tick in ticks]
        axes.set_xticks(sorted({1.0, *(tick for tick in around if abs(tick - 1.0) > 0.05 * (reach - 1.0))}))
    else:
        axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"× {value:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())


# autocorrelation


def autocorrelation_figure(sample: Document) -> Figure:
    """Autocorrelation of the identified model's errors over the lag, with the bounds of white noise."""
    time_s = series(sample["time_s"])
    lags = max(1, min(MAX_LAGS, int(time_s.size / SHOWN_LAGS)))
    step_s = float(np.median(np.diff(time_s)))
    bound = white_bound(time_s.size)
    figure = Figure(figsize=(7.2, 4.6))
    grid = figure.add_gridspec(3, 1, hspace=0.2, left=0.115, right=0.98, top=0.9, bottom=0.115)
    for row, (key, label) in enumerate(ANGLES):
        axes = figure.add_subplot(grid[row, 0])
        axes.set_ylim(-1.05, 1.05)
        axes.set_yticks([-1.0, 0.0, 1.0])
        axes.set_ylabel(label, fontsize=9)
        axes.tick_params(labelsize=8.5, labelbottom=row == len(ANGLES) - 1)
        light_grid(axes)
        axes.axhspan(-bound, bound, color=BLUE, alpha=0.12, linewidth=0)
        axes.axhline(0.0, color="0.5", linewidth=0.6)
        axes.set_xlim(0.0, lags * step_s)
        error = wrap_angle(series(sample["identified"][key]) - series(sample["measured"][key]))
        _draw_autocorrelation(axes, error, lags, step_s)
    figure.axes[-1].set_xlabel("lag, s", fontsize=9)
    name = printable(str(sample["name"]))
    headline(figure, f"{name}: autocorrelation of the residuals; band: 95 % of white noise")
    return figure


def _draw_autocorrelation(axes: Axes, error: Array, lags: int, step_s: float) -> None:
    """Stems, or a sentence where there is nothing to correlate."""
    sentence = ""
    if not np.all(np.isfinite(error)):
        sentence = NOT_FLOWN
    elif np.sqrt(np.mean(error**2)) < SILENT_RAD:
        sentence = "no error beyond 0.001 mrad"
    if sentence:
        axes.text(0.5, 0.7, sentence, transform=axes.transAxes, ha="center", fontsize=8.5, color=GREY)
        return
    rho = autocorrelation(error, lags)
    axes.vlines(step_s * np.arange(lags + 1), 0.0, rho, color=BLUE, linewidth=1.1)
