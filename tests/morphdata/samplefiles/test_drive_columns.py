"""Columns of drives in files: any name, every unit, in every format; and what cannot be one."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io

from morphdata.aircraft import EXAMPLE_AIRCRAFT, Aircraft
from morphdata.drives import Drive
from morphdata.faults import InvalidInput
from morphdata.samplefiles.columns import MAX_DRIVES
from morphdata.samplefiles.reading import read_flight
from morphdata.samplefiles.titles import drive_meant
from morphdata.samples import load_sample
from morphdata.schedules import load_schedules

T = 0.01 * np.arange(20)
ATTITUDE: dict[str, Any] = {"t": T, "phi": 0.0 * T, "theta": 0.06 + 0.0 * T, "psi": 0.0 * T}
FOLD_DEG = 100.0 * T  # to 19 degrees


def as_csv(path: Path, columns: dict[str, Any]) -> None:
    """A table with all digits; None is an empty cell."""
    cells = [["" if item is None else str(item) for item in column] for column in columns.values()]
    path.write_text("\n".join([",".join(columns), *map(",".join, zip(*cells, strict=True))]))


def as_json(path: Path, columns: dict[str, Any]) -> None:
    """One object of lists."""
    path.write_text(json.dumps({title: list(column) for title, column in columns.items()}))


def as_parquet(path: Path, columns: dict[str, Any]) -> None:
    """One table."""
    pq.write_table(pa.table({title: list(column) for title, column in columns.items()}), path)


def as_matlab(path: Path, columns: dict[str, Any]) -> None:
    """Vectors; None is NaN."""
    scipy.io.savemat(path, {title: np.array(column, dtype=float) for title, column in columns.items()})


WRITERS: dict[str, Callable[[Path, dict[str, Any]], None]] = {
    "csv": as_csv,
    "json": as_json,
    "parquet": as_parquet,
    "mat": as_matlab,
}


def drives(*axes: str, sides: tuple[str, ...] = ("left", "right")) -> dict[str, Drive]:
    """Of wings with hinges about these axes."""
    wings = [
        {**wing, "hinge": None, "hinges": [{"position_m": [0.0, 0.4, 0.0], "axis": axis} for axis in axes]}
        for wing in EXAMPLE_AIRCRAFT["surfaces"]
        if wing["side"] in sides
    ]
    return Aircraft.parse({**EXAMPLE_AIRCRAFT, "surfaces": wings}).drives


@pytest.fixture(params=WRITERS)
def written(request: pytest.FixtureRequest, tmp_path: Path) -> Callable[..., Path]:
    """Writes a flight with these columns beside time and attitude, in each format."""

    def write(**columns: Any) -> Path:
        path = tmp_path / f"flight.{request.param}"
        WRITERS[request.param](path, {**ATTITUDE, **{name: list(item) for name, item in columns.items()}})
        return path

    return write


def message(path: Path, of: dict[str, Drive]) -> str:
    """What is said and hinted of a sample."""
    with pytest.raises(InvalidInput) as caught:
        load_sample(path, drives=of)
    assert str(path) in caught.value.message
    return f"{caught.value.message} {caught.value.hint}"


def test_a_drives_unit_is_converted_whatever_its_name(written: Callable[..., Path]) -> None:
    """Degrees, milliradians and radians of a fold, a skew hinge and a word of both sides."""
    path = written(fold_left_deg=FOLD_DEG, cant_left_mrad=1000.0 * T, elevator=T)
    found = read_flight(path).drives
    assert list(found) == ["fold_left", "cant_left", "elevator"]
    for name, angles in {"fold_left": np.deg2rad(FOLD_DEG), "cant_left": T, "elevator": T}.items():
        np.testing.assert_allclose(found[name], angles, rtol=1e-14)


@pytest.mark.parametrize("columns", [{}, {"q": T, "tip_left_z": T, "vx": T, "temp_s": T}])
def test_a_flight_in_which_nothing_moves_is_refused(
    written: Callable[..., Path], columns: dict[str, Any]
) -> None:
    """Attitude and channels alone: today's error, and that other drives go by their names."""
    with pytest.raises(InvalidInput) as caught:
        read_flight(written(**columns))
    assert "there is no column sweep_left, sweep_right" in caught.value.message
    assert "other drives" in caught.value.hint


def test_a_sample_keeps_the_columns_of_its_aircraft(written: Callable[..., Path]) -> None:
    """Others are left out, in files as ever; a word that nobody measured is not there."""
    path = written(fold_left_deg=FOLD_DEG, fold_right_deg=FOLD_DEG, throttle=T, command=T)
    sample = load_sample(path, drives=drives("z", "x"))
    assert list(sample.drives) == ["fold_left", "fold_right"]
    assert sample.sweep_left_rad is None
    np.testing.assert_allclose(sample.drives["fold_left"], np.deg2rad(FOLD_DEG), rtol=1e-14)


def test_sweep_of_old_is_the_only_hinge_of_a_side(written: Callable[..., Path]) -> None:
    """For wings that fold it is the fold; where a wing also sweeps, the names count, and no guess."""
    old = written(sweep_left=T, sweep_right=2.0 * T)
    assert list(load_sample(old, drives=drives("x")).drives) == ["sweep_left", "sweep_right"]
    said = message(old, drives("x", "y"))
    assert "could mean several drives: fold_left, incidence_left" in said
    assert "fold, incidence for both sides" in said
    assert list(load_sample(old, drives=drives("z", "x")).drives) == ["sweep_left", "sweep_right"]
    both = written(sweep_left=T, sweep_right=T, fold_left=T, fold_right=T)
    assert list(load_sample(both, drives=drives("x")).drives) == ["fold_left", "fold_right"]


