"""Laws of the audit log."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from sqlalchemy import update

from app.audit import repository
from app.audit.records import Action, Entry
from app.database import Database
from app.keys.secret import KeyText
from app.keys.service import revoke_key
from app.settings import Settings
from app.tables import audit_log
from tests.app.key_holders import bearer, holder, make_key
from tests.app.request_documents import sample_document, simulate_document
from tests.app.running_service import DEAD_BROKER, RunningService, running_service
from tests.servers.stores import migrated_sqlite
from tests.waiting import until

PATIENCE_S = 10.0


@pytest.fixture(params=["sqlite", pytest.param("postgres", marks=pytest.mark.slow)])
def keyed(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[RunningService]:
    """A service that demands keys, once on each database; on Postgres among the long proofs."""
    if request.param == "sqlite":
        url = migrated_sqlite(tmp_path / "service.sqlite3")
    else:
        url = request.getfixturevalue("postgres_server").migrated_database()
    settings = Settings(database_url=url, broker_url=DEAD_BROKER, auth="keys")
    with running_service(settings) as running:
        yield running


def entries(database: Database, **chosen: str) -> list[Entry]:
    """The log, oldest first."""
    with database.read() as session:
        return repository.list_entries(session, limit=1000, **chosen)[::-1]


def test_deeds_are_noted_with_who_and_whence(keyed: RunningService) -> None:
    """Posting, cancelling, deleting and uploading leave a row: owner, key, target, request, address."""
    key = make_key(keyed.database, "lab")
    flight = sample_document("train_rate_0.5")
    del flight["role"]
    with holder(keyed, key.text) as client:
        header = {"X-Request-ID": "the-post", "Idempotency-Key": "k"}
        job = client.post("/simulate", json=simulate_document(), headers=header).json()["id"]
        client.post("/simulate", json=simulate_document(), headers=header).raise_for_status()
        client.post(f"/jobs/{job}/cancel").raise_for_status()
        client.delete(f"/jobs/{job}").raise_for_status()
        uploaded = client.post("/trajectories", json=flight).raise_for_status().json()["id"]
        client.get("/jobs").raise_for_status()
        client.post("/validate/simulate", json=simulate_document()).raise_for_status()
        client.delete("/jobs/job_nobodys")
    found = entries(keyed.database, owner="lab")
    assert [(entry.action, entry.target) for entry in found] == [
        ("key.create", key.key.id),
        ("job.post", job),
        ("job.cancel", job),
        ("job.delete", job),
        ("trajectory.post", uploaded),
    ]
    post = found[1]
    assert (post.key_id, post.request_id, post.address, post.outcome) == (
        key.key.id,
        "the-post",
        "127.0.0.1",
        "done",
    )
    assert post.detail == {"operation": "simulate"}


def test_refused_keys_are_noted_without_their_secrets(
    keyed: RunningService, caplog: pytest.LogCaptureFixture
) -> None:
    """Address, prefix and reason stand in the log; no secret does, whatever was sent as a key."""
    known, unknown = make_key(keyed.database), KeyText.new()
    with keyed.database.write() as session:
        revoke_key(session, known.key.prefix)
    sent = [known.text, unknown.text(), "mid_abcdefgh_hunter2", "Basic c2VjcmV0", "\x7fodd"]
    for text in sent:
        assert keyed.client.get("/jobs", headers=bearer(text)).status_code == 401

    def refused() -> list[Entry]:
        return entries(keyed.database, action="auth.refused")

    until(lambda: len(refused()) == len(sent), PATIENCE_S, seen=refused)
    found = refused()
    assert [(entry.outcome, entry.target) for entry in found] == [
        ("revoked", known.key.prefix),
        ("unknown", unknown.prefix),
        ("malformed", None),
        ("malformed", None),
        ("malformed", None),
    ]
    assert {entry.address for entry in found} == {"127.0.0.1"}
    everything = f"{entries(keyed.database)} {caplog.text}"
    for secret in (known.text.rpartition("_")[2], unknown.secret, "hunter2", "c2VjcmV0"):
        assert secret not in everything


def test_a_flood_of_guesses_does_not_fill_the_log(keyed: RunningService) -> None:
    """One address leaves a few rows, however many keys it tries."""
    for _ in range(60):
        keyed.client.get("/jobs", headers=bearer(KeyText.new().text()))
    time.sleep(0.5)
    # ten at once; a slow machine may take long enough for a few more
    assert 10 <= len(entries(keyed.database, action="auth.refused")) <= 20


def test_what_is_rolled_back_was_never_done(database: Database) -> None:
    """A deed is noted in the transaction that does it."""

    def interrupted() -> None:
        with database.write() as session:
            repository.insert_entry(session, Action.JOB_POST, owner="lab", target="job_1")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert entries(database) == []


def test_old_deeds_are_forgotten(database: Database) -> None:
    """Retention removes entries older than its limit, by the database's clock, and reports their number."""
    with database.write() as session:
        for number in range(3):
            repository.insert_entry(session, Action.JOB_POST, owner="lab", target=f"job_{number}")
        old = update(audit_log).where(audit_log.c.target != "job_2")
        session.execute(old.values(at=audit_log.c.at - 1000.0))
    with database.write() as session:
        assert repository.prune(session, 500.0) == 2
        assert repository.prune(session, 500.0) == 0
    assert [entry.target for entry in entries(database)] == ["job_2"]


def test_the_log_is_written_without_keys_too(tmp_path: Path) -> None:
    """On one machine everyone is `local`, and what was done is noted all the same."""
    url = migrated_sqlite(tmp_path / "service.sqlite3")
    with running_service(Settings(database_url=url, broker_url=DEAD_BROKER)) as service:
        service.client.post("/simulate", json=simulate_document()).raise_for_status()
        (entry,) = entries(service.database)
    assert (entry.action, entry.owner, entry.key_id) == ("job.post", "local", None)
