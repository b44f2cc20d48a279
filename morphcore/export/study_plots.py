"""The figure of a study: accuracy and cost against the number of links per wing."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from morphcore.export.figure import (
    BLUE,
    GREEN,
    VERMILION,
    Document,
    headline,
    is_cost,
    light_grid,
    power_of_ten,
    rendered,
)
from morphdata.links import LinksPerWing, mean_links, shown_per_wing

MILLISECONDS = 1e3  # of a second
MARGIN = 1.8  # factor above the largest and below the smallest value
TWO_DECADES = 100.0
TRAIN = {"color": BLUE, "marker": "o", "markersize": 5, "linewidth": 1.4}
HELD_OUT = {
    "color": GREEN,
    "marker": "s",
    "markersize": 5,
    "linewidth": 1.4,
    "linestyle": (0, (5, 2)),
    "markerfacecolor": "white",
}
RIGID = {"color": VERMILION, "linewidth": 1.1, "linestyle": (0, (1, 1.4))}
CHOSEN_COLOUR = "#FBEBC8"  # half width of a light band behind the recommended number of links


def study_plots(document: Document) -> dict[str, bytes]:
    """Draw the plot of a study's result.

    Parameters
    ----------
    document : the result; of its ``rows`` "links_per_wing", "J_train", "J_held_out" and "flight_s", of
        ``rigid`` the same of the rigid model, and ``recommended``. What is None is left out.

    Returns
    -------
    File name -> content: ``study.svg`` and ``study.png``. The same input gives the same bytes.
    """
    return rendered("study", study_figure(document))


def study_figure(document: Document) -> Figure:
    """J (rad²) for fitted and held-out flights and, below, the time of one flight (ms)."""
    figure = Figure(figsize=(7.2, 6.0))
    accuracy = figure.add_axes((0.115, 0.4, 0.865, 0.53))
    price = figure.add_axes((0.115, 0.085, 0.865, 0.26), sharex=accuracy)
    for axes, label in ((accuracy, "J, rad²"), (price, "one flight, ms")):
        axes.set_ylabel(label, fontsize=9)
        _abscissa(axes, document)
    rigid = document.get("rigid") or {}
    values = _line(accuracy, document, "J_train", "fitted flights", TRAIN)
    values += _line(accuracy, document, "J_held_out", "flights held out", HELD_OUT)
    values += _level(accuracy, rigid.get("J_train"), "rigid model, fitted flights", {**RIGID, "color": BLUE})
    values += _level(accuracy, rigid.get("J_held_out"), "rigid model, held out", {**RIGID, "color": GREEN})
    _ordinate(accuracy, values, "no model could fly every flight")
    values = _line(price, document, "flight_s", "equivalent model", TRAIN, MILLISECONDS)
    values += _level(price, rigid.get("flight_s"), "rigid model", RIGID, MILLISECONDS)
    _ordinate(price, values, "no flight was timed")
    accuracy.tick_params(labelbottom=False)
    price.set_xlabel("links per wing", fontsize=9)
    figure.align_ylabels([accuracy, price])
    headline(figure, _title(document))
    return figure


# pieces


def _recommended(document: Document) -> LinksPerWing | None:
    chosen: LinksPerWing | None = (document.get("recommended") or {}).get("links_per_wing")
    return chosen


def _title(document: Document) -> str:
    duration_s = (document.get("cost") or {}).get("flight_duration_s")
    said = "accuracy, and wall time of one flight"
    said += f" of {duration_s:g} s on one core" if duration_s else ""
    chosen = _recommended(document)
    return said if chosen is None else f"{said}; recommended: {shown_per_wing(chosen)}"


def _abscissa(axes: Axes, document: Document) -> None:
    """One tick for each number of links, and a band behind the recommended one; means where they differ."""
    numbers = sorted(mean_links(row["links_per_wing"]) for row in document["rows"]) or [1]
    axes.set_xticks(range(math.floor(numbers[0]), math.ceil(numbers[-1]) + 1))
    axes.set_xlim(numbers[0] - 0.5, numbers[-1] + 0.5)
    axes.tick_params(labelsize=8.5)
    light_grid(axes)
    chosen = _recommended(document)
    if chosen is not None:
        middle = mean_links(chosen)
        axes.axvspan(middle - 0.28, middle + 0.28, zorder=0, color=CHOSEN_COLOUR, linewidth=0)


def _line(
    axes: Axes, document: Document, name: str, label: str, style: dict[str, Any], factor: float = 1.0
) -> list[float]:
    """Draw one figure for all rows that have it; return its values."""
    points = sorted(
        (mean_links(row["links_per_wing"]), factor * row[name])
        for row in document["rows"]
        if is_cost(row.get(name))
    )
    if points:
        links, values = zip(*points, strict=True)
        axes.plot(links, values, label=label, **style)
    return [value for _, value in points]


def _level(axes: Axes, value: Any, label: str, style: dict[str, Any], factor: float = 1.0) -> list[float]:
    if not is_cost(value):
        return []
    axes.axhline(factor * value, label=label, **style)
    return [factor * value]


def _ordinate(axes: Axes, values: Sequence[float], nothing: str) -> None:
    """Set a logarithmic ordinate around the values, and a legend."""
    if not values:
        axes.set_yticks([])
        axes.text(0.5, 0.5, nothing, transform=axes.transAxes, ha="center", fontsize=9)
        return
    axes.set_yscale("log")
    low, high = min(values) / MARGIN, max(values) * MARGIN
    axes.set_ylim(low, high)
    if high / low < TWO_DECADES:  # too few powers of ten to read values between them
        axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    else:
        axes.yaxis.set_major_formatter(FuncFormatter(power_of_ten))
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.legend(frameon=False, fontsize=8.5, loc="best")
