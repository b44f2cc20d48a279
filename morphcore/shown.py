"""Display of values at a prompt and in a notebook: a title and facts, and a short table."""

from __future__ import annotations

import dataclasses
import html
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

MAX_ROWS = 20  # rows of a table, and facts; the rest is only counted
WIDEST = 88  # characters of a fact
FEW = 4  # arrays up to this size are written out

Rows = Sequence[Sequence[Any]]


@dataclass(frozen=True)
class Summary:
    """The displayed contents.

    facts : names and values. titles, rows : of the table below. notes : sentences at the end.
    """

    title: str
    facts: Mapping[str, Any] = field(default_factory=dict)
    titles: Sequence[str] = ()
    rows: Rows = ()
    notes: Sequence[str] = ()

    def to_text(self) -> str:
        """The summary as lines of text."""
        facts = [(name, brief(value)) for name, value in self.facts.items()][:MAX_ROWS]
        width = max((len(name) for name, _ in facts), default=0)
        lines = [self.title, *(f"  {name.ljust(width)}  {value}" for name, value in facts)]
        table = [list(self.titles), *_cells(self.rows)] if self.titles else []
        widths = [max(map(len, column)) for column in zip(*table, strict=True)]
        lines += [
            "  " + "  ".join(cell.rjust(w) for cell, w in zip(row, widths, strict=True)) for row in table
        ]
        return "\n".join([*lines, *self._rest()])

    def to_html(self) -> str:
        """The summary as HTML tables."""

        def row(cells: Sequence[str], tag: str) -> str:
            return "<tr>" + "".join(f"<{tag}>{html.escape(cell)}</{tag}>" for cell in cells) + "</tr>"

        parts = [f"<p><b>{html.escape(self.title)}</b></p>"]
        facts = [(name, brief(value)) for name, value in self.facts.items()][:MAX_ROWS]
        parts += ["<table>", *(row(fact, "td") for fact in facts), "</table>"] if facts else []
        if self.titles:
            parts += [
                "<table>",
                row(self.titles, "th"),
                *(row(r, "td") for r in _cells(self.rows)),
                "</table>",
            ]
        return "".join([*parts, *(f"<p>{html.escape(line.strip())}</p>" for line in self._rest())])

    def _rest(self) -> Iterator[str]:
        if len(self.rows) > MAX_ROWS:
            yield f"  ... and {len(self.rows) - MAX_ROWS} more rows"
        yield from (f"  {shortened(note)}" for note in self.notes[:FEW])


class Shown:
    """A dataclass (with ``repr=False``) that displays a summary instead of all its numbers."""

    def summary(self) -> Summary:
        """The displayed contents: each field in one line."""
        fields = [item for item in dataclasses.fields(self) if item.repr]  # type: ignore[arg-type]
        return Summary(type(self).__name__, {item.name: getattr(self, item.name) for item in fields})

    def __repr__(self) -> str:
        return self.summary().to_text()

    def _repr_html_(self) -> str:
        return self.summary().to_html()


def brief(value: Any) -> str:
    """A value in brief: arrays by shape and range, objects by name.

    >>> brief(np.arange(100.0)), brief({"phi": 0.123456, "theta": None}), brief(0.1 + 0.2)
    ('(100,) from 0 to 99', 'phi 0.1235, theta -', '0.3')
    """
    if value is None:
        return "-"
    if isinstance(value, float | np.floating):
        return f"{value:.4g}"
    if isinstance(value, np.ndarray):
        text = _array(value)
    elif isinstance(value, Mapping):
        text = ", ".join(f"{name} {brief(item)}" for name, item in value.items()) or "-"
    elif isinstance(value, list | tuple):
        text = ", ".join(map(brief, value)) or "-"
    elif dataclasses.is_dataclass(value):
        text = str(getattr(value, "name", type(value).__name__))
    else:
        text = str(value)
    return shortened(text)


def shortened(text: str) -> str:
    """Shorten to one line of limited width."""
    line = " ".join(text.split())
    return line if len(line) <= WIDEST else f"{line[: WIDEST - 3]}..."


def _array(values: np.ndarray[Any, Any]) -> str:
    if values.size <= FEW:
        return (
            str(values.tolist()) if values.dtype.kind != "f" else f"[{', '.join(map(brief, values.ravel()))}]"
        )
    if values.dtype.kind not in "fiu":
        return f"{values.shape} of {values.dtype}"
    finite = values[np.isfinite(values)]
    within = f" from {brief(finite.min())} to {brief(finite.max())}" if finite.size else " of NaN"
    return f"{values.shape}{within}"


def _cells(rows: Rows) -> list[list[str]]:
    return [[brief(cell) for cell in row] for row in rows[:MAX_ROWS]]
