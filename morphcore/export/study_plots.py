"""A study as a picture and as a table: accuracy and cost against the number of links per wing."""

from __future__ import annotations

import csv
import io
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator, NullFormatter

from morphcore.export.figure import (
    BLUE,
    ORANGE,
    VERMILION,
    Document,
    headline,
    is_cost,
    light_grid,
    power_of_ten,
    rendered,
)

ERRORS = (("J_train", "fitted flights", BLUE, "o"), ("J_held_out", "flights held out", ORANGE, "s"))
ANGLES = ("phi", "theta", "psi")
HEADROOM = 1.15  # above the highest time, for the mark of the recommended number
PLAIN_COLUMNS = (
    "links_per_wing",
    "bodies",
    "parameters",
    "J_train",
    "J_held_out",
    "flight_s",
    "identify_s",
    "flights",
)


def study_plots(document: Document) -> dict[str, bytes]:
    """Draw a study's result: ``study.svg`` and ``study.png``. The same input gives the same bytes."""
    return rendered("study", study_figure(document))


def study_figure(document: Document) -> Figure:
    """J of the fitted and the held-out flights (rad^2) and the time of one flight (ms) against the links."""
    figure = Figure(figsize=(9.0, 3.8))
    accuracy = figure.add_axes((0.085, 0.14, 0.41, 0.75))
    price = figure.add_axes((0.575, 0.14, 0.41, 0.75))
    rows, rigid = document["rows"], document.get("rigid") or {}
    for name, label, color, marker in ERRORS:
        _curve(accuracy, rows, name, 1.0, color=color, marker=marker, label=label)
        if is_cost(rigid.get(name)):
            accuracy.axhline(rigid[name], color=color, linewidth=0.9, linestyle=(0, (5, 2)))
            accuracy.annotate("rigid", (0.99, rigid[name]), xycoords=("axes fraction", "data"), fontsize=8,
                              ha="right", va="bottom", color=color)  # fmt: skip
    if accuracy.lines:
        accuracy.set_yscale("log")
        accuracy.yaxis.set_major_formatter(FuncFormatter(power_of_ten))
        accuracy.yaxis.set_minor_formatter(NullFormatter())
        if accuracy.get_legend_handles_labels()[0]:
            accuracy.legend(frameon=False, fontsize=8.5, loc="lower left")
    _curve(price, rows, "flight_s", 1e3, color=VERMILION, marker="o", label="one flight")
    price.set_ylim(0.0, HEADROOM * price.get_ylim()[1])
    for axes, label in ((accuracy, "J, rad²"), (price, "one flight on one core, ms")):
        axes.set_ylabel(label, fontsize=9)
        axes.set_xlabel("links per wing", fontsize=9)
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        axes.tick_params(labelsize=8.5)
        light_grid(axes)
        _mark(axes, document)
    headline(figure, "accuracy and cost against the number of links per wing")
    return figure


def study_table(document: Document) -> bytes:
    """Write a study's rows as CSV, UTF-8, with the units of the document; what is not known is empty."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow((*PLAIN_COLUMNS, *(f"rms_{angle}_rad" for angle in ANGLES), "recommended"))
    chosen = _recommended(document)
    for row in document["rows"]:
        rms = row.get("rms_rad") or {}
        values = [*(row.get(name) for name in PLAIN_COLUMNS), *(rms.get(angle) for angle in ANGLES)]
        cells = ["" if value is None else f"{value:.9g}" for value in values]
        writer.writerow((*cells, "yes" if row["links_per_wing"] == chosen else ""))
    return text.getvalue().encode()


def _curve(axes: Axes, rows: list[Document], name: str, factor: float, **style: Any) -> None:
    """A quantity of the rows that know it."""
    known = [(row["links_per_wing"], factor * row[name]) for row in rows if is_cost(row.get(name))]
    if known:
        axes.plot(*zip(*known, strict=True), linewidth=1.4, markersize=5.0, **style)


def _mark(axes: Axes, document: Document) -> None:
    """Show the recommended number."""
    chosen = _recommended(document)
    if chosen is not None:
        axes.axvspan(chosen - 0.15, chosen + 0.15, color="0.93", zorder=0)
        axes.annotate("recommended", (chosen, 0.98), xycoords=("data", "axes fraction"), fontsize=8,
                      ha="center", va="top", rotation=90, color="0.4")  # fmt: skip


def _recommended(document: Document) -> int | None:
    chosen: int | None = (document.get("recommended") or {}).get("links_per_wing")
    return chosen
