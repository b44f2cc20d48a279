"""Docstrings that tools parse: what `morphcore` exports is numpydoc, and its examples run."""

from __future__ import annotations

import doctest
from pathlib import Path

import pytest
from numpydoc.validate import validate

import morphcore
from morphdata import renamed

ROOT = Path(__file__).parents[2]
NAMES = [name for name in morphcore.__all__ if name != "__version__"]
FUNCTIONS = [name for name in NAMES if name[0].islower()]
CHECKS = {
    "GL06": "an unknown section",
    "GL07": "sections in another order",
    "GL08": "no docstring",
    "PR02": "a parameter that does not exist",
    "PR03": "parameters in another order",
    "PR04": "a parameter without a type",
    "PR07": "a parameter without a description",
    "PR10": "no space before the colon of a type",
    "RT03": "a return value without a description",
    "SS01": "no summary",
}
CHECKS_OF_FUNCTIONS = {"PR01": "a parameter is missing", "RT01": "no Returns section"}


@pytest.mark.parametrize("name", NAMES)
def test_what_users_call_is_numpydoc(name: str) -> None:
    """Every parameter with type and description, every section one that numpydoc knows."""
    checks = CHECKS | (CHECKS_OF_FUNCTIONS if name in FUNCTIONS else {})
    exported = getattr(morphcore, name)
    errors = validate(f"{exported.__module__}.{exported.__name__}")["errors"]
    found = [f"{code}: {text}" for code, text in errors if code in checks]
    assert not found


@pytest.mark.parametrize("name", FUNCTIONS)
def test_examples_run(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """From the root of the project, where the example files are."""
    monkeypatch.chdir(ROOT)
    finder = doctest.DocTestFinder(recurse=False)
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS)
    for example in finder.find(getattr(morphcore, name), name, module=False, globs={}):  # type: ignore[arg-type]
        assert runner.run(example).failed == 0


def test_examples_of_renamed_names_run() -> None:
    """Both ways and in lists."""
    assert doctest.testmod(renamed).failed == 0
