"""Plots: files, units, limits, names, repeatability."""

from __future__ import annotations

import struct
from concurrent.futures import ThreadPoolExecutor
from typing import Any
from xml.etree import ElementTree as ET

import matplotlib as mpl
import numpy as np
import pytest

from morphcore.export.plots import (
    attitude_figure,
    convergence_figure,
    identification_plots,
    residual_figure,
)
from tests.export.flown_samples import MODELS, flown_sample

HISTORY = [
    {"generation": 0, "phase": "baseline", "flights": 3, "best_cost": 0.1},
    {"generation": 1, "phase": "swarm", "flights": 603, "best_cost": 2e-3},
    {"generation": 2, "phase": "polish", "flights": 903, "best_cost": 4e-5},
]


def _document(history: list[dict[str, Any]] | None = None) -> dict[str, Any]:
    return {"model": {}, "fit": [], "search": {"history": HISTORY if history is None else history}}


def test_every_sample_gets_its_pictures() -> None:
    """Attitude and residuals of each sample and the convergence, each well-formed as SVG and as PNG."""
    curves = {"samples": [flown_sample("a/b"), flown_sample("held", diverges=True)]}
    files = identification_plots(_document(), curves)
    kinds = ("attitude", "residuals", "autocorrelation")
    stems = (*(f"{kind}_{sample}" for kind in kinds for sample in ("a_b", "held")), "convergence")
    assert set(files) == {f"{stem}.{kind}" for stem in stems for kind in ("svg", "png")}
    for stem in stems:
        root = ET.fromstring(files[f"{stem}.svg"])  # noqa: S314 - our own file
        assert root.tag.endswith("svg")
        assert files[f"{stem}.png"].startswith(b"\x89PNG")
        width, height = struct.unpack(">II", files[f"{stem}.png"][16:24])
        assert width > 600
        assert height > 300


def test_same_input_same_bytes() -> None:
    """No date, no random ids: the same result gives the same files, drawn in one thread or in many.

    The settings of matplotlib that a caller has made are as before.
    """
    curves = {"samples": [flown_sample("one")]}
    before = dict(mpl.rcParams)
    first = identification_plots(_document(), curves)
    with ThreadPoolExecutor(2) as pool:
        others = list(pool.map(lambda _: identification_plots(_document(), curves), range(2)))
    assert all(other == first for other in others)
    assert dict(mpl.rcParams) == before
    assert b"<dc:date>" not in first["convergence.svg"]


def test_attitude_is_drawn_in_degrees() -> None:
    """The curves are the data times 180 / pi, sample first, under labels that say so."""
    sample = flown_sample("one")
    axes = attitude_figure(sample).axes
    for panel, key in zip(axes, ("phi_rad", "theta_rad", "psi_rad"), strict=False):
        assert panel.get_ylabel().endswith("deg")
        for line, model in zip(panel.get_lines(), MODELS, strict=True):
            np.testing.assert_allclose(line.get_ydata(), np.degrees(sample[model][key]), atol=1e-12)
    assert axes[-1].get_ylabel() == "sweep, deg"
    assert axes[-1].get_xlabel() == "time, s"


def test_residuals_are_drawn_in_milliradians() -> None:
    """Model minus sample, times 1000; the identified model has a column of its own."""
    sample = flown_sample("one")
    panels = residual_figure(sample).axes
    assert len(panels) == 6
    error = 1e3 * (np.array(sample["identified"]["phi_rad"]) - np.array(sample["measured"]["phi_rad"]))
    np.testing.assert_allclose(panels[1].get_lines()[-1].get_ydata(), error, atol=1e-9)
    assert panels[0].get_ylabel().endswith("mrad")
    assert panels[1].get_title(loc="right") == f"rms {np.sqrt(np.mean(error**2)):.2g} mrad"


