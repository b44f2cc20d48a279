"""Laws of the tables that loggers, spreadsheets and programs write: one flight in many dresses."""

from __future__ import annotations

import io
import math

import pytest

from morphdata.samplefiles.columns import FlightColumns, Wanted
from morphdata.samplefiles.csv_text import read_csv
from morphdata.samplefiles.fault import FileFault
from morphdata.samplefiles.titles import FLIGHT, meaning

TITLES = "t,sweep_left,sweep_right,phi,theta,psi"
ROWS = ["0,0.1,-0.25,0,0.5,1e-3", "0.01,0.1234,-0.5,0,0.75,2E-3", "0.02,1.5,12.125,0,1.25,-3e-3"]
PLAIN = "\n".join([TITLES, *ROWS]) + "\n"


def read(text: str | bytes, *, others: bool = False) -> FlightColumns:
    """Read a text as a file is read."""
    data = text.encode() if isinstance(text, str) else text
    return read_csv(io.BytesIO(data), Wanted(others=others))


def european(text: str, delimiter: str) -> str:
    """The text with decimal commas, and another mark between its cells."""
    return text.replace(",", delimiter).replace(".", ",")


def quoted(text: str) -> str:
    """The text with decimal commas, its cells in quotes and commas between them."""
    lines = [
        ",".join(f'"{cell}"' for cell in line.replace(".", ";").split(",")) for line in text.splitlines()
    ]
    return "\n".join(lines).replace(";", ",")


DRESSES = {
    "semicolons": PLAIN.replace(",", ";"),
    "tabs": PLAIN.replace(",", "\t"),
    "decimal commas between semicolons": european(PLAIN, ";"),
    "decimal commas between tabs": european(PLAIN, "\t"),
    "decimal commas in quotes": quoted(PLAIN),
    "a line for spreadsheets": "sep=;\r\n" + european(PLAIN, ";"),
    "comment with #": "# by logger, v3; SI\n" + PLAIN,
    "comment with %": "% exported by logger\n" + PLAIN,
    "comment with //": "// exported by logger\n\n// and again\n" + PLAIN,
    "comment with ;": "; exported by logger\n" + PLAIN,
    "comment with ; above semicolons": "; exported by logger\n" + PLAIN.replace(",", ";"),
    "comment in quotes": '"# exported, by logger"\n' + PLAIN,
    "comments amid the rows": PLAIN.replace("\n0.01", "\n# lost contact\n\n0.01") + "% end\n",
    "titles in a comment": "# run 7\n# " + PLAIN,
    "a byte order mark above a comment": "\ufeff# by logger\n" + PLAIN,
    "a row of units": PLAIN.replace(TITLES, f"{TITLES}\ns,rad,rad,rad,rad,rad"),
    "a row of units in brackets": PLAIN.replace(TITLES, f"{TITLES}\n[s],[rad],[rad],(rad),,-"),
    "an unnamed index between semicolons": "\n".join(
        f"{mark};{line.replace(',', ';')}" for mark, line in zip(["", *"012"], [TITLES, *ROWS], strict=True)
    ),
    "a title over two lines": PLAIN.replace("theta", '"theta\n[rad]"'),
}


@pytest.mark.parametrize("dress", DRESSES)
def test_every_dress_gives_the_same_flight(dress: str) -> None:
    """Marks between cells, decimal marks, comments and units tell how to read a table, not what it says."""
    assert read(DRESSES[dress]).values == read(PLAIN).values


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "latin-1"])
def test_every_encoding_gives_the_same_flight(encoding: str) -> None:
    """UTF-16 with its mark is read as UTF-8 is; a sign of degree may be a byte of Latin-1."""
    text = PLAIN.replace("phi", "phi [°]")
    assert read(text.encode(encoding)).values == read(PLAIN).values


def test_a_row_of_units_converts() -> None:
    """Milliseconds and degrees below the titles are those of the columns."""
    text = f"{TITLES}\nms,rad,rad,°,deg,[deg]\n0,0,0,180,45,90\n10,0,0,0,0,0\n"
    values = read(text).values
    assert list(values["t"]) == [0.0, 0.01]
    assert [values[name][0] for name in ("phi", "theta", "psi")] == pytest.approx(
        [math.pi, math.pi / 4, math.pi / 2], rel=1e-15
    )


