"""A worker's signs of life: rows written from the very loop that takes messages from the broker.

A process that is there but does not consume (stopped, hung, cut off from the broker) writes none, and one
without living children writes that it has no slots: whoever reads the table sees it. Each sign is a
transaction on a connection of its own, closed at once: the parent process forks, and a child must not inherit
a connection.
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
from app.health.broker import BROKER_GOOD, broker_state
from app.health.presence import Sign, note_seen, note_started, note_stopped
from app.settings import load_settings
from app.version import VERSION

log = logging.getLogger(__name__)

PATIENCE_S = 2  # with a busy or absent database: the loop has messages to take
IDLE_STATES = frozenset("TtZXx")  # stopped, traced, zombie, dead (proc(5))


def worker_name() -> str:
    """Name this process among all workers of the service: the parent's, not a pool child's."""
    return f"{socket.gethostname()}:{os.getpid()}"


def brief_engine(url: str) -> Engine:
    """Open an engine that keeps no connection and loses little time with a database that is away."""
    parsed = make_url(normal_url(url))
    if parsed.get_backend_name() == "sqlite":
        return create_engine(parsed, poolclass=NullPool, connect_args={"timeout": PATIENCE_S})
    link = {"connect_timeout": PATIENCE_S, "options": f"-c statement_timeout={PATIENCE_S}s"}
    return create_engine(
        parsed,
        poolclass=NullPool,
        connect_args={key: value for key, value in link.items() if key not in parsed.query},
    )


def can_work(pid: int, *, proc: Path = Path("/proc")) -> bool:
    """Whether a process runs: not stopped, not dead. Where there is no /proc, it does."""
    try:
        stat = (proc / str(pid) / "stat").read_text()
    except FileNotFoundError:
        return not proc.joinpath("self").exists()
    except OSError:
        return True
    return stat.rpartition(")")[2].split()[0] not in IDLE_STATES


class Presence(bootsteps.StartStopStep):  # type: ignore[misc]  # celery carries no types
    """Part of Celery's consumer: begins with it, ends with it, beats in its event loop.

    Parameters
    ----------
    consumer : Celery's.
    """

    requires = ("celery.worker.consumer.tasks:Tasks",)  # begins once messages are taken

    def __init__(self, consumer: Any, **options: Any) -> None:
        super().__init__(consumer, **options)
        settings = load_settings()
        self._every_s = settings.worker_seen_every_s
        self._broker_url = settings.broker_url
        self._engine = brief_engine(settings.database_url)
        self._name = worker_name()
        self._timers: list[Any] = []
        self._known = False
        self._told = True

    def start(self, consumer: Any) -> None:
        """Beat from now on: once at once, but in the loop, so that it proves that the loop runs."""
        self.stop(consumer)
        beat = (consumer,)
        self._timers = [
            consumer.timer.call_after(0.01, self._beat, beat),
            consumer.timer.call_repeatedly(self._every_s, self._beat, beat),
        ]

    def stop(self, _consumer: Any) -> None:
        """Beat no more: the connection is lost, or the worker ends."""
        for timer in self._timers:
            timer.cancel()
        self._timers = []
        if self._known and asked_to_end():
            self._known = False
            self._write(lambda session: note_stopped(session, self._name))

    shutdown = stop

    def _beat(self, consumer: Any) -> None:
        if broker_state(self._broker_url) not in BROKER_GOOD:
            return  # the loop runs, but nothing comes in
        children = [child.pid for child in _children(consumer)]
        sign = Sign(self._name, VERSION, slots=sum(map(can_work, children)), busy=len(state.active_requests))
        note = note_seen if self._known else note_started
        if self._write(lambda session: note(session, sign)):
            self._known = True

    def _write(self, write: Callable[[Session], None]) -> bool:
        try:
            with self._engine.begin() as session:
                write(session)
        except SQLAlchemyError as error:
            if self._told:
                log.warning("no sign of life could be written: %s", error)
            self._told = False
            return False
        self._told = True
        return True


def asked_to_end() -> bool:
    """Whether Celery was told to stop."""
    # 0, an exit code, says yes
    return any(flag is not None and flag is not False for flag in (state.should_stop, state.should_terminate))


def _children(consumer: Any) -> list[Any]:
    pool = getattr(consumer.pool, "_pool", None)
    return list(getattr(pool, "_pool", None) or [])