def test_yaw_through_south_is_one_line() -> None:
    """An angle that passes pi goes on, and the difference to the sample is the short way round."""
    sample = flown_sample("turn")
    yaw = np.linspace(3.0, 3.4, 41)
    sample["measured"]["psi_rad"] = ((yaw + np.pi) % (2 * np.pi) - np.pi).tolist()
    sample["identified"]["psi_rad"] = ((yaw + 1e-3 + np.pi) % (2 * np.pi) - np.pi).tolist()
    lines = attitude_figure(sample).axes[2].get_lines()
    np.testing.assert_allclose(lines[0].get_ydata(), np.degrees(yaw), atol=1e-9)
    np.testing.assert_allclose(lines[3].get_ydata(), np.degrees(yaw + 1e-3), atol=1e-9)


def test_round_off_is_not_blown_up() -> None:
    """Angles that stay below a microradian are flat lines on an axis of visible size."""
    sample = flown_sample("straight", symmetric=True)
    attitude = attitude_figure(sample).axes
    assert attitude[0].get_ylim() == (-0.1, 0.1)
    assert attitude[2].get_ylim() == (-0.1, 0.1)
    assert attitude[0].get_position().height < 0.6 * attitude[1].get_position().height
    residuals = residual_figure(sample).axes
    assert residuals[1].get_ylim() == (-0.01, 0.01)
    assert residuals[1].get_title(loc="right") == "rms below 0.001 mrad"
    assert residuals[3].get_ylim()[1] < 1.0, "the pitch error has an axis of its own"


def test_any_name_can_be_drawn() -> None:
    """Names with formulas, control characters, foreign letters or markup stay text, without a warning."""
    names = ["$x^2", "a\nb\0c, 航迹 один", "x" * 500, "<svg onload='alert(1)'>--><script>", "\ud800"]
    files = identification_plots(_document(), {"samples": [flown_sample(name) for name in names]})
    assert len(files) == 2 * (3 * len(names) + 1)
    for content in (value for key, value in files.items() if key.endswith(".svg")):
        assert b"<script" not in content.lower()
        tags = {element.tag.rpartition("}")[2] for element in ET.fromstring(content).iter()}  # noqa: S314
        assert "script" not in tags
        assert b"onload" not in b"".join(line for line in content.splitlines() if b"<!--" not in line)


@pytest.mark.parametrize(
    "history",
    [
        [],
        HISTORY[:1],
        [{"generation": 0, "best_cost": None}, {"generation": 1, "best_cost": 2.0}],
        [{"generation": i, "best_cost": 1.0} for i in range(4)],
        [{"generation": 0, "best_cost": 0.0}],
    ],
)
def test_any_history_can_be_drawn(history: list[dict[str, Any]]) -> None:
    """A search that was stopped at once, diverged at first or stood still has its picture too."""
    assert identification_plots(_document(history), {"samples": []})["convergence.svg"]


def test_convergence_counts_flights_where_they_are_reported() -> None:
    """Least cost over flights on a logarithmic axis; over generations without counts."""
    axes = convergence_figure(_document()).axes[0]
    assert axes.get_xlabel() == "flights flown"
    assert axes.get_yscale() == "log"
    np.testing.assert_array_equal(axes.get_lines()[0].get_xdata(), [3, 603, 903])
    assert "4.00·10⁻⁵" in axes.get_title()
    bare = [{"generation": i, "best_cost": 10.0**-i} for i in range(3)]
    assert convergence_figure(_document(bare)).axes[0].get_xlabel() == "generation"


def test_long_samples_stay_small_files() -> None:
    """A flight of 200,000 rows is drawn with no more points than a page has pixels."""
    sample = flown_sample("long")
    t = np.linspace(0.0, 2000.0, 200_000)
    sample["time_s"] = t.tolist()
    wave = (0.1 * np.sin(37.0 * t)).tolist()
    for key in ("sweep_left_rad", "sweep_right_rad"):
        sample[key] = wave
    for model in MODELS:
        sample[model] = dict.fromkeys(("phi_rad", "theta_rad", "psi_rad"), wave)
    files = identification_plots(_document(), {"samples": [sample]})
    assert max(map(len, files.values())) < 3_000_000
