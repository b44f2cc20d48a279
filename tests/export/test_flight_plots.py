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
    assert np.allclose(theta.lines[-1].get_ydata()[[0, -1]], np.degrees([0.06, -0.04]))
    assert phi.get_ylim() == (-0.1, 0.1)
    assert np.allclose(tips.lines[0].get_ydata()[[0, -1]], [0.27, 0.17])
    assert np.isclose(sweep.lines[0].get_ydata()[-1], np.degrees(1.0))
    assert len(flight_figure(flight(tips=False)).axes) == 4


def test_a_turn_through_south_is_one_line() -> None:
    """A heading that passes pi goes on."""
    yaw = np.linspace(3.0, 3.4, 101)
    document = flight()
    document["trajectory"]["psi_rad"] = ((yaw + np.pi) % (2 * np.pi) - np.pi).tolist()
    line = flight_figure(document).axes[2].get_lines()[-1]
    np.testing.assert_allclose(line.get_ydata(), np.degrees(yaw))


def test_sides_that_differ_are_two_lines() -> None:
    """Unlike sweeps and tips have a line each, right first; what moves alike, or is round-off, has one."""
    document = flight()
    *_, tips, sweep = flight_figure(document).axes
    assert len(tips.get_lines()) == len(sweep.get_lines()) == 1
    flown = document["trajectory"]
    for name, shift in (("sweep_right_rad", 0.1), ("tip_right_z_m", 1e-3)):
        flown[name] = (np.array(flown[name]) + shift).tolist()
    *_, tips, sweep = flight_figure(document).axes
    right, left = tips.get_lines()
    np.testing.assert_allclose(np.array(left.get_ydata()) - right.get_ydata(), 1e-3)
    assert len(sweep.get_lines()) == 2


def test_rigid_wings_are_flat() -> None:
    """Round-off at the tips of rigid wings is a flat line on an axis of visible size."""
    document = flight()
    noise = 1e-16 * np.sin(np.arange(101.0))
    document["trajectory"] |= dict.fromkeys(("tip_left_z_m", "tip_right_z_m"), noise.tolist())
    assert flight_figure(document).axes[3].get_ylim() == (-0.1, 0.1)


def test_one_wing_is_drawn_alone() -> None:
    """Where a side has no wing the other one's tip is drawn."""
    document = flight()
    document["trajectory"]["tip_left_z_m"] = None
    tips = flight_figure(document).axes[3]
    assert len(tips.get_lines()) == 1
