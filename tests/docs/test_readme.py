"""The README's commands are those of the Makefile and of CI."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent


def first_commands() -> list[str]:
    """Give the commands of the README's first block, without their comments."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    block = re.search(r"(?:^    .+\n)+", text, flags=re.MULTILINE)
    assert block is not None
    return [line.partition("#")[0].strip() for line in block[0].splitlines()]


def test_the_readme_begins_with_the_demo_and_the_tests() -> None:
    """The two commands stand side by side before anything else to type, and are targets of make."""
    assert first_commands() == ["make demo", "make test"]
    targets = set(
        re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), flags=re.MULTILINE)
    )
    assert {command.removeprefix("make ") for command in first_commands()} <= targets


def test_ci_calls_the_test_command_of_the_readme() -> None:
    """CI runs the tests that the README recommends."""
    lines = (ROOT / ".ci" / "run").read_text(encoding="utf-8").splitlines()
    assert first_commands()[1] in lines


def test_the_readme_shows_the_way_from_a_clone_to_a_model_early() -> None:
    """Installation and identification from files of one's own come within the first screen or so."""
    lines = (ROOT / "README.md").read_text(encoding="utf-8").splitlines()
    head = [line.partition("#")[0].strip() for line in lines[:30]]
    assert "pip install ." in head
    assert any(line.startswith("morphid identify ") for line in head)
