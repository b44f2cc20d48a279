"""Pictures of an optimised morph: what they show, and what they do without."""

from __future__ import annotations

from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from morphcore.export.schedule_plots import departure_figure, front_figure, schedule_figure, schedule_plots

NAMES = ("constant", "rigid_optimum", "optimum")


def result(**changes: Any) -> dict[str, Any]:
    """Make an optimisation's result: a radian in two seconds."""
    variation = {name: {"rigid": 1.0, "equivalent": 2.0, "flexible": 3.0 + i} for i, name in enumerate(NAMES)}
    return {
        "schedule": {"knot_time_s": [0.0, 1.2, 2.0], "knot_sweep_rad": [0.0, 0.5, 1.0]},
        "duration_s": 2.0,
        "limits": {"max_rate_rad_s": 1.0, "max_accel_rad_s2": None},
        "variation": variation,
        **changes,
    }


def curves(*models: str, names: tuple[str, ...] = NAMES) -> dict[str, Any]:
    """Make its curves: schedules apart by a little, pitch that differs, silent roll and yaw."""
    time_s = np.linspace(0.0, 4.0, 401)
    sweep = np.clip(time_s / 2.0, 0.0, 1.0)
    inside = np.where(time_s <= 2.0, 0.5, 0.0)
    return {
        "time_s": time_s.tolist(),
        "schedules": {
            name: {
                "sweep_rad": (sweep * (1.0 + 0.01 * i)).tolist(),
                "rate_rad_s": (inside * (1.0 + i)).tolist(),
                "acceleration_rad_s2": (0.0 * inside).tolist(),
            }
            for i, name in enumerate(names)
        },
        "flights": {
            model: {
                name: {
                    "phi_rad": [0.0] * 401,
                    "theta_rad": (-0.1 * (i + 1) * sweep).tolist(),
                    "psi_rad": [0.0] * 401,
                }
                for i, name in enumerate(names)
            }
            for model in models
        },
    }


def front(*points: tuple[float, float, float | None, bool]) -> dict[str, Any]:
    """Make the parts of a front: duration, variation, constant rate's variation, beaten."""
    searched = [
        {"duration_s": t, "variation_rad2": v, "constant_rad2": c, "beaten": b} for t, v, c, b in points
    ]
    return {"pareto": [p for p in searched if not p["beaten"]], "searched": searched}


def test_schedules_are_drawn_over_the_morph_with_its_knots_and_limits() -> None:
    """Sweep, rate and acceleration in degrees to the end of the morph; dots are knots, a line the limit."""
    sweep, rate, acceleration = schedule_figure(result(), curves("rigid")).axes
    drawn = [line for line in sweep.lines if line.get_marker() in ("None", "")]
    assert len(drawn) == len(NAMES)
    assert all(line.get_xdata()[-1] == pytest.approx(2.0) for line in drawn)
    assert drawn[0].get_ydata()[-1] == pytest.approx(np.degrees(1.0))
    knots = next(line for line in sweep.lines if line.get_marker() == "o")
    np.testing.assert_allclose(knots.get_xdata(), [0.0, 1.2, 2.0])
    np.testing.assert_allclose(knots.get_ydata(), np.degrees([0.0, 0.5, 1.0]))
    assert np.degrees(1.0) in [line.get_ydata()[0] for line in rate.lines if len(line.get_ydata()) == 2]
    assert len(acceleration.lines) == len(NAMES), "no limit, no line"


@pytest.mark.parametrize(
    ("models", "shown"),
    [
        (("rigid", "equivalent", "flexible"), "flexible"),
        (("rigid", "equivalent"), "equivalent"),
        (("rigid",), "rigid"),
    ],
)
def test_departures_are_those_in_the_best_model_that_flew(models: tuple[str, ...], shown: str) -> None:
    """The attitude is the flexible model's where it was flown; its variation stands in the legend."""
    figure = departure_figure(result(), curves(*models))
    assert f"{shown} model" in figure.texts[0].get_text()
    pitch = [line for line in figure.axes[1].lines if len(line.get_xdata()) > 2]
    np.testing.assert_allclose([line.get_ydata()[-1] for line in pitch], np.degrees([-0.1, -0.2, -0.3]))
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    expected = result()["variation"]
    assert labels == [
        f"{label} ({expected[name][shown]:.3g})"
        for name, label in zip(
            NAMES, ("constant rate", "rigid model's optimum", "equivalent model's optimum"), strict=True
        )
    ]


def test_angles_that_do_not_move_are_flat_lines() -> None:
    """Round-off in roll and yaw is not blown up to the height of a panel."""
    roll, _, yaw = departure_figure(result(), curves("rigid")).axes
    assert roll.get_ylim() == yaw.get_ylim() == (-0.1, 0.1)


def test_the_front_shows_what_it_beats() -> None:
    """Front, beaten durations and constant rates each have their own marks; gaps are left out."""
    document = front((1.2, 11.5, 11.8, False), (1.6, 12.0, None, True), (2.0, 11.0, 19.6, False))
    (axes,) = front_figure(result(**document)).axes
    lines = {line.get_label(): line.get_xydata() for line in axes.lines}
    np.testing.assert_array_equal(lines["optimum: the front"], [[1.2, 11.5], [2.0, 11.0]])
    np.testing.assert_array_equal(lines["constant rate"], [[1.2, 11.8], [2.0, 19.6]])
    np.testing.assert_array_equal(lines["optimum, but a shorter morph is as good"], [[1.6, 12.0]])
    assert axes.get_ylim()[0] == 0.0
    assert axes.get_ylim()[1] > 19.6


def test_files_are_named_and_complete() -> None:
    """Two pictures, a third for a front, as SVG that parses and PNG; same input, same bytes."""
    plain = schedule_plots(result(), curves("equivalent"))
    assert sorted(plain) == ["departures.png", "departures.svg", "schedules.png", "schedules.svg"]
    document = result(**front((1.2, 11.5, 11.8, False)))
    drawn = schedule_plots(document, curves("equivalent"))
    assert sorted(set(drawn) - set(plain)) == ["pareto.png", "pareto.svg"]
    for name, content in drawn.items():
        if name.endswith("svg"):
            ET.fromstring(content)  # noqa: S314 - our own picture
        else:
            assert content.startswith(b"\x89PNG")
    assert drawn == schedule_plots(document, curves("equivalent"))


def test_a_best_so_far_without_the_rigid_optimum_can_be_drawn() -> None:
    """Of a cancelled run there may be no rigid optimum and no variation yet."""
    names = ("constant", "optimum")
    document = result(
        variation={name: {"rigid": None, "equivalent": None, "flexible": None} for name in NAMES}
    )
    drawn = schedule_plots(document, curves("equivalent", names=names))
    assert len(drawn) == 4
    figure = departure_figure(document, curves("equivalent", names=names))
    assert [text.get_text() for text in figure.legends[0].get_texts()] == [
        "constant rate",
        "equivalent model's optimum",
    ]
