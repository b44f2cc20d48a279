"""The report: complete, self-contained, correct HTML, its words in line with its figures."""

from __future__ import annotations

import json
import re
from html.parser import HTMLParser
from pathlib import Path

import pytest

from morphcore.paper import PaperSettings, write_report
from morphcore.paper.report.report import report_page
from morphcore.simulate.trajectory import load_trajectory
from tests.paper import made_up

VOID = {"meta", "br", "img", "link", "input", "hr"}


class Outline(HTMLParser):
    """Tags, ids and references of a page; complains about tags that are not closed in order."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[str] = []
        self.ids: list[str] = []
        self.references: list[str] = []
        self.scripts = 0

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note a tag and what it names."""
        self.tags.append(tag)
        if tag not in VOID:
            self.open.append(tag)
        for name, value in attrs:
            if name == "id" and value:
                self.ids.append(value)
            if name in {"href", "src", "data", "srcset", "action"} and value:
                self.references.append(value)
            self.references += [f"#{target}" for target in re.findall(r"url\(#([^)]+)\)", value or "")]

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note a tag that closes itself."""
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self.open.pop()

    def handle_endtag(self, tag: str) -> None:
        """Close the last one."""
        assert self.open.pop() == tag


@pytest.fixture(scope="module")
def text() -> str:
    """Give the report of the made-up results."""
    return report_page(PaperSettings(quick=True), made_up.finished())


@pytest.fixture(scope="module")
def outline(text: str) -> Outline:
    """Give its outline."""
    parsed = Outline()
    parsed.feed(text)
    assert parsed.open == []
    return parsed


def test_every_table_and_figure_is_there(text: str, outline: Outline) -> None:
    """Tables 1 to 3, figures 4 to 11, with captions; each figure has its picture inside."""
    for number in (1, 2, 3):
        assert f"<b>Table {number}.</b>" in text
    for number in range(4, 12):
        assert f"<b>Figure {number}.</b>" in text
    figures = outline.tags.count("figure")
    assert figures == outline.tags.count("svg") == outline.tags.count("figcaption") >= 12


def test_nothing_outside_is_asked_for(text: str, outline: Outline) -> None:
    """No address, no script, no style sheet, no picture of another file: references lead inside."""
    assert "http" not in text
    assert "@import" not in text
    assert {"script", "link", "img", "iframe", "object"} & set(outline.tags) == set()
    assert set(outline.references) <= {f"#{name}" for name in outline.ids}


def test_ids_are_unique(outline: Outline) -> None:
    """Figures drawn by one program give the same ids to their parts: here none is given twice."""
    assert len(outline.ids) == len(set(outline.ids))


def test_the_papers_headlines_stand_next_to_ours(text: str) -> None:
    """10 per cent, -4.23 and +4.12 per cent, and what the made-up stages say."""
    for shown in ("about 10 %", "−4.23 %", "+4.12 %", "−25.00 %", "0.40 %"):
        assert shown in text, shown


def test_texts_are_escaped(text: str) -> None:
    """A name with the characters of a tag is shown as it is."""
    assert "abacus &lt;1 bead&gt;" in text
    assert "<1 bead>" not in text


def test_the_same_results_give_the_same_page(text: str) -> None:
    """No date of today, no random ids: only the stages decide."""
    assert report_page(PaperSettings(quick=True), made_up.finished()) == text


def test_verdicts_follow_the_figures() -> None:
    """A missed figure is called so in the table, and counted in the words above it."""
    made = made_up.results()
    assert "All of them are met" in report_page(PaperSettings(), made_up.finished(made))
    made["morph"]["reduction_percent"] = 1.0
    missed = report_page(PaperSettings(), made_up.finished(made))
    assert re.search(r"\b1 of \d+ are missed", missed)
    assert missed.count('class="missed"') == 1


def test_without_independent_flights_the_report_says_so() -> None:
    """The rest is there; nothing claims what was not done."""
    made = made_up.results()
    made["independent"] = {"available": False, "laws": []}
    page = report_page(PaperSettings(), made_up.finished(made))
    assert "were not available" in page
    assert "another program's flights, predicted with nothing fitted" not in page


def test_the_folder_holds_report_figures_and_flights(tmp_path: Path) -> None:
    """The page, a summary for machines, and the six flights as sample files that load."""
    report = write_report(PaperSettings(quick=True), made_up.finished(), tmp_path)
    assert report.read_text(encoding="utf-8").startswith("<!DOCTYPE html>")
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["total_s"] == pytest.approx(10.0 * len(made_up.results()))
    assert {each["met"] for each in summary["asked"]} == {True}
    flights = sorted(path.name for path in (tmp_path / "flights").iterdir())
    assert len(flights) == 6
    assert load_trajectory(tmp_path / "flights" / "quadratic.csv").time_s.size == made_up.TIME_S.size
