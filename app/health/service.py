"""Telling the truth about this process and what it depends on."""

from __future__ import annotations

import asyncio
from urllib.parse import urlsplit

from sqlalchemy.exc import SQLAlchemyError

from app.database import Database, schema_revision
from app.health.repository import JobCounts
from app.health.schemas import Readiness
from migrations import HEAD

BROKER_TIMEOUT_S = 0.5
REDIS_PORT = 6379


def _database_state(database: Database) -> str:
    try:
        with database.read() as session:
            return "ok" if schema_revision(session) == HEAD else "not migrated"
    except SQLAlchemyError as error:
        return f"unreachable ({type(error).__name__})"


async def _broker_state(url: str) -> str:
    parts = urlsplit(url)
    if not parts.hostname:
        return "not a network broker"
    try:
        async with asyncio.timeout(BROKER_TIMEOUT_S):
            _, writer = await asyncio.open_connection(parts.hostname, parts.port or REDIS_PORT)
    except (OSError, TimeoutError):
        return "unreachable"
    writer.close()
    return "ok"


async def readiness(database: Database, broker_url: str) -> Readiness:
    """Look at the database and the broker."""
    state, broker = await asyncio.gather(
        asyncio.to_thread(_database_state, database), _broker_state(broker_url)
    )
    return Readiness(status="ready" if state == "ok" else "not_ready", database=state, broker=broker)


def metrics_text(counts: JobCounts) -> str:
    """Metrics in the text format of Prometheus (version 0.0.4)."""
    lines = ["# HELP morphid_jobs Jobs by state.", "# TYPE morphid_jobs gauge"]
    lines += [f'morphid_jobs{{status="{status}"}} {number}' for status, number in counts.by_status.items()]
    lines += [
        "# HELP morphid_queue_depth Jobs that wait for a worker.",
        "# TYPE morphid_queue_depth gauge",
        f"morphid_queue_depth {counts.by_status['queued']}",
        "# HELP morphid_oldest_queued_seconds Age of the oldest job that waits.",
        "# TYPE morphid_oldest_queued_seconds gauge",
        f"morphid_oldest_queued_seconds {counts.oldest_queued_s:.3f}",
    ]
    return "\n".join(lines) + "\n"
