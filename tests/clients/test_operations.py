"""The client scripts of study, simulate and optimize, run as a user runs them, against the live service."""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.live import LiveService
from tests.morphid.test_clients import run_client

pytestmark = pytest.mark.timeout(600)


def saved(folder: Path) -> dict[str, Any]:
    """Read the result that a client saved."""
    result: dict[str, Any] = json.loads((folder / "result.json").read_text())
    return result


@pytest.mark.slow
def test_study_client(live_service: LiveService, examples: Path, tmp_path: Path) -> None:
    """Three models are compared, one is recommended and kept."""
    script = str(examples / "clients" / "study_httpx.py")
    printed = run_client([sys.executable, script], live_service, tmp_path)
    assert [row["links_per_wing"] for row in saved(tmp_path)["rows"]] == [1, 2, 3]
    assert "kept as model_" in printed


@pytest.mark.skipif(shutil.which("curl") is None, reason="needs curl")
def test_simulate_client(live_service: LiveService, examples: Path, tmp_path: Path) -> None:
    """Plain curl flies the flexible model and fetches table and picture."""
    printed = run_client([str(examples / "clients" / "simulate.sh")], live_service, tmp_path)
    assert "theta" in printed
    assert saved(tmp_path)["model"]["kind"] == "flexible"
    assert len((tmp_path / "flight.csv").read_text().splitlines()) == 1 + 101
    assert "<svg" in (tmp_path / "flight.svg").read_text()[:2000]


@pytest.mark.slow
def test_optimize_client(live_service: LiveService, examples: Path, tmp_path: Path) -> None:
    """A model is identified, and the schedule found with it varies less than the constant rate."""
    script = str(examples / "clients" / "optimize_httpx.py")
    printed = run_client([sys.executable, script], live_service, tmp_path)
    variation = saved(tmp_path)["variation"]
    assert variation["optimum"]["equivalent"] < variation["constant"]["equivalent"]
    assert "rigid_optimum" in printed
