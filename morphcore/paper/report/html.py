"""Pieces of a page: tables, figures with their SVG inside, paragraphs; all text escaped."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from typing import Any, Literal

from matplotlib.figure import Figure

from morphcore.export.figure import rendered, scientific

NOTHING = "–"
STILL_RAD = 1e-10
SMALL, LARGE = 1e-3, 1e5  # numbers beyond are written with a power of ten


@dataclass(frozen=True)
class Section:
    """A part of the page with a title of its own; ``body`` is HTML."""

    anchor: str
    title: str
    body: str


@dataclass(frozen=True)
class Column:
    """A table's column: numbers stand right, texts left, verdicts ("met", "missed") have a colour."""

    title: str
    kind: Literal["number", "text", "verdict"] = "number"


def words(title: str) -> Column:
    """A column of texts."""
    return Column(title, "text")


def section(anchor: str, title: str, *parts: str) -> Section:
    """Put parts together."""
    return Section(anchor, title, "\n".join(parts))


def paragraph(text: str) -> str:
    """A paragraph of plain text."""
    return f"<p>{escape(text)}</p>"


def prettified(text: str) -> str:
    """A sentence of the library with powers of ten as people write them."""
    shown = re.sub(r"\b\d\.?\d*e-\d+\b", lambda found: number(float(found[0]), 2), text)
    return shown.replace("rad^2", "rad²")


def bullets(items: Sequence[str]) -> str:
    """A list of plain texts."""
    return "<ul>" + "".join(f"<li>{escape(item)}</li>" for item in items) + "</ul>"


def heading(text: str) -> str:
    """A heading inside a section."""
    return f"<h3>{escape(text)}</h3>"


def table(
    name: str,
    caption: str,
    columns: Sequence[Column],
    rows: Sequence[Sequence[str]],
    *,
    note: str = "",
    strong: Sequence[int] = (),
) -> str:
    """A table with its caption above it.

    Parameters
    ----------
    name : "Table 1", or "" for one without a number. rows : cells, plain text. note : stands below.
    strong : numbers of rows that are told apart.
    """
    head = "".join(_cell("th", column, column.title) for column in columns)
    body = "".join(
        f'<tr class="strong">{cells}</tr>' if number in strong else f"<tr>{cells}</tr>"
        for number, row in enumerate(rows)
        for cells in ["".join(_cell("td", c, text) for c, text in zip(columns, row, strict=True))]
    )
    below = f'<p class="note">{escape(note)}</p>' if note else ""
    return (
        f'<div class="table"><table><caption>{_label(name, caption)}</caption>'
        f"<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>{below}</div>"
    )


def figure(anchor: str, name: str, caption: str, drawn: Figure) -> str:
    """A figure with its caption below it; ``anchor`` keeps the ids of its SVG apart from other figures'."""
    svg = rendered(anchor, drawn, ("svg",))[f"{anchor}.svg"]
    return (
        f'<figure id="{escape(anchor)}"><div class="picture">{inline_svg(svg, anchor, caption)}</div>'
        f"<figcaption>{_label(name, caption)}</figcaption></figure>"
    )


def inline_svg(svg: bytes, prefix: str, label: str) -> str:
    """An SVG document as an element of a page: no prologue, no metadata, ids with a prefix of their own.

    ``label`` is for those who do not see it.
    """
    text = svg.decode("utf-8")
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    text = re.sub(r'\sxmlns(:\w+)?="[^"]*"', "", text)
    text = text.replace("xlink:href", "href")
    text = re.sub(r'\bid="([^"]+)"', rf'id="{prefix}-\1"', text)
    text = re.sub(r'href="#([^"]+)"', rf'href="#{prefix}-\1"', text)
    text = re.sub(r"url\(#([^)]+)\)", rf"url(#{prefix}-\1)", text)
    tag, rest = text.split(">", 1)
    # the page rules the width; the shape is in the viewBox
    tag = re.sub(r'\s(width|height|version)="[^"]*"', "", tag)
    return f'{tag} role="img" aria-label="{escape(label)}">{rest}'


# numbers


def number(value: Any, digits: int = 3) -> str:
    """A number with so many digits; a dash for None."""
    if value is None:
        return NOTHING
    if value < 0.0:
        return f"−{number(-value, digits)}"
    if value == 0.0:
        return "0"
    size = abs(float(value))
    if size < SMALL or size >= LARGE:
        return scientific(float(value))
    shown = f"{float(value):.{digits}g}"
    return f"{float(shown):.{max(0, digits - 1 - _exponent(size))}f}"


def milliseconds(value_s: float | None) -> str:
    """A time in ms."""
    return NOTHING if value_s is None else number(1e3 * value_s)


def mrad(value_rad: float | None, digits: int = 2) -> str:
    """An angle in mrad; round-off of one that does not move is nothing."""
    if value_rad is not None and abs(value_rad) < STILL_RAD:
        return "0"
    return NOTHING if value_rad is None else number(1e3 * value_rad, digits)


def percent(share: float | None, digits: int = 2) -> str:
    """A share of one in per cent."""
    return NOTHING if share is None else f"{number(100.0 * share, digits)} %"


def signed_percent(value_percent: float | None) -> str:
    """A change in per cent with its sign."""
    return NOTHING if value_percent is None else f"{value_percent:+.2f} %".replace("-", "−")


def minutes(value_s: float) -> str:
    """A time for people."""
    return f"{value_s:.0f} s" if value_s < 120.0 else f"{value_s / 60.0:.1f} min"


def _exponent(size: float) -> int:
    return int(f"{size:e}".split("e")[1])


def _cell(tag: str, column: Column, text: str) -> str:
    kind = {"number": "", "text": "text", "verdict": text if tag == "td" else ""}[column.kind]
    return f'<{tag} class="{kind}">{escape(text)}</{tag}>' if kind else f"<{tag}>{escape(text)}</{tag}>"


def _label(name: str, caption: str) -> str:
    return f"<b>{escape(name)}.</b> {escape(caption)}" if name else escape(caption)
