"""Numbers and pictures as the report shows them."""

from __future__ import annotations

import re
from html import escape
from typing import Any

from morphcore.export.figure import scientific

NOTHING = "–"
STILL_RAD = 1e-10
SMALL, LARGE = 1e-3, 1e5  # larger numbers are written with a power of ten


def prettified(text: str) -> str:
    """A sentence of the library with typeset powers of ten."""
    shown = re.sub(r"\b\d\.?\d*e-\d+\b", lambda found: number(float(found[0]), 2), text)
    return shown.replace("rad^2", "rad²")


def inline_svg(svg: bytes, prefix: str, label: str) -> str:
    """An SVG document as an element of a page: no prologue, no metadata, ids with a prefix of their own.

    ``label`` is for screen readers.
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
    # the page sets the width; the viewBox keeps the aspect ratio
    tag = re.sub(r'\s(width|height|version)="[^"]*"', "", tag)
    return f'{tag} role="img" aria-label="{escape(label)}">{rest}'


def number(value: Any, digits: int = 3) -> str:
    """A number with ``digits`` digits; a dash for None."""
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
    """An angle in mrad; the round-off of an angle that does not move is shown as zero."""
    if value_rad is not None and abs(value_rad) < STILL_RAD:
        return "0"
    return NOTHING if value_rad is None else number(1e3 * value_rad, digits)


def percent(share: float | None, digits: int = 2) -> str:
    """A share as a percentage."""
    return NOTHING if share is None else f"{number(100.0 * share, digits)} %"


def signed_percent(value_percent: float | None) -> str:
    """A change in per cent with sign."""
    return NOTHING if value_percent is None else f"{value_percent:+.2f} %".replace("-", "−")


def minutes(value_s: float) -> str:
    """A time in minutes."""
    return f"{value_s:.0f} s" if value_s < 120.0 else f"{value_s / 60.0:.1f} min"


def _exponent(size: float) -> int:
    return int(f"{size:e}".split("e")[1])
