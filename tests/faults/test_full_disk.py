"""No room at a checkpoint: the job says why it failed and leaves its best so far, others go on."""

from __future__ import annotations

import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest
from sqlalchemy import select, text

from app.documents import unpacked
from app.jobs.records import JobStatus
from app.tables import job_checkpoints, job_results
from tests.app.request_documents import simulate_document
from tests.faults.rig import Rig
from tests.servers import redis

SWELLS_BYTES = 20_000
ROOM_BYTES = 400_000
PAGE_BYTES = 4096
FAILED = frozenset({"failed"})
TINY_DISK = "8m"

pytestmark = [pytest.mark.faults, pytest.mark.timeout(300)]


def make_small(rig: Rig, *, results: bool) -> dict[str, str]:
    """Leave the workers little space; return the settings for that."""
    if rig.database.engine.dialect.name == "sqlite":
        with rig.database.read() as session:
            pages = int(session.scalar(text("PRAGMA page_count")) or 0)
        return {"MORPHID_TEST_PAGES": str(pages + ROOM_BYTES // PAGE_BYTES)}
    tables = ["job_checkpoints", *(["job_results"] if results else [])]
    column = {"job_checkpoints": "length(NEW.data) > 200000", "job_results": "true"}
    with rig.database.write() as session:
        for table in tables:
            session.execute(
                text(
                    f"CREATE FUNCTION full_{table}() RETURNS trigger LANGUAGE plpgsql AS $$ BEGIN "
                    f"IF {column[table]} THEN RAISE EXCEPTION 'no space left on device' "
                    "USING ERRCODE = '53100'; END IF; RETURN NEW; END $$"
                )
            )
            session.execute(
                text(
                    f"CREATE TRIGGER full_{table} BEFORE INSERT ON {table} "
                    f"FOR EACH ROW EXECUTE FUNCTION full_{table}()"
                )
            )
    return {}


@pytest.mark.parametrize("results", [False, True], ids=["checkpoint", "result"])
def test_no_room_for_a_checkpoint(rig: Rig, results: bool) -> None:  # noqa: FBT001 - a parameter of the test
    """The job fails as `storage_full` with a hint and its best so far; a small job still runs."""
    rig.start_worker(environment=make_small(rig, results=results))
    job_id = rig.add(steps=200, pause_s=0.1, swells_bytes=SWELLS_BYTES, ends=FAILED)
    rig.until(lambda: rig.job(job_id).finished, 90.0)
    error = rig.job(job_id).error or {}
    print(f"no room: {error}")
    assert error["code"] == "storage_full"
    assert error["hint"]
    with rig.database.read() as session:
        kept = session.scalar(select(job_checkpoints.c.data).where(job_checkpoints.c.job_id == job_id))
        best = session.scalar(select(job_results.c.document).where(job_results.c.job_id == job_id))
    assert kept is None, "the state of an ended job takes no room"
    if results and rig.database.engine.dialect.name != "sqlite":
        assert best is None, "there was no room for it"
    else:
        assert best is not None
        assert unpacked(best)["step"] >= 1, "the former checkpoint was whole"
    if not results:
        small = rig.add(steps=5)
        rig.until(lambda: rig.job(small).finished, 30.0)


@pytest.fixture
def tiny_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of a few megabytes, where this machine lets us make one."""
    folder = tmp_path / "tiny"
    folder.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", f"size={TINY_DISK}", "tmpfs", folder], capture_output=True, check=False
    )
    if mounted.returncode != 0:
        pytest.skip("needs the right to mount a file system")
    yield folder
    subprocess.run(["umount", "--lazy", folder], check=True)


def test_a_disk_that_is_full_and_then_is_not(tiny_disk: Path, tmp_path: Path, root: Path) -> None:
    """Every byte taken amid a job: POST answers 503, cancel works, the job ends; with room again all do."""
    rig = Rig(tmp_path, root, f"sqlite:///{tiny_disk / 'jobs.sqlite3'}", redis.embedded(tmp_path))
    try:
        rig.start_worker()
        rig.start_api()
        job_id = rig.add(steps=120, pause_s=0.1, ends=frozenset({"succeeded", "failed"}))
        waiting = [rig.add(steps=5, ends=frozenset({"cancelled"})) for _ in range(3)]
        rig.until(lambda: rig.generation(job_id) >= 5, 30.0)
        filler = tiny_disk / "filler"
        with filler.open("wb", buffering=0) as file:
            try:
                while True:
                    file.write(bytes(PAGE_BYTES))
            except OSError:
                pass
        answers = []
        deadline = time.monotonic() + 20.0
        # what SQLite still has in its journal may take a job or two
        while time.monotonic() < deadline and 503 not in [answer.status_code for answer in answers]:
            answers.append(httpx.post(f"{rig.url}/simulate", json=simulate_document(), timeout=30.0))
            if answers[-1].status_code == 202:
                rig.ledger.accept(answers[-1].json()["id"], 25)
        problem = answers[-1].json()
        cancelled = [httpx.post(f"{rig.url}/jobs/{name}/cancel", timeout=30.0) for name in waiting]
        assert [answer.json().get("status") for answer in cancelled] == ["cancelled"] * 3, cancelled[0].text
        rig.until(lambda: rig.job(job_id).finished, 60.0)
        filler.unlink()
        assert (answers[-1].status_code, problem["code"]) == (503, "storage_full"), problem
        rig.settle()
        rig.ledger.assert_kept(rig.database)
        job = rig.job(job_id)
        print(f"disk full for a while: the job {job.status.value} in attempt {job.attempt} {job.error or ''}")
        assert job.status is JobStatus.SUCCEEDED or (job.error or {})["code"] == "storage_full"
    finally:
        rig.close()
