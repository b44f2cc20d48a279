"""Readiness of this process and of its dependencies."""

from __future__ import annotations

import asyncio
import time

from sqlalchemy.exc import SQLAlchemyError

from app.database import Database, schema_revision
from app.health.broker import BROKER_GOOD, broker_state
from app.health.metrics import Metrics
from app.health.repository import Snapshot, count_workers, snapshot
from app.health.schemas import Readiness, WorkerState
from app.settings import Settings
from migrations import HEAD

FRESH_S = 0.5  # s for which a readiness result is reused
UNKNOWN_WORKERS = WorkerState(status="unknown", alive=0, stalled=0, slots=0, busy=0)


def database_state(database: Database, beat_s: float, *, host: str | None = None) -> tuple[str, WorkerState]:
    """State of the database, and of the workers in it (those of `host`, of all)."""
    try:
        with database.read() as session:
            if schema_revision(session) != HEAD:
                return "not migrated", UNKNOWN_WORKERS
            return "ok", count_workers(session, beat_s, host=host)
    except SQLAlchemyError as error:
        return f"unreachable ({type(error).__name__})", UNKNOWN_WORKERS


class Health:
    """Reports the health of this process and its dependencies."""

    def __init__(self, database: Database, settings: Settings) -> None:
        self._database = database
        self._broker_url = settings.broker_url
        self._beat_s = settings.worker_seen_every_s
        self._looking = asyncio.Lock()
        self._seen: Readiness | None = None
        self._seen_at = float("-inf")
        self.metrics = Metrics(self._snapshot)

    async def readiness(self) -> Readiness:
        """Check database, broker and workers; requests need no key, so simultaneous ones share a check.

        Only the database can make the service unavailable: jobs are rows, kept while the rest is away.
        """
        async with self._looking:
            if self._seen is None or time.monotonic() - self._seen_at > FRESH_S:
                self._seen = await self._look()
                self._seen_at = time.monotonic()
            return self._seen

    async def _look(self) -> Readiness:
        (database, workers), broker = await asyncio.gather(
            asyncio.to_thread(database_state, self._database, self._beat_s),
            asyncio.to_thread(broker_state, self._broker_url),
        )
        good = broker in BROKER_GOOD and workers.status == "ok"
        status = "not_ready" if database != "ok" else "ready" if good else "degraded"
        return Readiness.model_validate(
            {"status": status, "database": database, "broker": broker, "workers": workers}
        )

    def _snapshot(self) -> Snapshot:
        with self._database.read() as session:
            return snapshot(session, self._beat_s)
