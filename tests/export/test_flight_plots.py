"""The picture of a simulated flight: files, panels, repeatability."""

from __future__ import annotations

from typing import Any
from xml.etree import ElementTree as ET

import numpy as np

from morphcore.export.flight_plots import flight_figure, flight_plots


def flight(*, tips: bool = True) -> dict[str, Any]:
    """Make a result of a flight that only pitches, its wings swept alike."""
    time_s = np.linspace(0.0, 1.0, 101)
    still = np.zeros_like(time_s)
    columns = {"time_s": time_s, "sweep_left_rad": time_s, "sweep_right_rad": time_s}
    columns |= {"phi_rad": still, "theta_rad": 0.06 - 0.1 * time_s, "psi_rad": still}
    if tips:
        columns |= {"tip_left_z_m": -0.27 + 0.1 * time_s, "tip_right_z_m": -0.27 + 0.1 * time_s}
    return {"model": {"kind": "flexible"}, "trajectory": {k: v.tolist() for k, v in columns.items()}}


def test_a_flight_has_one_picture() -> None:
    """One picture as SVG and as PNG, the same bytes for the same flight."""
    files = flight_plots(flight())
    assert set(files) == {"flight.svg", "flight.png"}
    assert ET.fromstring(files["flight.svg"]).tag.endswith("svg")  # noqa: S314 - our own file
    assert files == flight_plots(flight())


def test_panels_show_the_flight() -> None:
    """Pitch in degrees as flown, roll as a flat line, tips upwards, sweep last; no panel without data."""
    phi, theta, _, tips, sweep = flight_figure(flight()).axes
    assert np.allclose(theta.lines[0].get_ydata()[[0, -1]], np.degrees([0.06, -0.04]))
    assert phi.get_ylim() == (-0.1, 0.1)
    assert np.allclose(tips.lines[0].get_ydata()[[0, -1]], [0.27, 0.17])
    assert np.isclose(sweep.lines[0].get_ydata()[-1], np.degrees(1.0))
    assert len(flight_figure(flight(tips=False)).axes) == 4
