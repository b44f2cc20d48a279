"""A worker's signs of life: rows written from the same loop that hands jobs to its children.

A process that exists but starts no jobs (stopped, hung) writes none, and one whose children are gone or do
not answer reports no free slots. Rows are also checked without a broker (`worker.row_watch`), so these signs
do not depend on the broker. Each sign is a transaction on its own connection, closed at once: the parent
process forks, and a child must not inherit a connection.
"""

from __future__ import annotations

import logging
import os
import socket
from collections.abc import Callable
from pathlib import Path
from typing import Any

from celery import bootsteps
from celery.worker import state
from sqlalchemy import Engine, create_engine, make_url
from sqlalchemy.exc import SQLAlchemyError
from sqlalchemy.pool import NullPool

from app.database import Session
from app.database_address import normal_url
from app.health.presence import Sign, note_seen, note_started, note_stopped
from app.observability.counters import count
from app.observability.job_counts import MESSAGES_DROPPED
from app.settings import load_settings
from morphdata.version import VERSION
from worker.row_watch import RowWatch
from worker.transport import dropped

log = logging.getLogger(__name__)

PATIENCE_S = 2  # s to wait for a busy or absent database: the loop has messages to take
UNABLE_AFTER_S = 15.0  # free children that have not checked the rows for this long will not take a job either
IDLE_STATES = frozenset("TtZXx")  # stopped, traced, zombie, dead (proc(5))


def process_name() -> str:
    """Return the name of this process among all worker processes."""
    return f"{socket.gethostname()}:{os.getpid()}"


def brief_engine(url: str) -> Engine:
    """Open an engine that keeps no connection and loses little time if the database is unreachable."""
    parsed = make_url(normal_url(url))
    link: dict[str, Any] = {"connect_timeout": PATIENCE_S, "options": f"-c statement_timeout={PATIENCE_S}s"}
    if parsed.get_backend_name() == "sqlite":
        link = {"timeout": PATIENCE_S}
    options = {key: value for key, value in link.items() if key not in parsed.query}
    return create_engine(parsed, poolclass=NullPool, connect_args=options)


def can_work(pid: int, *, proc: Path = Path("/proc")) -> bool:
    """Whether a process is running: not stopped, not dead. Without /proc this is assumed."""
    try:
        stat = (proc / str(pid) / "stat").read_text()
    except FileNotFoundError:
        return not proc.joinpath("self").exists()
    except OSError:
        return True
    return stat.rpartition(")")[2].split()[0] not in IDLE_STATES


class Presence(bootsteps.StartStopStep):  # type: ignore[misc]  # celery carries no types
    """Step of Celery's worker: writes signs of life from its event loop, and a last one at shutdown."""

    requires = (
        "celery.worker.components:Pool",
        RowWatch,
    )  # a sign of life implies that the rows are being checked

    def __init__(self, worker: Any, **options: Any) -> None:
        super().__init__(worker, **options)
        settings = load_settings()
        self._every_s = settings.worker_seen_every_s
        self._engine = brief_engine(settings.database_url)
        self._name = process_name()  # that of the parent, not of a pool child
        self._timers: list[Any] = []
        self._known = False
        self._written = True

    def start(self, worker: Any) -> None:
        """Write a sign at once, but in the loop, to prove that the loop runs; then regularly."""
        beat = (worker,)
        self._timers = [
            worker.timer.call_after(0.01, self._beat, beat),
            worker.timer.call_repeatedly(self._every_s, self._beat, beat),
        ]

    def stop(self, _worker: Any) -> None:
        """Record that the worker ends."""
        for timer in self._timers:
            timer.cancel()
        self._timers = []
        if self._known:
            self._known = False
            self._write(lambda session: note_stopped(session, self._name))

    terminate = stop

    def _beat(self, worker: Any) -> None:
        able = worker.row_watch.unanswered_s < UNABLE_AFTER_S
        slots = sum(can_work(child.pid) for child in _children(worker)) if able else 0
        sign = Sign(self._name, VERSION, slots=slots, busy=len(state.active_requests))
        note = note_seen if self._known else note_started
        number = dropped.number

        def write(session: Session) -> None:
            note(session, sign)
            count(session, MESSAGES_DROPPED, by=number)

        if self._write(write):
            self._known = True
            dropped.number -= number

    def _write(self, write: Callable[[Session], None]) -> bool:
        try:
            with self._engine.begin() as session:
                write(session)
        except SQLAlchemyError as error:
            if self._written:
                log.warning("no sign of life could be written: %s", error)
            self._written = False
            return False
        self._written = True
        return True


def _children(worker: Any) -> list[Any]:
    pool = getattr(worker.pool, "_pool", None)
    return list(getattr(pool, "_pool", None) or [])
