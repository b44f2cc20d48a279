"""The client scripts of `examples/clients/`, run as a user runs them, against the live service."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.identification_request import QUICK_SEARCH
from tests.live import LiveService

pytestmark = pytest.mark.timeout(600)
WITHIN_S = 500  # the first identification of a fresh machine also compiles the kernels


def run_client(command: list[str], service: LiveService, folder: Path) -> str:
    """Run a client with a search that takes seconds; give what it printed."""
    ended = subprocess.run(
        [*command, service.url, str(folder)],
        env={**os.environ, "MORPHID_SEARCH": json.dumps(QUICK_SEARCH)},
        capture_output=True,
        text=True,
        timeout=WITHIN_S,
        check=False,
    )
    assert ended.returncode == 0, f"{ended.stdout}\n{ended.stderr}\n{service.logs()}"
    return ended.stdout


def assert_a_model_was_identified(folder: Path) -> None:
    """The saved result holds a model that beats the rigid one on every sample."""
    result = json.loads((folder / "result.json").read_text())
    assert result["model"]["links_per_wing"] == 3
    assert all(row["J_identified"] < row["J_rigid"] for row in result["fit"])


@pytest.mark.skipif(shutil.which("curl") is None, reason="needs curl")
def test_curl_client(live_service: LiveService, examples: Path, tmp_path: Path) -> None:
    """Plain curl uploads two flights, identifies, and fetches result and a plot."""
    printed = run_client([str(examples / "clients" / "identify.sh")], live_service, tmp_path)
    assert "slow" in printed
    assert "fast" in printed
    assert_a_model_was_identified(tmp_path)
    assert "<svg" in (tmp_path / "convergence.svg").read_text()[:2000]


def test_httpx_client(live_service: LiveService, examples: Path, tmp_path: Path) -> None:
    """A poller of a few lines identifies from one flight and predicts another."""
    script = str(examples / "clients" / "identify_httpx.py")
    printed = run_client([sys.executable, script], live_service, tmp_path)
    assert "held_out" in printed
    assert_a_model_was_identified(tmp_path)


@pytest.mark.slow
def test_generated_client(live_service: LiveService, examples: Path, tmp_path: Path) -> None:
    """The client that openapi-python-client makes of the OpenAPI document identifies with typed calls."""
    shutil.rmtree(examples / "clients" / "generated", ignore_errors=True)
    run_client([sys.executable, str(examples / "clients" / "generated_client.py")], live_service, tmp_path)
    assert_a_model_was_identified(tmp_path)
