"""Telling the truth about this process and what it depends on."""

from __future__ import annotations

import asyncio
import time
from dataclasses import asdict

from sqlalchemy.exc import SQLAlchemyError

from app.database import Database, schema_revision
from app.health.broker import BROKER_GOOD, broker_state
from app.health.metrics import Metrics
from app.health.records import Snapshot, WorkerCounts
from app.health.repository import count_workers, snapshot
from app.health.schemas import Readiness, WorkerState
from app.settings import Settings
from migrations import HEAD

FRESH_S = 0.5  # as long an answer about readiness is given again
NO_WORKERS = WorkerCounts(0, 0, 0, 0)


def database_state(
    database: Database, beat_s: float, *, host: str | None = None
) -> tuple[str, WorkerCounts | None]:
    """Ask the database: its state, and its workers (those of `host`, of all) when it has an answer."""
    try:
        with database.read() as session:
            if schema_revision(session) != HEAD:
                return "not migrated", None
            return "ok", count_workers(session, beat_s, host=host)
    except SQLAlchemyError as error:
        return f"unreachable ({type(error).__name__})", None


def worker_state(counts: WorkerCounts | None) -> WorkerState:
    """Judge the workers."""
    if counts is None:
        status = "unknown"
    elif counts.alive:
        status = "ok"
    else:
        status = "stalled" if counts.stalled else "none"
    return WorkerState.model_validate({"status": status, **asdict(counts or NO_WORKERS)})


class Health:
    """What this process tells of itself and of what it depends on.

    Parameters
    ----------
    database : Database
    settings : Settings
    """

    def __init__(self, database: Database, settings: Settings) -> None:
        self._database = database
        self._broker_url = settings.broker_url
        self._beat_s = settings.worker_seen_every_s
        self._asking = asyncio.Lock()
        self._told: Readiness | None = None
        self._told_at = float("-inf")
        self.metrics = Metrics(self._look)

    async def readiness(self) -> Readiness:
        """Look at database, broker and workers; strangers may ask, so many questions are one look.

        Only the database makes the service unable to serve: jobs are rows, kept while the rest is away.
        """
        async with self._asking:
            if self._told is None or time.monotonic() - self._told_at > FRESH_S:
                self._told = await self._ask()
                self._told_at = time.monotonic()
            return self._told

    async def _ask(self) -> Readiness:
        (database, counts), broker = await asyncio.gather(
            asyncio.to_thread(database_state, self._database, self._beat_s),
            asyncio.to_thread(broker_state, self._broker_url),
        )
        workers = worker_state(counts)
        good = broker in BROKER_GOOD and workers.status == "ok"
        status = "not_ready" if database != "ok" else "ready" if good else "degraded"
        return Readiness.model_validate(
            {"status": status, "database": database, "broker": broker, "workers": workers.model_dump()}
        )

    def _look(self) -> Snapshot:
        with self._database.read() as session:
            return snapshot(session, self._beat_s)
