"""The queue's settings, each with its reason."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from app.settings import load_settings
from worker import celery_app
from worker.celery_app import make_app
from worker.hints import REAP


def test_messages_are_hints() -> None:
    """Messages are acknowledged early, fetched one at a time, and leave no result behind."""
    conf = make_app(load_settings()).conf
    assert conf.task_acks_late is False
    assert conf.worker_prefetch_multiplier == 1
    assert conf.worker_disable_prefetch is True
    assert conf.task_ignore_result is True
    assert conf.result_backend is None


@pytest.mark.parametrize("process", ["worker.celery_app", "app.jobs.queue"])
def test_celery_imports_nothing_from_the_working_folder(tmp_path: Path, root: Path, process: str) -> None:
    """Neither in a worker nor in the API does Celery put the working folder on the import path."""
    (tmp_path / "stranger.py").touch()
    program = (
        f"import sys; sys.path.append({str(root)!r}); import {process} as here\n"
        "getattr(here, '_client', lambda url: None)('redis://127.0.0.1:1/0')\n"
        "from celery.utils.imports import import_from_cwd\n"
        "try:\n    import_from_cwd('stranger')\nexcept ModuleNotFoundError:\n    sys.exit(0)\nsys.exit(1)"
    )
    command = [sys.executable, "-P", "-c", program]
    assert subprocess.run(command, cwd=tmp_path, check=False).returncode == 0


def test_variables_of_another_application_do_not_count(monkeypatch: pytest.MonkeyPatch) -> None:
    """A shell set up for another Celery application sends our workers to no other broker."""
    for name in ("BROKER_URL", "BROKER_READ_URL", "BROKER_WRITE_URL"):
        monkeypatch.setenv(f"CELERY_{name}", "redis://127.0.0.1:1/9")
    monkeypatch.setenv("CELERY_RESULT_BACKEND", "redis://127.0.0.1:1/9")
    conf = make_app(load_settings(broker_url="redis://127.0.0.1:6399/0")).conf
    assert {conf.broker_url, conf.broker_read_url, conf.broker_write_url} == {"redis://127.0.0.1:6399/0"}
    assert conf.result_backend is None


def test_jobs_at_once_are_what_the_worker_was_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    """MORPHID_WORKERS, unless `--concurrency` says otherwise; the cores are shared by what it comes to."""
    assert make_app(load_settings(workers=3)).conf.worker_concurrency == 3
    assert make_app(load_settings(reap_every_s=2.5)).conf.beat_schedule["reap"]["schedule"] == 2.5
    monkeypatch.setattr(celery_app.shutdown, "arm", lambda: None)
    prepared: list[int] = []
    monkeypatch.setattr(celery_app.numerics, "prepare_environment", prepared.append)
    monkeypatch.setattr(celery_app.numerics, "share_cores", lambda jobs: 100 // jobs)
    monkeypatch.setitem(celery_app.app.conf.changes, "worker_concurrency", 1)
    celery_app._before_the_pool(sender=SimpleNamespace(concurrency=5))
    assert prepared == [20]
    assert celery_app.threads_per_job() == 20


def test_the_reaper_runs_often_enough() -> None:
    """Lease, one round of the reaper and loading kernels fit into 90 s after a worker's death."""
    settings = load_settings()
    schedule = make_app(settings).conf.beat_schedule["reap"]
    assert schedule["task"] == REAP
    assert settings.lease_s + schedule["schedule"] <= 75.0
    assert schedule["options"]["expires"] > 3 * 3600.0, "a worker whose clock is hours wrong still takes part"
