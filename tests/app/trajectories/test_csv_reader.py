"""Laws of reading flights from CSV text."""

from __future__ import annotations

import io
import math

import pytest

from app.errors import InvalidRequest
from app.schemas.fields import MAX_ROWS
from app.trajectories.csv_reader import read_csv

PLAIN = "t,sweep_left,sweep_right,phi,theta,psi\n0,0,0.5,0,0.1,0\n0.01,0,0.6,0,0.2,0\n"


def read(text: str) -> dict[str, list[float]]:
    """Read a text as an uploaded file is read."""
    return read_csv(io.StringIO(text))


def test_units_in_names_mean_the_same_flight() -> None:
    """The same flight in degrees, milliradians and milliseconds, with other columns about, reads the same."""
    degrees = 180.0 / math.pi
    titles = " T_ms ;sweep_left_deg;x;Sweep Right [rad];phi(deg);theta_mrad;psi_rad".replace(";", ",")
    rows = [f"{10 * i},0,junk,{0.5 + 0.1 * i!r},{0 * degrees},{100 + 100 * i},0" for i in range(2)]
    plain, other = read(PLAIN), read("\n".join([titles, *rows]))
    assert plain.keys() == other.keys()
    for name, column in plain.items():
        assert other[name] == pytest.approx(column, abs=1e-15)


def test_degrees_become_radians() -> None:
    """180 degrees are pi."""
    text = PLAIN.replace("theta", "theta_deg").replace(",0.1,", ",180,")
    assert read(text)["theta_rad"][0] == pytest.approx(math.pi, rel=1e-15)


def test_windows_files_and_blank_lines_are_read() -> None:
    """A byte order mark, CRLF, quotes and blank lines change nothing."""
    text = "\ufeff" + PLAIN.replace("\n", "\r\n").replace("0.5", '"0.5"') + "\r\n  ,,,,,\r\n\r\n"
    assert read(text) == read(PLAIN)


@pytest.mark.parametrize(
    ("text", "code", "pointer"),
    [
        ("", "empty_file", "/file"),
        (PLAIN.replace("psi", "heading"), "missing", "/file/titles"),
        (PLAIN.replace("psi", "theta_deg"), "column_twice", "/file/titles"),
        (PLAIN.replace("theta", "theta_furlong"), "missing", "/file/titles"),
        (PLAIN.replace("0.2", "nan"), "finite_number", "/file/1/theta"),
        (PLAIN.replace("0.2", "1e999"), "finite_number", "/file/1/theta"),
        (PLAIN.replace("0.2", "=1+1"), "finite_number", "/file/1/theta"),
        (PLAIN.replace(",0.2,0", ""), "finite_number", "/file/1/theta"),
        ("t," * 300 + "\n", "too_many_columns", "/file"),
        ("x" * 30_000, "line_too_long", "/file"),
        ('t,"' + "\n" * 200_000, "not_csv", "/file"),
        (PLAIN + "1,0,0,0,0,0\n" * MAX_ROWS, "too_many_rows", "/file"),
    ],
)
def test_bad_files_are_refused_by_place(text: str, code: str, pointer: str) -> None:
    """Whatever is wrong with a file is told with its place and a way out."""
    with pytest.raises(InvalidRequest) as caught:
        read(text)
    fault = caught.value.faults[0]
    assert (fault.code, fault.pointer) == (code, pointer)
    assert fault.hint
