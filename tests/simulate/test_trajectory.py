"""Sample flights: units in column names, inline documents, and errors that name the row."""

from __future__ import annotations

import numpy as np
import pytest

from morphcore.errors import InvalidInput
from morphcore.simulate.trajectory import Trajectory, load_trajectory
from morphdata.samples import InlineSample
from tests.models.chains import EXAMPLES

HEADER = "t,sweep_left,sweep_right,phi,theta,psi"
ROWS = ["0,0,0,0,0.1,0", "0.1,0.1,0.2,0.01,0.1,0", "0.2,0.2,0.4,0.02,0.1,0"]


def document(**changes):
    """A sample of three rows as in the HTTP API."""
    column = [0.0, 0.1, 0.2]
    return {
        "name": "one",
        "time_s": [0.0, 0.01, 0.02],
        **{f"{name}_rad": list(column) for name in ("sweep_left", "sweep_right", "phi", "theta", "psi")},
    } | changes


def written(folder, header, rows):
    """A CSV file."""
    path = folder / "flight.csv"
    path.write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
    return path


def test_examples_are_read():
    """The samples have ten milliseconds a row, sweeps of both sides, and further columns kept aside."""
    flown = load_trajectory(EXAMPLES / "train_asymmetric.csv")
    assert flown.name == "train_asymmetric"
    np.testing.assert_allclose(np.diff(flown.time_s), 0.01, atol=1e-9)
    assert flown.sweep_right[-1] == pytest.approx(0.6, abs=1e-6)
    assert flown.sweep_left[-1] == pytest.approx(0.5, abs=1e-6)
    assert flown.euler.shape == (flown.time_s.size, 3)
    assert {"p", "q", "r", "tip_left_z"} <= set(flown.extra)
    assert flown.duration_s == pytest.approx(flown.time_s[-1])


def test_units_in_column_names(tmp_path):
    """Degrees and milliseconds are converted once, here."""
    header = "time_ms,sweep_left_deg,sweep_right_deg,phi_deg,theta_rad,psi,note"
    rows = ["0,0,0,0,0.1,0,7", "100,9,18,90,0.1,0,8", "200,18,36,180,0.1,0,9"]
    flown = load_trajectory(written(tmp_path, header, rows))
    np.testing.assert_allclose(flown.time_s, [0.0, 0.1, 0.2])
    np.testing.assert_allclose(flown.phi, [0.0, np.pi / 2, np.pi])
    np.testing.assert_allclose(flown.sweep_right, np.array([0.0, 0.1, 0.2]) * np.pi)
    np.testing.assert_allclose(flown.theta, 0.1)
    np.testing.assert_array_equal(flown.extra["note"], [7.0, 8.0, 9.0])


def test_read_trajectories_are_read_only(tmp_path):
    """Values are values."""
    flown = load_trajectory(written(tmp_path, HEADER, ROWS))
    with pytest.raises(ValueError, match="read-only"):
        flown.theta[0] = 1.0


@pytest.mark.parametrize(
    ("header", "rows", "said"),
    [
        (HEADER.replace(",psi", ",heading"), ROWS, "psi"),
        (HEADER, [ROWS[0], ROWS[1].replace("0.2", "fast"), ROWS[2]], "fast"),
        (HEADER, [ROWS[0], ROWS[1] + ",1", ROWS[2]], "flight.csv"),
        (HEADER + ",x", ROWS, "line 2: .* cells under"),
        (HEADER, [ROWS[0], ROWS[2], ROWS[1]], "row 2"),
        (HEADER, [ROWS[0], ROWS[1].replace("0.01", "nan"), ROWS[2]], "line 3: phi is .nan., not"),
        (HEADER, ROWS[:2], "2 rows"),
        (HEADER, [], "no rows"),
    ],
)
def test_broken_files_are_refused_with_the_place(tmp_path, header, rows, said):
    """A missing column, a word, a long row, falling time, NaN, too few rows: the message says where."""
    with pytest.raises(InvalidInput, match=said) as caught:
        load_trajectory(written(tmp_path, header, rows))
    assert caught.value.hint


def test_a_file_that_is_not_there(tmp_path):
    """No traceback of the file system."""
    with pytest.raises(InvalidInput, match="does not exist"):
        load_trajectory(tmp_path / "nowhere.csv")


def test_documents():
    """Inline samples are read with their role and weight."""
    flown = Trajectory.of(InlineSample.parse(document(role="held_out", weight=2.0), "/samples/0"))
    assert (flown.role, flown.weight, flown.name) == ("held_out", 2.0, "one")
    np.testing.assert_array_equal(flown.sweep_left, [0.0, 0.1, 0.2])


@pytest.mark.parametrize(
    ("changes", "pointer"),
    [
        ({"theta_rad": [0.0, 0.1]}, "/samples/0/theta_rad"),
        ({"theta_rad": [0.0, float("nan"), 0.1]}, "/samples/0/theta"),
        ({"time_s": [0.0, 0.02, 0.01]}, "/samples/0/time_s/2"),
        ({"time_s": [0.0, 0.0, 0.01]}, "/samples/0/time_s/1"),
        ({"role": "spare"}, "/samples/0/role"),
        ({"weight": -1.0}, "/samples/0/weight"),
        ({"theta_deg": [1.0, 2.0, 3.0]}, "/samples/0/theta_deg"),
    ],
)
def test_broken_documents_point_to_the_field(changes, pointer):
    """Unequal lengths, NaN, falling time, unknown words and fields: a JSON pointer to the place."""
    with pytest.raises(InvalidInput) as caught:
        InlineSample.parse(document(**changes), "/samples/0")
    assert caught.value.pointer.startswith(pointer)
