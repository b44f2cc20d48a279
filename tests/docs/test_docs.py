"""The documentation is true: its examples run and its links work."""

from __future__ import annotations

import doctest
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent.parent
PAPERS = sorted([*(ROOT / "docs").glob("*.md"), ROOT / "DECISIONS.md"])
EXAMPLES = [paper for paper in PAPERS if ">>> " in paper.read_text(encoding="utf-8")]


@pytest.mark.parametrize("paper", EXAMPLES, ids=lambda path: path.name)
def test_examples_run(paper: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every example in a paper gives what stands below it, from the root of the source tree."""
    monkeypatch.chdir(ROOT)
    failed, tried = doctest.testfile(
        str(paper), module_relative=False, optionflags=doctest.ELLIPSIS, encoding="utf-8"
    )
    assert tried > 0
    assert failed == 0


def test_the_library_has_examples() -> None:
    """The library's paper is among those that are run."""
    assert [paper.name for paper in EXAMPLES] == ["library.md"]


@pytest.mark.parametrize("paper", PAPERS, ids=lambda path: path.name)
def test_files_that_are_named_are_there(paper: Path) -> None:
    """Source files and links that a paper names exist."""
    text = paper.read_text(encoding="utf-8")
    linked = [link for link in re.findall(r"\]\(([^)#]+)\)", text) if "://" not in link]
    assert [link for link in linked if not (paper.parent / link).exists()] == []
    named = re.findall(r"`([a-z_]+(?:/[a-z_]+)*(?:/|\.py))`", text)
    places = (ROOT, ROOT / "morphcore")
    assert [name for name in named if not any((place / name).exists() for place in places)] == []


def test_decisions_are_few_and_numbered_once() -> None:
    """Fewer than fifty decisions stand, and no number is used twice, so that a reference stays valid."""
    text = (ROOT / "DECISIONS.md").read_text(encoding="utf-8")
    numbers = re.findall(r"^(\d+)\. ", text, flags=re.MULTILINE)
    assert len(set(numbers)) == len(numbers) < 50


@pytest.mark.parametrize("paper", PAPERS, ids=lambda path: path.name)
def test_proofs_that_are_named_are_there(paper: Path) -> None:
    """A test that a paper names as a proof exists."""
    named = set(re.findall(r"`(test_[a-z0-9_]+)`", paper.read_text(encoding="utf-8")))
    written = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "tests").rglob("test_*.py"))
    assert [name for name in sorted(named) if f"def {name}(" not in written] == []
