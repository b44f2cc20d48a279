"""What importing the library brings along, and what it says of itself."""

from __future__ import annotations

import json
import subprocess
import sys
import tomllib
from functools import cache
from pathlib import Path

import pytest

import morphcore
from morphdata.version import VERSION

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
# each as large as a part of the library's own start, and needed by some calls alone
LATE = ("cma", "pyswarms", "matplotlib", "scipy.stats", "pyarrow", "scipy.io", "rich", "typer", "pandas")


@cache
def modules_after(statement: str) -> frozenset[str]:
    """Names of all modules that a fresh process has after a statement."""
    program = f"{statement}; import json, sys; print(json.dumps(sorted(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    return frozenset(json.loads(done.stdout.splitlines()[-1]))


def test_importing_loads_no_package_that_one_call_needs() -> None:
    """The heavy packages of searches, pictures and files come with their first use."""
    assert modules_after("import morphcore").isdisjoint(LATE)


def test_importing_the_searches_loads_none_of_their_packages() -> None:
    """Registering a custom method, or reading a state, needs neither swarms nor strategies."""
    modules = modules_after("import morphcore.search.methods, morphcore.search.run, morphcore.search.hybrid")
    assert modules.isdisjoint(LATE)


def test_importing_adds_little_to_what_the_library_computes_with() -> None:
    """Modules instead of seconds, which a busy machine would spoil: a fifth more than the packages' own."""
    packages = modules_after("import numpy, scipy.optimize, numba")
    library = modules_after("import morphcore")
    foreign = {
        name for name in library - packages if name.partition(".")[0] not in ("morphcore", "morphdata")
    }
    print(f"{len(packages)} modules of the packages, {len(foreign)} more")
    assert len(foreign) < len(packages) / 5


@pytest.mark.parametrize(
    "statement",
    [
        "from morphcore.search.swarm import operators; operators()",
        "from morphcore.search.evolution import strategies; strategies()",
    ],
)
def test_late_packages_leave_logging_and_files_alone(statement: str, tmp_path: Path) -> None:
    """They configure the root logger and open files on import, which is not theirs to do."""
    program = f"import logging; {statement}; print(len(logging.getLogger().handlers))"
    done = subprocess.run(
        [sys.executable, "-W", "error::DeprecationWarning:morphcore", "-c", program],
        cwd=tmp_path, capture_output=True, text=True, check=True, env={"PYTHONPATH": str(ROOT)},
    )  # fmt: skip
    assert done.stdout.strip() == "0"
    assert list(tmp_path.iterdir()) == []


def test_the_version_is_said_once() -> None:
    """Library and service say what pyproject.toml says."""
    assert morphcore.__version__ == VERSION == PROJECT["project"]["version"]


def test_every_public_package_has_its_types() -> None:
    """A marker in the package, and in the list of what a wheel takes along."""
    tables = PROJECT["tool"]["setuptools"]
    packages = {pattern.rstrip("*") for pattern in tables["packages"]["find"]["include"]} - {"migrations"}
    for package in packages:
        assert (ROOT / package / "py.typed").is_file(), package
        assert "py.typed" in tables["package-data"][package], package