@pytest.mark.parametrize(
    ("title", "name", "factor"),
    [
        ("theta [deg]", "theta", math.pi / 180),
        ("theta (°)", "theta", math.pi / 180),
        ("phi/deg", "phi", math.pi / 180),
        ("phi / °", "phi", math.pi / 180),
        ("Psi in degrees", "psi", math.pi / 180),
        ("theta, deg", "theta", math.pi / 180),
        ("sweep left [mrad]", "sweep_left", 1e-3),
        ("t [ms]", "t", 1e-3),
        ("time_s", "t", 1.0),
        ("time (µs)", "t", 1e-6),
        ("t/ns", "t", 1e-9),
        ("Time {sec}", "t", 1.0),
        ("theta <rad>", "theta", 1.0),
        ("theta", "theta", None),
    ],
)
def test_units_in_titles(title: str, name: str, factor: float | None) -> None:
    """A unit stands behind a mark, in brackets of any kind, or as a sign of degree."""
    assert meaning(title, FLIGHT) == (name, factor)


@pytest.mark.parametrize("title", ["theta_furlong", "t [deg]", "phi [ms]", "thetas", "x", "t_s since start"])
def test_other_titles_mean_other_columns(title: str) -> None:
    """A unit that is none of the column's makes it another column."""
    assert meaning(title, FLIGHT) is None


@pytest.mark.parametrize(
    ("text", "code", "line", "said"),
    [
        (PLAIN.replace(",", ";").replace("0.1;", "0,1;"), "ambiguous_decimals", 2, "0,1"),
        ("t;sweep_left;sweep_right;phi;theta;psi\n1,234;0;0;0;0;0\n", "ambiguous_decimals", None, "1.234 or"),
        (european(PLAIN, ","), "uneven_row", 2, "semicolons"),
        (european(PLAIN, ";").replace("1,5", "1.234,5"), "finite_number", 4, "1.234,5"),
        (PLAIN.replace(TITLES, f"{TITLES}\ns,rad,rad,rad,furlong,rad"), "unknown_unit", 2, "furlong"),
        (PLAIN.replace(TITLES, f"{TITLES}_deg\ns,,,,,rad"), "two_units", 2, "psi_deg"),
        (PLAIN.replace("theta", "theta [grad]"), "missing", None, "unit of 'theta [grad]'"),
        ("# Created by Octave 8.4.0, Mon May 01\n# name: t\n 0\n", "octave_text", None, "-v7"),
        ("# only\n% comments\n", "empty_file", None, "title"),
        ("# " + TITLES + "\n", "no_rows", None, "rows"),
    ],
)
def test_what_is_ambiguous_is_refused(text: str, code: str, line: int | None, said: str) -> None:
    """Where two readings are possible or a unit is unknown, the sentence says what stands there."""
    with pytest.raises(FileFault) as caught:
        read(text)
    fault = caught.value
    assert (fault.code, fault.line) == (code, line)
    assert said in f"{fault.detail} {fault.hint}"


def test_commas_in_further_columns_follow_the_table() -> None:
    """A comma that the table's own numbers do not have parts thousands, or nobody knows: that column goes."""
    text = PLAIN.replace("\n", ',"1,5"\n').replace('psi,"1,5"', "psi,q")
    assert read(text, others=True).others == {}
    text = european(text.replace('"1,5"', "1.5"), ";")
    assert list(read(text, others=True).others["q"]) == [1.5] * 3


START = 1_714_564_800
EPOCHS = {
    "t": [f"{START + i // 100}.{i % 100:02}" for i in range(3)],
    "t_ms": [str(START * 10**3 + 10 * i) for i in range(3)],
    "t_us": [str(START * 10**6 + 10_000 * i) for i in range(3)],
    "t [ns]": [str(START * 10**9 + 10_000_000 * i) for i in range(3)],
    "time": [f"2024-05-01T12:00:00.{10 * i:03}Z" for i in range(3)],
}


@pytest.mark.parametrize("title", EPOCHS)
def test_time_since_an_epoch_counts_from_the_first_row(title: str) -> None:
    """Seconds to nanoseconds since 1970 and dates: 0, 10, 20 ms, and no digit is lost on the way."""
    rows = [f"{time},{row.split(',', 1)[1]}" for time, row in zip(EPOCHS[title], ROWS, strict=True)]
    values = read("\n".join([TITLES.replace("t,", f"{title},", 1), *rows])).values["t"]
    assert list(values) == pytest.approx([0.0, 0.01, 0.02], rel=1e-12)


def test_a_clock_that_runs_is_left_alone() -> None:
    """Time that begins late counts on as it is: a recorder had run for an hour."""
    assert list(read(PLAIN.replace("\n0", "\n3600")).values["t"])[:1] == [3600.0]


@pytest.mark.parametrize("second", ["0.01", "2024-05-01T12:00:00.010", "yesterday 10:00"])
def test_dates_and_numbers_do_not_mix(second: str) -> None:
    """A number below a date, a time without zone below one with, and words are no time."""
    text = PLAIN.replace("\n0,", "\n2024-05-01T12:00:00Z,").replace("\n0.01,", f"\n{second},")
    with pytest.raises(FileFault) as caught:
        read(text)
    assert (caught.value.code, caught.value.line) == ("finite_number", 3)
