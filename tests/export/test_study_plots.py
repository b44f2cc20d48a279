"""A study as a picture and as a table: what they show, and what they do without."""

from __future__ import annotations

import csv
import io
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from morphcore.export.curves import study_table
from morphcore.export.study_plots import study_figure, study_plots
from morphdata.links import mean_links


def row(links: Any, **changes: Any) -> dict[str, Any]:
    """Make a study's row."""
    return {
        "links_per_wing": links,
        "bodies": 2 * mean_links(links) + 1,
        "parameters": 7 * (mean_links(links) - 1) + 4,
        "J_train": 0.1 / 10 ** mean_links(links),
        "J_held_out": 0.3 / 10 ** mean_links(links),
        "rms_rad": {"phi": 1e-3, "theta": 2e-3, "psi": None},
        "flight_s": 0.01 * mean_links(links),
        "identify_s": 1.0,
        "flights": 100,
        **changes,
    }


def study(*rows: dict[str, Any], recommended: Any = 2) -> dict[str, Any]:
    """Make a study's result."""
    return {
        "rows": list(rows),
        "rigid": {"J_train": 0.05, "J_held_out": 0.2, "flight_s": 0.008},
        "recommended": {"links_per_wing": recommended, "reason": "because"},
    }


def test_the_picture_shows_accuracy_and_price() -> None:
    """J of both roles on a logarithmic axis, with the rigid model's, and the time of a flight in ms."""
    accuracy, price = study_figure(study(row(1), row(2), row(3))).axes
    fitted = next(line for line in accuracy.lines if line.get_label() == "fitted flights")
    assert np.allclose(fitted.get_ydata(), [1e-2, 1e-3, 1e-4])
    assert accuracy.get_yscale() == "log"
    assert max(line.get_ydata()[0] for line in accuracy.lines) == 0.2
    assert np.allclose(price.lines[0].get_ydata(), [10.0, 20.0, 30.0])
    low, high = accuracy.get_ylim()
    assert low < 1e-4
    assert high > 0.2, "the rigid model is within the picture"
    assert price.get_ylabel().endswith("ms")


def test_numbers_that_differ_by_surface_stand_at_their_mean() -> None:
    """In the picture; in the table they are written out."""
    unlike = {"wing": 4, "tail": 1}
    document = study(row(1), row(unlike), row(4), recommended=unlike)
    figure = study_figure(document)
    assert figure.axes[1].lines[0].get_xdata().tolist() == [1.0, 2.5, 4.0]
    assert "4 links of wing, 1 of tail" in figure.texts[0].get_text()
    rows = list(csv.DictReader(io.StringIO(study_table(document).decode())))
    assert [each["links_per_wing"] for each in rows] == ["1", "4 links of wing, 1 of tail", "4"]
    assert [each["recommended"] for each in rows] == ["", "yes", ""]


def test_the_title_says_which_to_take() -> None:
    """The recommended number stands above, where there is one."""
    titles = [
        study_figure(study(row(1), row(2), recommended=chosen)).texts[0].get_text() for chosen in (2, None)
    ]
    assert titles[0].endswith("recommended: 2 links per wing")
    assert "recommended" not in titles[1]


def test_gaps_are_left_out() -> None:
    """A model that diverged has no point; the others keep their places."""
    accuracy = study_figure(study(row(1), row(2, J_held_out=None), row(3))).axes[0]
    held_out = next(line for line in accuracy.lines if line.get_label() == "flights held out")
    assert np.array_equal(held_out.get_xdata(), [1, 3])


def test_same_input_same_bytes() -> None:
    """No date, no random ids."""
    assert study_plots(study(row(1), row(2))) == study_plots(study(row(1), row(2)))


@pytest.mark.parametrize(
    "document",
    [
        study(row(1, J_held_out=None, flight_s=None), recommended=1),
        study(row(1, J_train=None, J_held_out=None), recommended=None),
        {"rows": [], "recommended": None},
    ],
)
def test_what_is_not_known_is_not_drawn(document: dict[str, Any]) -> None:
    """A study without held-out flights, one whose model diverged, one cancelled at once."""
    files = study_plots(document)
    assert set(files) == {"study.svg", "study.png"}
    assert ET.fromstring(files["study.svg"]).tag.endswith("svg")  # noqa: S314 - our own file


def test_the_table_holds_every_row() -> None:
    """Figures survive to nine digits, unknown ones are empty cells, the recommended row is marked."""
    text = study_table(study(row(1, J_held_out=None), row(2, identify_s=1.23456789))).decode()
    one, two = csv.DictReader(io.StringIO(text))
    assert (one["J_held_out"], one["recommended"], two["recommended"]) == ("", "", "yes")
    assert (two["identify_s"], two["rms_phi_rad"], two["rms_psi_rad"]) == ("1.23456789", "0.001", "")
