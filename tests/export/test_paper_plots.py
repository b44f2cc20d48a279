"""Figures of the paper's report show what they are given."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

from morphcore.export.figure import rendered
from morphcore.export.paper_plots import (
    front_figure,
    independent_figure,
    search_figure,
    truth_figure,
    verification_figure,
)
from tests.paper import made_up


def _names(figure: Figure) -> list[str]:
    return [text.get_text() for legend in figure.legends for text in legend.get_texts()]


def test_held_out_flights_are_dashed() -> None:
    """Of six flights the three to identify on are drawn solid; tips are drawn upwards."""
    flights = made_up.results()["truth"]["flights"]
    pitch, tip, _ = truth_figure(flights).axes
    assert [line.get_linestyle() for line in pitch.get_lines()] == ["-"] * 3 + ["--"] * 3
    assert tip.get_lines()[0].get_ydata()[0] == pytest.approx(0.2)
    assert len(_names(truth_figure(flights))) == 6


def test_the_equivalent_models_error_has_its_own_axis() -> None:
    """A constant error of 0.04 mrad is a line there, in mrad; angles that do not move have no panel."""
    curves = made_up.results()["identification"]["curves"][0]
    figure = verification_figure(curves)
    assert [axes.get_ylabel() for axes in figure.axes] == ["pitch θ, deg", "error, mrad", "sweep, deg"]
    error = figure.axes[1].get_lines()[0].get_ydata()
    assert np.allclose(error, 0.04)
    assert _names(figure) == ["flexible model", "rigid model", "equivalent model"]


def test_an_asymmetric_flight_has_all_its_angles() -> None:
    """Roll and yaw that move get panels of their own."""
    curves = made_up.results()["identification"]["curves"][0]
    for model in ("measured", "rigid", "identified"):
        curves[model]["phi_rad"] = curves[model]["psi_rad"] = curves[model]["theta_rad"]
    assert len(verification_figure(curves).axes) == 5


def test_a_perfect_model_is_a_line_at_zero() -> None:
    """Round-off is not blown up to fill the axis."""
    curves = made_up.results()["identification"]["curves"][0]
    curves["identified"] = curves["measured"]
    low, high = verification_figure(curves).axes[1].get_ylim()
    assert low <= -1e-3
    assert high >= 1e-3


def test_searches_share_logarithmic_axes() -> None:
    """Both histories are drawn; a row without a cost is left out."""
    histories = {name: made_up.results()[name]["search"]["history"] for name in ("identification", "swarm")}
    histories["swarm"][0]["best_cost"] = None
    (axes,) = search_figure(histories).axes
    assert [line.get_xdata().size for line in axes.get_lines()] == [4, 3]
    assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")


def test_predictions_stand_next_to_their_errors() -> None:
    """One row for each angle that moves; errors are ours minus theirs, in mrad, of both laws."""
    found = made_up.results()["independent"]
    figure = independent_figure(found["samples"], found["laws"])
    assert len(figure.axes) == 2 * len(found["samples"])
    last = figure.axes[1].get_lines()[0].get_ydata()[-1]
    assert last == pytest.approx(1e3 * 0.001 * 0.4)


def test_the_front_shows_what_was_flown() -> None:
    """Constant rate, optimum and its flight in the flexible model; the ordinate begins at zero."""
    points = [point | {"flown_rad2": 19.0} for point in made_up.results()["front"]["points"]]
    (axes,) = front_figure(points).axes
    assert len(axes.get_lines()) == 3
    assert axes.get_ylim()[0] == 0.0


def test_the_same_input_gives_the_same_bytes() -> None:
    """As all figures of the house."""
    flights = made_up.results()["truth"]["flights"]
    first, again = (rendered("f", truth_figure(flights), ("svg",)) for _ in range(2))
    assert first == again
