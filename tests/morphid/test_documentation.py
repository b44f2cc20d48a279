"""The commands that the documentation shows are commands."""

from __future__ import annotations

import shlex
from pathlib import Path

import pytest
import typer.main

from morphid.main import app

PAGES = ("README.md", "docs/command_line.md", "docs/library.md", "docs/service.md", "docs/security.md")


def shown_commands(text: str) -> list[str]:
    """Give the indented `morphid` lines of a page, with their continuations."""
    lines = (line.removeprefix("    ").removeprefix("$ ") for line in text.replace("\\\n", " ").splitlines())
    return [line for line in lines if line.startswith("morphid ")]


@pytest.mark.parametrize("page", PAGES)
def test_shown_commands_parse(root: Path, page: str) -> None:
    """Every command line of a page has options that exist and values that they take."""
    group = typer.main.get_command(app)
    shown = shown_commands((root / page).read_text())
    assert shown or page == "docs/service.md"
    for line in shown:
        if "..." in line:
            continue  # shortened
        command, words = group, shlex.split(line, comments=True)[1:]
        while hasattr(command, "commands"):
            command = command.commands[words.pop(0)]
        command.make_context(line, words)


def test_every_command_is_shown(root: Path) -> None:
    """The page of the command line has a section on each command."""
    group = typer.main.get_command(app)
    headings = {line.removeprefix("## ") for line in (root / "docs/command_line.md").read_text().splitlines()}
    assert set(group.commands) - headings == set()  # type: ignore[attr-defined]
