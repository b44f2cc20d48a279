"""The figure of one simulated flight: attitude, wing tips and drives over time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from morphcore.export.curves import SWEEPS
from morphcore.export.figure import (
    ANGLES,
    BLUE,
    SILENT_SPAN_DEG,
    TITLE_HEAD_IN,
    Array,
    Document,
    draw,
    draw_drive,
    draw_sides,
    drive_panels,
    headline,
    is_silent,
    label_axis,
    printable,
    quiet,
    rendered,
    series,
    stack,
    time_axis,
)

TIPS = ("tip_left_z_m", "tip_right_z_m")
ROUND_OFF_M = 1e-6  # m, difference of tips that move together, or not at all
STILL_SPAN_M = 0.1  # half the height of the axis for tips that do not move
ANGLE_HEIGHT, SILENT_HEIGHT, OTHER_HEIGHT = 1.0, 0.45, 0.6  # relative heights of the panels


def flight_plots(document: Document) -> dict[str, bytes]:
    """Draw a simulation's result.

    Parameters
    ----------
    document : the result; its ``trajectory`` holds the columns ``time_s``, those of the drives named in
    ``drives`` (``sweep_left_rad``), ``phi_rad``, ``theta_rad``, ``psi_rad`` and, if the wings' tips are
    known, ``tip_left_z_m`` and ``tip_right_z_m``.

    Returns
    -------
    File name -> content: ``flight.svg`` and ``flight.png``. The same input gives the same bytes.
    """
    return rendered("flight", flight_figure(document))


def flight_figure(document: Document) -> Figure:
    """Roll, pitch and yaw in degrees, the wing tips (up) in m, the drives in degrees."""
    flown = document["trajectory"]
    time_s = series(flown["time_s"])
    angles = {key: np.unwrap(series(flown[key])) for key, _ in ANGLES}
    silent = {key: is_silent([values]) for key, values in angles.items()}
    tips_up = [-series(flown[name]) for name in TIPS if flown.get(name) is not None]  # body z points down
    heights = [SILENT_HEIGHT if silent[key] else ANGLE_HEIGHT for key, _ in ANGLES]
    drives = drive_panels(flown, document.get("drives", SWEEPS))
    heights += [OTHER_HEIGHT] * (len(drives) + bool(tips_up))
    figure = Figure(figsize=(7.2, 1.1 + 1.75 * sum(heights)))
    rows = stack(figure, heights, TITLE_HEAD_IN)
    for axes, (key, label) in zip(rows, ANGLES, strict=False):
        label_axis(axes, f"{label}, deg")
        axes.axhline(np.degrees(angles[key][0]), color="0.5", linewidth=0.6)  # values at the start
        draw(axes, time_s, np.degrees(angles[key]), color=BLUE, linewidth=1.5)
        if silent[key]:
            quiet(axes, SILENT_SPAN_DEG)
    if tips_up:
        _draw_tips(rows[len(ANGLES)], time_s, tips_up)
    for axes, panel in zip(rows[len(rows) - len(drives) :], drives, strict=True):
        draw_drive(axes, time_s, panel)
    time_axis(figure, rows, time_s)
    headline(figure, f"simulated flight, {printable(str(document['model']['kind']))} model")
    return figure


def _draw_tips(axes: Axes, time_s: Array, up_m: Sequence[Array]) -> None:
    """Draw the height of the tips above their roots, m: for both sides, or for the one that has a wing."""
    label_axis(axes, "tips up, m")
    draw_sides(axes, time_s, up_m[0], up_m[-1], ROUND_OFF_M)
    if all(np.abs(values).max() < ROUND_OFF_M for values in up_m):  # rigid wings
        quiet(axes, STILL_SPAN_M)
