"""Jobs that kill their worker in every attempt, together with others that do not."""

from __future__ import annotations

import pytest

from tests.faults.rig import Rig

ATTEMPTS = 3

pytestmark = [pytest.mark.faults, pytest.mark.timeout(300)]


def test_poison_jobs_harm_nobody_else(rig: Rig) -> None:
    """Killed, exited, segmentation fault: each `worker_lost` after 3 attempts; 20 others are unharmed."""
    rig.start_worker(slots=2)
    poison = [
        rig.add(steps=50, pause_s=0.02, dies_at=3, death=death, ends=frozenset({"failed"}))
        for death in ("killed", "exit", "segfault")
    ]
    others = [rig.add(steps=20, pause_s=0.02) for _ in range(20)]
    rig.settle(150.0)
    for job_id in poison:
        job = rig.job(job_id)
        assert (job.error or {})["code"] == "worker_lost"
        assert job.attempt == ATTEMPTS
    assert {rig.job(job_id).attempt for job_id in others} == {1}
