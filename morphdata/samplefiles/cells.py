"""What stands in a cell of a text table: a number with a decimal point or comma, or a moment of a clock."""

from __future__ import annotations

import math
import re
from datetime import datetime
from decimal import Decimal

from morphdata.samplefiles.fault import FileFault, shown
from morphdata.samplefiles.flight import counts_from_epoch

THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2},\d{3}")  # 1,234 is 1.234 or 1234


class Numbers:
    """Reads numbers and notes their decimal mark: it is one and the same in a table, or nobody can tell.

    >>> numbers = Numbers()
    >>> numbers.read("0,5"), numbers.comma, numbers.point
    (0.5, '0,5', '')
    """

    def __init__(self) -> None:
        self.point = self.comma = ""  # the first cell of each kind
        self.proven = False  # whether some comma cannot part thousands

    def read(self, cell: str) -> float:
        """The number in a cell; NaN for all else (``1_000`` is a number in Python, not in a table).

        Raises
        ------
        FileFault : there were numbers with the other decimal mark.
        """
        text = self.pointed(cell)
        try:
            value = math.nan if "_" in text else float(text)
        except ValueError:
            return math.nan
        if "," in cell:
            self.comma = self.comma or cell.strip()
            self.proven = self.proven or not THOUSANDS.fullmatch(cell.strip())
        elif "." in cell:
            self.point = self.point or cell.strip()
        if self.comma and self.point:
            raise FileFault(
                "ambiguous_decimals",
                f"there are numbers with a point, {shown(self.point)}, and with a comma, {shown(self.comma)}",
                "write the decimals of all numbers alike, and no marks between thousands",
            )
        return value

    @staticmethod
    def pointed(cell: str) -> str:
        """The cell with a decimal point."""
        return cell.replace(",", ".", 1)

    def require_decimals(self) -> None:
        """Raise FileFault where every comma may part thousands."""
        if self.comma and not self.proven:
            raise FileFault(
                "ambiguous_decimals",
                f"{shown(self.comma)} may be {self.pointed(self.comma)} or {self.comma.replace(',', '')}",
                "write decimals with a point, and no marks between thousands",
            )


class Clock:
    """Reads the times of a table, s: numbers, or dates (ISO 8601), which count from the first row.

    Parameters
    ----------
    factor : of numbers, to s.
    numbers : reader of the numbers, which may count from an epoch.
    """

    def __init__(self, factor: float, numbers: Numbers) -> None:
        self._factor, self._numbers = factor, numbers
        self._first: datetime | Decimal | None = None
        self._begun = False

    def read(self, cell: str) -> float:
        """The time in a cell, s; NaN for none."""
        begins, self._begun = not self._begun, True
        if ":" in cell:
            moment = _moment(cell)
            if begins:
                self._first = moment
            both = moment if isinstance(self._first, datetime) else None
            return math.nan if both is None else _seconds_between(self._first, both)
        value = self._numbers.read(cell)
        if begins and counts_from_epoch(value, self._factor):
            self._first = Decimal(Numbers.pointed(cell).strip())
        if isinstance(self._first, datetime) or not math.isfinite(value):
            return math.nan
        if self._first is None:
            return value * self._factor
        # digits of a date and of its fraction of a second do not fit into one float
        return float(Decimal(Numbers.pointed(cell).strip()) - self._first) * self._factor


def _moment(cell: str) -> datetime | None:
    try:
        return datetime.fromisoformat(cell.strip())
    except ValueError:
        return None


def _seconds_between(first: datetime | Decimal | None, moment: datetime) -> float:
    try:
        return (moment - first).total_seconds()  # type: ignore[operator]
    except TypeError:  # one with a time zone, one without
        return math.nan
