"""Tables as CSV text that no spreadsheet takes for a program."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable
from typing import TextIO

# what a spreadsheet runs as a formula when a cell begins with it, in full width too
FORMULA_STARTS = frozenset("=+-@＝＋－＠")
CONTROL = re.compile(r"[\x00-\x1f\x7f\x85\u2028\u2029]")  # a line end inside a cell may begin a new row


def neutral(cell: str) -> str:
    """A cell as text: one that would be run begins with an apostrophe instead; numbers stay as they are.

    Control characters become blanks.

    >>> [neutral(cell) for cell in ("theta", "-1.5", "=1+1", "-1+1", " @SUM(A1)")]
    ['theta', '-1.5', "'=1+1", "'-1+1", "' @SUM(A1)"]
    """
    cell = CONTROL.sub(" ", cell)
    if cell.lstrip(" ")[:1] not in FORMULA_STARTS:
        return cell
    try:
        float(cell)
    except ValueError:
        return f"'{cell}"
    return cell


def write_table(stream: TextIO, titles: Iterable[str], rows: Iterable[Iterable[str]]) -> None:
    """Write a title line and rows of cells; names that strangers chose may be among them."""
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(map(neutral, titles))
    writer.writerows(map(neutral, row) for row in rows)