def test_a_name_counts_before_a_word(written: Callable[..., Path]) -> None:
    """A commanded `sweep` beside the measured sides is another column, as ever."""
    sample = load_sample(written(sweep=2.0 * T, sweep_left=T, sweep_right=T), drives=drives("z"))
    assert list(sample.drives) == ["sweep_left", "sweep_right"]
    assert list(load_sample(written(sweep=T), drives=drives("z")).drives) == ["sweep"]


def test_what_is_said_helps(written: Callable[..., Path]) -> None:
    """No drive's name, one side alone, a broken cell, two columns of one drive: names and the way out."""
    folding = drives("x")
    said = message(written(wing_angle_deg=FOLD_DEG, flap=T), folding)
    assert "wing_angle, flap" in said
    assert "fold_right, fold_left (or fold for both sides)" in said
    assert "_deg" in said
    said = message(written(fold_left_deg=FOLD_DEG, other=T), folding)
    assert "fold_left is given, and fold_right is missing" in said
    assert "name the single column fold" in said
    broken = [*T[:7], None, *T[8:]]
    said = message(written(sweep_left=T, sweep_right=T, fold_left=T, fold_right=broken), drives("z", "x"))
    assert "fold_right" in said
    assert "not a finite number" in said
    assert "7" in said or "line 9" in said
    assert load_sample(written(sweep_left=T, sweep_right=T, fold_right=broken), drives=drives("z"))
    said = message(written(fold_left=T, fold_right_deg=T, fold_right=T), folding)
    assert "both give fold_right" in said


def test_degrees_without_their_unit_are_guessed(written: Callable[..., Path]) -> None:
    """An angle of 19 rad is no fold; a table of schedules says so by drive and row."""
    path = written(fold=FOLD_DEG)
    (fault,) = load_sample(path, drives=drives("x")).drive_faults(drives("x"))
    assert (fault.code, fault.pointer) == ("angle_out_of_range", "/fold_rad/2")
    with pytest.raises(InvalidInput) as caught:
        load_schedules(path).by_drive(drives("x"))
    assert "name it fold_deg" in caught.value.message


def test_a_table_moves_the_drives_of_its_columns(written: Callable[..., Path]) -> None:
    """Both sides by a word, one by its name; what is no drive is left alone, and none at all refused."""
    path = written(fold_deg=FOLD_DEG, sweep_left=T, throttle=T)
    schedules = load_schedules(path)
    assert schedules.keys_by_drive(drives("z", "x")) == {
        "fold_right": "fold", "fold_left": "fold", "sweep_left": "sweep_left",
    }  # fmt: skip
    angles: Any = schedules.by_drive(drives("x"))["fold_right"]
    np.testing.assert_allclose(angles.angle_rad, np.deg2rad(FOLD_DEG), rtol=1e-14)
    with pytest.raises(InvalidInput) as caught:
        load_schedules(written(throttle=T)).by_drive(drives("y"))
    assert (caught.value.pointer, str(path) in caught.value.message) == ("/schedules", True)
    assert "throttle" in caught.value.message
    assert "incidence_left" in caught.value.hint


def test_a_row_of_units_counts_for_drives(tmp_path: Path) -> None:
    """As it does for angles of attitude; a unit that is no angle is named where the drive is wanted."""
    path = tmp_path / "flight.csv"
    rows = "".join(f"{t},0,0,0,{10 * t},{t}\n" for t in T)
    path.write_text(f"t,phi,theta,psi,fold,throttle\ns,deg,deg,deg,deg,%\n{rows}")
    found = read_flight(path)
    np.testing.assert_allclose(found.drives["fold"], np.deg2rad(10 * T), rtol=1e-13)
    assert list(found.drives) == ["fold"]
    path.write_text(f"t,phi,theta,psi,fold,throttle\ns,deg,deg,deg,V,%\n{rows}")
    with pytest.raises(InvalidInput):
        load_sample(path, drives=drives("x"))
    path.write_text(f"t,phi,theta,psi,fold [V],sweep\n{rows}")
    assert "The unit of 'fold [V]' is not read" in message(path, drives("x"))


def test_a_wide_logger_file_gives_no_more_than_there_can_be_drives(tmp_path: Path) -> None:
    """Of 200 further columns those with a side come first; what is left out is said where it is wanted."""
    path = tmp_path / "flight.csv"
    as_csv(path, {**ATTITUDE, **{f"c{i}": T for i in range(200)}, "fold_left": T, "fold_right": T})
    found = read_flight(path)
    assert len(found.drives) == MAX_DRIVES
    assert {"fold_left", "fold_right"} <= set(found.drives)
    assert "more than 64" in found.unreadable["c199"].detail


@pytest.mark.parametrize(
    ("title", "meant"),
    [
        ("Fold Left [deg]", ("fold_left", np.pi / 180)),
        ("cant", ("cant", None)),
        ("p_rad_s", None),
        ("q", None),
        ("phi_deg", None),
        ("time_ms", None),
        ("2nd", None),
        ("tip_left_z", None),
        ("alpha_deg", None),
        ("hinge_torque_fold_left", None),
    ],
)
def test_titles_that_could_be_drives(title: str, meant: tuple[str, float | None] | None) -> None:
    """Names of hinges with or without the unit of an angle, and no known channel."""
    assert drive_meant(title) == meant
