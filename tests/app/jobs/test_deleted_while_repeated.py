"""An idempotency key is repeated while its job is being deleted: the old job or a new one, never an error."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from sqlalchemy import event, select

from app.database import Database
from app.jobs import event_stream, repository, store
from app.tables import idempotency_keys, jobs
from tests.app.calls import post
from tests.app.jobs.test_store import OWNER, claimed, new_job
from tests.app.request_documents import SIMULATE_RESULT, simulate_document
from tests.app.running_service import RunningService
from tests.waiting import until


def ended_job(database: Database) -> str:
    """A job with an idempotency key that can be deleted."""
    job = new_job(database, idempotency_key="k")
    claim = claimed(database, job.id)
    with database.write() as session:
        store.finish_job(session, claim, "failed")
    return job.id


@contextmanager
def once_after(database: Database, statement: str, act: Callable[[], None]) -> Iterator[None]:
    """Act right after the first statement that begins so."""
    left = [act]

    def look(_connection: Any, _cursor: Any, sent: str, *_rest: Any) -> None:
        if left and " ".join(sent.split()).startswith(statement):
            left.pop()()

    event.listen(database.engine, "after_cursor_execute", look)
    try:
        yield
    finally:
        event.remove(database.engine, "after_cursor_execute", look)
    assert not left, "the statement did not come"


@pytest.mark.parametrize(
    "statement", ["INSERT INTO idempotency_keys", "SELECT idempotency_keys.owner"], ids=["taken", "found"]
)
def test_a_deletion_between_two_statements_frees_the_key(database: Database, statement: str) -> None:
    """Another connection deletes the job amid the repetition: it makes a new job, and the key is its."""
    if database.engine.dialect.name == "sqlite":
        pytest.skip("one writer at a time: nothing comes between")
    earlier, second = ended_job(database), Database(database.url)

    def delete() -> None:
        with second.write() as session:
            repository.delete_job(session, OWNER, earlier)

    with once_after(database, statement, delete):
        again = new_job(database, idempotency_key="k")
    second.dispose()
    assert again.id != earlier
    assert not again.replayed
    with database.read() as session:
        assert session.scalars(select(jobs.c.id)).all() == [again.id]
        assert session.scalars(select(idempotency_keys.c.job_id)).all() == [again.id]


def test_a_deletion_that_is_under_way_is_waited_for(database: Database) -> None:
    """The job is deleted and not yet its key, uncommitted: a repetition waits, and then makes a new job."""
    earlier = ended_job(database)
    made: list[str] = []
    repetition = threading.Thread(target=lambda: made.append(new_job(second, idempotency_key="k").id))
    second = Database(database.url)
    with database.write() as session:
        session.execute(jobs.delete().where(jobs.c.id == earlier))
        repetition.start()
        repetition.join(0.5)
        assert not made
        session.execute(idempotency_keys.delete())
    repetition.join(20.0)
    second.dispose()
    assert made != []
    assert made != [earlier]


@pytest.mark.parametrize("wait", [{}, {"Prefer": "wait=20"}], ids=["at once", "waiting"])
def test_a_job_deleted_before_it_is_shown(
    any_service: RunningService, monkeypatch: pytest.MonkeyPatch, wait: dict[str, str]
) -> None:
    """The repetition was accepted: it shows the job as it was, and the next makes a new one."""
    headers = {"Idempotency-Key": f"shown{len(wait)}"}
    first = post(any_service, "/simulate", simulate_document(), **headers).json()["id"]
    any_service.finish(any_service.claim(first), "succeeded", result=SIMULATE_RESULT)
    read = event_stream.read_in_turn

    async def deleted_before(*requested: Any) -> Any:
        monkeypatch.setattr(event_stream, "read_in_turn", read)
        with any_service.database.write() as session:
            repository.delete_job(session, "local", first)
        return await read(*requested)

    monkeypatch.setattr(event_stream, "read_in_turn", deleted_before)
    again = post(any_service, "/simulate", simulate_document(), **headers, **wait)
    assert again.status_code == 202, again.text
    assert (again.json()["id"], again.json()["status"]) == (first, "succeeded")
    assert again.headers["idempotency-replayed"] == "true"
    fresh = post(any_service, "/simulate", simulate_document(), **headers)
    assert (fresh.status_code, fresh.json()["status"]) == (202, "queued")
    assert fresh.json()["id"] != first
    assert "idempotency-replayed" not in fresh.headers


def test_a_job_deleted_while_its_post_waits(any_service: RunningService) -> None:
    """A post that waits for a job that is cancelled and deleted meanwhile is answered with the job."""
    found: list[Any] = []
    headers = {"Prefer": "wait=20"}
    waiting = threading.Thread(
        target=lambda: found.append(
            any_service.client.post(
                "/simulate",
                content=json.dumps(simulate_document()),
                headers={**headers, "Content-Type": "application/json", "Idempotency-Key": "waits"},
            )
        )
    )
    waiting.start()

    def posted() -> str | None:
        mine = idempotency_keys.c.key == "waits"
        with any_service.database.read() as session:
            return session.scalar(select(idempotency_keys.c.job_id).where(mine))

    job_id = until(posted)
    assert job_id is not None
    with any_service.database.write() as session:
        store.request_cancel(session, "local", job_id)
        repository.delete_job(session, "local", job_id)
    waiting.join(30.0)
    assert (found[0].status_code, found[0].json()["id"]) == (202, job_id)
