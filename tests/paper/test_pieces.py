"""Numbers and pieces of the page."""

from __future__ import annotations

import pytest

from morphcore.paper.report.numbers import (
    inline_svg,
    minutes,
    mrad,
    number,
    percent,
    prettified,
    signed_percent,
)
from morphcore.paper.report.report import templates


@pytest.mark.parametrize(
    ("value", "digits", "shown"),
    [
        (None, 3, "–"),
        (0.0, 3, "0"),
        (0.0684, 3, "0.0684"),
        (14.38, 4, "14.38"),
        (-0.852, 3, "−0.852"),
        (999.9, 3, "1000"),
        (2570.0, 3, "2570"),
        (5e-7, 3, "5.00·10⁻⁷"),
        (3.0, 3, "3.00"),
    ],
)
def test_numbers_have_the_digits_asked_for(value: float | None, digits: int, shown: str) -> None:
    """Plain numbers in reach of the eye, powers of ten beyond, a true minus, a dash for nothing."""
    assert number(value, digits) == shown


def test_units() -> None:
    """Angles in mrad, shares in per cent, changes with their sign, times for people."""
    assert mrad(1.19e-3, 3) == "1.19"
    assert mrad(1e-13) == "0", "round-off of an angle that does not move"
    assert percent(0.0054) == "0.54 %"
    assert signed_percent(-30.364) == "−30.36 %"
    assert signed_percent(4.12) == "+4.12 %"
    assert [minutes(s) for s in (7.4, 119.0, 306.0)] == ["7 s", "119 s", "5.1 min"]


def test_sentences_of_the_library_get_readable_numbers() -> None:
    """Powers of ten and units as people write them; other numbers stay."""
    assert prettified("J = 2.1e-07 rad^2, 0.5 of 3 links") == "J = 2.10·10⁻⁷ rad², 0.5 of 3 links"


def test_a_table_aligns_by_kind() -> None:
    """Texts are marked to stand left, verdicts by what they say; everything is escaped."""
    made = (
        templates()
        .from_string(
            '{% from "pieces.html" import row, table %}'
            '{% call table("a < b", ["name", "x", ""], name="Table 9") %}'
            '{{ row(["<i>", "1", "met"], verdict=2) }}{% endcall %}'
        )
        .render()
    )
    assert "<b>Table 9.</b> a &lt; b" in made
    assert '<td class="text">&lt;i&gt;</td><td>1</td><td class="met">met</td>' in made


def test_an_svg_becomes_an_element_of_the_page() -> None:
    """Prologue, metadata and size go; ids and what refers to them get the prefix."""
    svg = (
        b'<?xml version="1.0"?>\n<!DOCTYPE svg>\n<svg xmlns="http://www.w3.org/2000/svg" '
        b'xmlns:xlink="http://www.w3.org/1999/xlink" width="10pt" height="5pt" viewBox="0 0 10 5" '
        b'version="1.1"><metadata>\n<a/></metadata><defs><path id="p"/></defs>'
        b'<use xlink:href="#p"/><g clip-path="url(#p)"/></svg>'
    )
    assert inline_svg(svg, "f", 'a "b"') == (
        '<svg viewBox="0 0 10 5" role="img" aria-label="a &quot;b&quot;"><defs><path id="f-p"/></defs>'
        '<use href="#f-p"/><g clip-path="url(#f-p)"/></svg>'
    )
