"""Long queues in a moment: rows written many at a time, as `create_job` would write them one by one."""

from __future__ import annotations

from typing import Any

from sqlalchemy import insert, select

from app.database import Database, database_time, insert_new
from app.documents import sealed
from app.identifiers import new_identifier
from app.tables import job_events, job_requests, jobs, owners

BATCH = 1000


def fill(database: Database, owner: str, count: int, **request: Any) -> list[str]:
    """Queue a number of walks for an owner and give their ids, oldest first."""
    document = sealed({"seed": 1, **request})
    ids = sorted(new_identifier("job") for _ in range(count))
    for begin in range(0, count, BATCH):
        with database.write() as session:
            now = session.scalar(select(database_time()))
            chosen = ids[begin : begin + BATCH]
            session.execute(insert(jobs), [_row(job_id, owner, now, len(document.data)) for job_id in chosen])
            session.execute(
                insert(job_requests),
                [{"job_id": i, "document": document.data, "sha256": document.sha256} for i in chosen],
            )
            session.execute(
                insert(job_events),
                [
                    {"job_id": i, "seq": 1, "type": "queued", "payload": {"status": "queued"}, "at": now}
                    for i in chosen
                ],
            )
            session.execute(insert_new(session, owners).values(owner=owner).on_conflict_do_nothing())
    return ids


def _row(job_id: str, owner: str, now: Any, size_bytes: int) -> dict[str, Any]:
    return {
        "id": job_id,
        "owner": owner,
        "operation": "walk",
        "status": "queued",
        "priority": 0,
        "summary": {"aircraft": "a straight wing", "samples": [{"name": "s", "role": "train", "rows": 250}]},
        "attempt": 0,
        "max_attempts": 3,
        "fence": 0,
        "event_seq": 1,
        "partial": False,
        "published_at": now,
        "created_at": now,
        "updated_at": now,
        "size_bytes": size_bytes,
    }
