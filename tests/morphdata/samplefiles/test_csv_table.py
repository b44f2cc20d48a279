"""Laws of writing tables: no cell is a program, no number is changed."""

from __future__ import annotations

import csv
import io
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from morphcore.export.curves import curve_table, schedule_tables
from morphcore.simulate.flight import write_trajectory_csv
from morphcore.simulate.trajectory import Trajectory, load_trajectory
from morphdata.samplefiles.csv_table import CONTROL, FORMULA_STARTS, neutral, write_table

FORMULAS = ["=1+1", "+1+1", "-1+1", "@SUM(A1)", "\t=1", "\r=1", "  =1", "=cmd|' /C calc'!A0", "＝1+1", "\n=1"]


def harmless(cell: str) -> bool:
    """Whether a spreadsheet takes a cell for text or for a number."""
    try:
        float(cell)
    except ValueError:
        return cell.strip()[:1] not in FORMULA_STARTS
    return True


@pytest.mark.parametrize("cell", FORMULAS)
def test_formulas_become_text(cell: str) -> None:
    """What a spreadsheet would run begins with an apostrophe."""
    assert neutral(cell) == f"'{CONTROL.sub(' ', cell)}"


@given(st.text(max_size=20))
def test_every_text_is_harmless(text: str) -> None:
    """Whatever a name is, its cell is text; and a harmless text stays as it is."""
    assert harmless(neutral(text))
    if harmless(text) and not CONTROL.search(text):
        assert neutral(text) == text


@given(st.floats(allow_nan=True))
def test_numbers_are_untouched(number: float) -> None:
    """Signs and exponents are no formulas."""
    text = f"{number:.17g}"
    assert neutral(text) == text


def test_tables_read_back() -> None:
    """Titles and cells with commas, quotes and line ends come back whole."""
    stream = io.StringIO()
    write_table(stream, ["a,b", '"', "=x"], [["1", "-2", "x\ny,"]])
    assert list(csv.reader(io.StringIO(stream.getvalue(), newline=""))) == [
        ["a,b", '"', "'=x"],
        ["1", "-2", "x y,"],
    ]


def cells(text: str) -> list[str]:
    """All cells of a table."""
    return [cell for row in csv.reader(io.StringIO(text, newline="")) for cell in row]


@pytest.mark.parametrize("name", FORMULAS)
def test_no_table_of_ours_holds_a_formula(tmp_path: Path, name: str) -> None:
    """Column titles of a measured flight, names of schedules and models: harmless in every file we write."""
    t = np.array([0.0, 0.1, 0.2, 0.3])
    drives = {"sweep_left": -t, "sweep_right": t}
    flown = Trajectory("x", t, drives, phi=-t, theta=t, psi=-t, extra={name: -t})
    write_trajectory_csv(flown, tmp_path / "flight.csv")
    angles = {f"{angle}_rad": [-1.0, math.nan, None, 1.0] for angle in ("phi", "theta", "psi")}
    curves = {
        "time_s": t.tolist(),
        "schedules": {key: {"sweep_rad": t.tolist(), name: t.tolist()} for key in ("optimum", name)},
        "flights": {name: {name: angles}},
    }
    sample = {"name": name, "time_s": t.tolist(), "measured": angles}
    texts = [(tmp_path / "flight.csv").read_text(), curve_table(sample).decode()]
    texts += [table.decode() for table in schedule_tables(curves).values()]
    for text in texts:
        assert all(map(harmless, cells(text)))
    np.testing.assert_array_equal(load_trajectory(tmp_path / "flight.csv").theta, t)
