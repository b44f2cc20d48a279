"""Curves as CSV: what is in the tables, and names that any file system takes."""

from __future__ import annotations

import csv
import io
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from morphcore.export.curves import curve_tables, file_stems
from tests.export.flown_samples import flown_sample

PLAIN = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,139}")


@given(st.lists(st.text(max_size=300), max_size=8))
def test_file_names_are_plain_and_different(names: list[str]) -> None:
    """Whatever samples are called: no folders, no dot files, no two alike even where case does not count."""
    stems = file_stems(names)
    assert len({stem.lower() for stem in stems}) == len(names)
    assert all(PLAIN.fullmatch(stem) for stem in stems)


def test_plain_names_stay() -> None:
    """A name that is a good file name is one."""
    assert file_stems(["train_rate_0.2", "../etc", "a b", "A_b", ""]) == [
        "train_rate_0.2",
        "etc",
        "a_b",
        "A_b-2",
        "sample",
    ]


def test_tables_hold_every_curve() -> None:
    """Time, sweeps and three angles of each model; nine digits; an empty cell where a flight diverged."""
    sample = flown_sample("one", diverges=True)
    tables = curve_tables({"samples": [sample, flown_sample("One")]})
    assert list(tables) == ["curves_one.csv", "curves_One-2.csv"]
    rows = list(csv.DictReader(io.StringIO(tables["curves_one.csv"].decode())))
    assert len(rows) == len(sample["time_s"])
    assert list(rows[0])[:5] == [
        "time_s",
        "sweep_left_rad",
        "sweep_right_rad",
        "measured_phi_rad",
        "measured_theta_rad",
    ]
    assert rows[-1]["initial_theta_rad"] == ""
    for name in ("measured", "rigid", "identified"):
        for angle in ("phi_rad", "theta_rad", "psi_rad"):
            read = [float(row[f"{name}_{angle}"]) for row in rows]
            assert read == pytest.approx(sample[name][angle], rel=1e-8, abs=1e-12)


def test_no_title_can_be_taken_for_a_formula() -> None:
    """A sample called like a formula changes its file's name only."""
    ((name, content),) = curve_tables({"samples": [flown_sample("=HYPERLINK(1)")]}).items()
    assert name == "curves_HYPERLINK_1.csv"
    assert not any(title[0] in "=+-@\t" for title in content.decode().splitlines()[0].split(","))


def test_curves_without_sweep_or_guess_are_written() -> None:
    """What a producer leaves out is left out."""
    sample = flown_sample("bare")
    for key in ("sweep_left_rad", "sweep_right_rad", "initial"):
        del sample[key]
    header = curve_tables({"samples": [sample]})["curves_bare.csv"].decode().splitlines()[0]
    assert header.startswith("time_s,measured_phi_rad")
    assert "initial" not in header
