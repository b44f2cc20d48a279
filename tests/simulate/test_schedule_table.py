"""Schedules in CSV files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from morphcore.errors import InvalidInput
from morphcore.simulate.schedule import Hold, Spline, scheduled
from morphcore.simulate.schedule_table import write_schedule_csv
from morphcore.simulate.trajectory import load_trajectory
from morphdata.drives import SIDES
from morphdata.schedules import load_schedules


def read(path: Path) -> dict[str, Any]:
    """The motion of each side's hinge."""
    found = load_schedules(path).given
    return {side: scheduled(found[f"sweep_{side}"]) for side in SIDES if f"sweep_{side}" in found}


def test_a_sample_flight_is_a_schedule(examples: Path) -> None:
    """The schedule of a sample flight is that flight's sweep; its other columns are not looked at."""
    path = examples / "train_asymmetric.csv"
    schedule, flight = read(path), load_trajectory(path)
    for side in ("left", "right"):
        np.testing.assert_array_equal(schedule[side].time_s, flight.time_s)
        np.testing.assert_array_equal(schedule[side].angle_rad, flight.drives[f"sweep_{side}"])


def test_units_stand_in_the_names(tmp_path: Path) -> None:
    """Milliseconds and degrees are converted; text in other columns and a byte order mark do no harm."""
    path = tmp_path / "s.csv"
    path.write_text(
        "time_ms,note,sweep_left_deg,sweep_right_deg\n0,a,0,0\n500,b,90,-90\n1000,,180,0\n",
        encoding="utf-8-sig",
    )
    schedule = read(path)
    np.testing.assert_allclose(schedule["left"].time_s, [0.0, 0.5, 1.0])
    np.testing.assert_allclose(schedule["left"].angle_rad, [0.0, np.pi / 2, np.pi])
    np.testing.assert_allclose(schedule["right"].angle_rad, [0.0, -np.pi / 2, 0.0])


def test_a_written_schedule_is_read_back(tmp_path: Path) -> None:
    """A spline sampled every 10 ms and read back moves the hinge alike.

    The interpolation is off by 2e-6 rad next to the end, where the acceleration jumps by 3 rad/s^2; a
    straight line between two rows would be off by (10 ms)^2 / 8 * 3 rad/s^2 = 4e-5 rad there.
    """
    spline = Spline(np.array([0.0, 0.7, 1.4, 2.0]), np.array([0.0, 0.2, 0.9, 1.0]))
    path = tmp_path / "s.csv"
    write_schedule_csv({"sweep_left": Hold(0.1), "sweep_right": spline}, 0.01 * np.arange(251), path)
    schedule = read(path)
    times = np.linspace(0.0, 2.5, 1717)
    np.testing.assert_allclose(
        schedule["right"].motion(times).angle, spline.motion(times).angle, rtol=0.0, atol=5e-6
    )
    np.testing.assert_array_equal(schedule["left"].motion(times).angle, 0.1)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "the file is empty"),
        ("t,sweep_left,sweep_right\n", "holds no rows"),
        ("t\n0\n1\n2\n", "no column sweep_left, sweep_right"),
        ("t,theta,q\n0,0,0\n1,0,0\n2,0,0\n", "no column sweep_left, sweep_right"),
        ("t,sweep_left,sweep_right\n0,0,0\n1,0,x\n2,0,0\n", "line 3: sweep_right is 'x'"),
        ("t,sweep_left,sweep_right\n0,0,0\n1,0,nan\n2,0,0\n", "line 3: sweep_right is 'nan'"),
        ("t,sweep_left,sweep_right\n0,0,0\n\n2,0,0\n1,0,0\n", "line 5: time does not increase"),
        ("t,sweep_left,sweep_right\n0,0,0\n1,0\n", "line 3: 2 cells under 3 titles"),
        ("t,sweep_left,sweep_right\n0,0,0\n1,0,0\n", "holds 2 rows"),
    ],
)
def test_a_bad_schedule_is_refused_with_its_line(tmp_path: Path, text: str, words: str) -> None:
    """What is wrong in a schedule is said with the file, the line and a way out."""
    path = tmp_path / "s.csv"
    path.write_text(text)
    with pytest.raises(InvalidInput, match=words) as caught:
        load_schedules(path)
    assert str(path) in caught.value.message
    assert caught.value.hint


def test_a_missing_schedule_is_named(tmp_path: Path) -> None:
    """A file that is not there, or is not text, is named."""
    with pytest.raises(InvalidInput, match=r"nowhere\.csv does not exist"):
        load_schedules(tmp_path / "nowhere.csv")
    (tmp_path / "binary.csv").write_bytes(b"\xff\xfe\x00t")
    with pytest.raises(InvalidInput, match=r"binary\.csv: this is not CSV text"):
        load_schedules(tmp_path / "binary.csv")
