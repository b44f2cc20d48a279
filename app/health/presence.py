"""The table of workers: their signs of life, and the record of a regular shutdown.

A sign identifies its process uniquely: the system reuses process numbers, and each container counts from 1.
"""

from __future__ import annotations

import os
from dataclasses import asdict, dataclass, field
from pathlib import Path

from sqlalchemy import delete, insert, update

from app.database import Session, database_time
from app.tables import workers

REMEMBERED_S = 86_400.0  # s; the row of a worker that is silent for longer is removed
PROC = Path("/proc")
START_TIME = 19  # place of the start time behind the program's name in /proc/<pid>/stat (proc(5))
ENDED = frozenset("ZXx")


@dataclass(frozen=True, slots=True)
class Sign:
    """One sign of life."""

    name: str  # of the worker's parent process, ``host:process``
    version: str
    slots: int  # its living pool children: jobs it can run at once
    busy: int  # of these, those that have a task
    process: str | None = field(default_factory=lambda: process_identity(os.getpid()))


def note_started(session: Session, sign: Sign) -> None:
    """Write a worker's first sign of life; an earlier worker of the same name is forgotten."""
    session.execute(delete(workers).where(workers.c.name == sign.name))
    session.execute(delete(workers).where(workers.c.seen_at < database_time() - REMEMBERED_S))
    _insert(session, sign)


def note_seen(session: Session, sign: Sign) -> None:
    """Write a sign of life."""
    seen = session.execute(
        update(workers)
        .where(workers.c.name == sign.name)
        .values(slots=sign.slots, busy=sign.busy, seen_at=database_time(), stopped_at=None)
    )
    if seen.rowcount == 0:  # an operator emptied the table
        _insert(session, sign)


def note_stopped(session: Session, name: str) -> None:
    """Record that a worker takes no more jobs because it is shutting down."""
    session.execute(update(workers).where(workers.c.name == name).values(stopped_at=database_time(), busy=0))


def _insert(session: Session, sign: Sign) -> None:
    now = database_time()
    session.execute(insert(workers).values(**asdict(sign), started_at=now, seen_at=now))


def process_identity(pid: int) -> str | None:
    """Identify a process of this machine uniquely; None if the system does not provide the data.

    The identity has four parts: this boot, the process namespace (each container has its own), the process
    number and the time of its start.
    """
    try:
        return "/".join((*_here(), str(pid), _stat(pid)[START_TIME]))
    except OSError:
        return None


def is_gone(identity: str | None) -> bool | None:
    """Whether a process has ended; None if it is not visible from here."""
    try:
        boot, space, pid, started = (identity or "").split("/")
        if (boot, space) != _here():
            return None
        os.kill(int(pid), 0)
    except ProcessLookupError:
        return True
    except PermissionError:
        return False
    except (OSError, ValueError):
        return None
    try:
        stat = _stat(int(pid))
    except OSError:
        return False  # it exists, perhaps as another user's
    return stat[START_TIME] != started or stat[0] in ENDED


def _here() -> tuple[str, str]:
    boot = (PROC / "sys/kernel/random/boot_id").read_text().strip()
    return boot, str((PROC / "self/ns/pid").readlink())


def _stat(pid: int) -> list[str]:
    return (PROC / str(pid) / "stat").read_text().rpartition(")")[2].split()
