"""Pictures of intervals and autocorrelations show what the result says."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

from morphcore.export.plots import attitude_figure
from morphcore.export.uncertainty_plots import autocorrelation_figure, interval_figure, uncertainty_plots

UNCERTAINTY: dict[str, Any] = {
    "value": {
        "division.1": 0.45,
        "lift_factor": 1.06,
        "ac_offset_m": -0.004,
        "lag_s": 0.004,
        "centre_shift_m": -0.004,
    },
    "interval_95": {
        "division.1": [0.4, 0.5],
        "lift_factor": [1.0, None],
        "ac_offset_m": [-0.006, 0.002],
        "lag_s": [None, None],
    },
    "undetermined": ["lag_s"],
    "at_bound": ["lift_factor"],
}
ROWS = 400


def sample(error: np.ndarray, **more: Any) -> dict[str, Any]:
    """A sample whose pitch is missed by an error, and whose roll and yaw are met exactly."""
    time_s = 0.01 * np.arange(error.size)
    measured = {"phi_rad": [0.0] * error.size, "theta_rad": list(0.1 * time_s), "psi_rad": [0.0] * error.size}
    identified = {**measured, "theta_rad": list(0.1 * time_s + error)}
    drive = {"sweep_left_rad": list(time_s), "sweep_right_rad": list(time_s)}
    return {
        "name": "a",
        "time_s": list(time_s),
        "measured": measured,
        "identified": identified,
        **drive,
        **more,
    }


def texts(figure: Figure) -> list[str]:
    """All texts in the panels of a figure, names of ticks included."""
    found = [text.get_text() for axes in figure.axes for text in axes.texts]
    return found + [label.get_text() for axes in figure.axes for label in axes.get_yticklabels()]


def test_every_parameter_has_a_bar_from_end_to_end() -> None:
    """Ends stand at the interval over the value; open ends and those through zero leave the picture."""
    figure = interval_figure(UNCERTAINTY)
    axes = figure.axes[0]
    bars = [line for line in axes.lines if line.get_linewidth() == 2.2]
    low, high = axes.get_xlim()
    ends = [tuple(np.asarray(bar.get_xdata(), dtype=float)) for bar in bars]
    assert ends[0] == pytest.approx((0.4 / 0.45, 0.5 / 0.45))
    assert ends[1] == pytest.approx((1.0 / 1.06, high))
    assert ends[2] == pytest.approx((low, 1.5))  # -0.006 / -0.004, and through zero on the other side
    assert ends[3] == pytest.approx((low, high))
    said = texts(figure)
    assert any("not determined" in text for text in said)
    assert any("at its bound" in text for text in said)
    assert said.count("ac_offset_m") == 1  # not under its former name as well


def test_autocorrelation_shows_what_is_white_and_what_is_not() -> None:
    """Stems of white noise stay in the band but for one in twenty; those of a smooth error leave it."""
    noise = np.random.default_rng(4).normal(0.0, 1e-3, ROWS)
    for error, inside in ((noise, True), (1e-3 * np.sin(0.02 * np.arange(ROWS)), False)):
        axes = autocorrelation_figure(sample(error)).axes[1]
        stems = axes.collections[-1].get_segments()  # type: ignore[attr-defined]
        values = np.array([stem[1][1] for stem in stems])
        assert values[0] == pytest.approx(1.0)
        share = np.mean(np.abs(values[1:]) < 1.96 / np.sqrt(ROWS))
        assert bool(share > 0.9) is inside
    silent = autocorrelation_figure(sample(np.zeros(ROWS)))
    assert sum("no error" in text for text in texts(silent)) == 3


def test_files_and_their_bytes() -> None:
    """One picture of the intervals, one for each sample that was flown; the same input, the same bytes."""
    samples = {"a": sample(np.full(50, 1e-3)), "b": {**sample(np.zeros(50)), "identified": None}}
    files = uncertainty_plots({"uncertainty": UNCERTAINTY}, samples)
    assert sorted(files) == [
        "autocorrelation_a.png",
        "autocorrelation_a.svg",
        "intervals.png",
        "intervals.svg",
    ]
    assert files == uncertainty_plots({"uncertainty": UNCERTAINTY}, samples)
    assert "intervals.png" not in uncertainty_plots({"uncertainty": {"interval_95": {}}}, samples)


def test_a_band_is_drawn_where_there_is_one() -> None:
    """Low and high of an angle become a band around it, in degrees."""
    plain = sample(np.zeros(50))
    low, high = (list(np.asarray(plain["measured"]["theta_rad"]) + shift) for shift in (-0.01, 0.02))
    figure = attitude_figure({**plain, "band": {"theta_rad": {"low": low, "high": high}}})
    assert [len(axes.collections) for axes in figure.axes[:3]] == [0, 1, 0]
    corners = figure.axes[1].collections[0].get_paths()[0].vertices
    heights = np.asarray(corners)[:, 1]
    assert heights.min() == pytest.approx(np.degrees(-0.01))
    assert heights.max() == pytest.approx(np.degrees(0.1 * 0.49 + 0.02))
    assert [len(axes.collections) for axes in attitude_figure(plain).axes[:3]] == [0, 0, 0]
