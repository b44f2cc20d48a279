"""House rules that import-linter's contracts cannot say."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

PACKAGES = ("app", "worker", "morphcore", "morphid", "morphdata")
KERNELS_MAY_IMPORT = {"__future__", "math", "numpy", "numpy.typing", "numba", "typing", "collections.abc"}
WORKER_MAY_KNOW = (
    *("app.jobs.", "app.settings", "app.database", "app.errors"),
    *(
        "app.observability.",
        "app.health.presence",
        "app.health.broker",
        "app.on_end",
    ),  # its own description
)
BANNED_NAMES = {"utils", "util", "helpers", "helper", "common", "misc"}
MAX_LINES = 500  # 400 is the aim; a little over is better than a file torn apart
MAX_KERNEL_LINES = 600  # the passes of one algorithm stay together


def sources(root: Path, package: str) -> Iterator[Path]:
    """Give a package's Python files."""
    yield from (path for path in (root / package).rglob("*.py") if "__pycache__" not in path.parts)


def imported(path: Path) -> set[str]:
    """Give the modules that a file imports, wherever in it."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names.add(node.module)
    return names


def test_kernels_stay_in_their_cellars(root: Path) -> None:
    """Compiled kernels import numpy, math, the one decorator, status codes and other kernels, no more."""
    for path in sources(root, "morphcore"):
        if "kernels" not in path.parts:
            continue
        foreign = {
            name
            for name in imported(path) - KERNELS_MAY_IMPORT
            if name not in {"morphcore.jit", "morphcore.status", "morphcore.lanes"} and ".kernels" not in name
        }
        assert foreign == set(), path


def test_the_worker_knows_only_the_store(root: Path) -> None:
    """Of the app, the worker knows the job store, its database and the settings."""
    for path in sources(root, "worker"):
        known = {name for name in imported(path) if name == "app" or name.startswith("app.")}
        assert {name for name in known if not name.startswith(WORKER_MAY_KNOW)} == set(), path


@pytest.mark.parametrize("package", PACKAGES)
def test_files_are_small_and_well_named(root: Path, package: str) -> None:
    """One algorithm, one file that can be read in one sitting, and a name that says what is in it."""
    for path in sources(root, package):
        assert path.stem not in BANNED_NAMES, path
        lines = len(path.read_text().splitlines())
        maximum = MAX_KERNEL_LINES if "kernels" in path.parts else MAX_LINES
        assert lines <= maximum, f"{path}: {lines} lines"


@pytest.mark.parametrize("package", PACKAGES)
def test_processes_of_ours_import_nothing_from_the_working_folder(root: Path, package: str) -> None:
    """Every Python process that the product starts is started with ``-P``."""
    for path in sources(root, package):
        for node in ast.walk(ast.parse(path.read_text())):
            words = [ast.unparse(word) for word in node.elts] if isinstance(node, ast.List) else []
            if "sys.executable" in words:
                assert "'-P'" in words, f"{path}:{node.lineno}"
