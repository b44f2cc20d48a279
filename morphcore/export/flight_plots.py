"""The picture of one simulated flight: attitude, wing tips and sweep over time."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from morphcore.export.figure import (
    ANGLES,
    BLUE,
    SILENT_SPAN_DEG,
    TITLE_HEAD_IN,
    Document,
    draw,
    draw_sides,
    draw_sweep,
    headline,
    is_silent,
    label_axis,
    quiet,
    rendered,
    series,
    stack,
    time_axis,
)

TIPS = ("tip_left_z_m", "tip_right_z_m")
TIPS_ALIKE_M = 1e-6  # round-off of tips that move together
ANGLE_HEIGHT, SILENT_HEIGHT, OTHER_HEIGHT = 1.0, 0.45, 0.6  # of the panels, relative


def flight_plots(document: Document) -> dict[str, bytes]:
    """Draw a simulation's result.

    Parameters
    ----------
    document : the result; its ``trajectory`` holds the columns ``time_s``, ``sweep_left_rad``,
        ``sweep_right_rad``, ``phi_rad``, ``theta_rad``, ``psi_rad`` and, where the wings' tips are known,
        ``tip_left_z_m`` and ``tip_right_z_m``.

    Returns
    -------
    File name -> content: ``flight.svg`` and ``flight.png``. The same input gives the same bytes.
    """
    return rendered("flight", flight_figure(document))


def flight_figure(document: Document) -> Figure:
    """Roll, pitch and yaw in degrees, the wing tips (up) in m, the sweep in degrees."""
    flown = document["trajectory"]
    time_s = series(flown["time_s"])
    angles = {key: np.unwrap(series(flown[key])) for key, _ in ANGLES}
    silent = {key: is_silent([values]) for key, values in angles.items()}
    has_tips = all(name in flown for name in TIPS)
    heights = [SILENT_HEIGHT if silent[key] else ANGLE_HEIGHT for key, _ in ANGLES]
    heights += [OTHER_HEIGHT] * (1 + has_tips)
    figure = Figure(figsize=(7.2, 1.1 + 1.75 * sum(heights)))
    rows = stack(figure, heights, TITLE_HEAD_IN)
    for axes, (key, label) in zip(rows, ANGLES, strict=False):
        label_axis(axes, f"{label}, deg")
        draw(axes, time_s, np.degrees(angles[key]), color=BLUE, linewidth=1.5)
        if silent[key]:
            quiet(axes, SILENT_SPAN_DEG)
    if has_tips:
        left, right = (-series(flown[name]) for name in TIPS)  # body z points down
        draw_sides(rows[len(ANGLES)], time_s, left, right, TIPS_ALIKE_M)
        label_axis(rows[len(ANGLES)], "tips up, m")
    draw_sweep(rows[-1], time_s, flown)
    time_axis(figure, rows, time_s)
    headline(figure, f"simulated flight, {document['model']['kind']} model")
    return figure
