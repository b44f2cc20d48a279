"""The table of workers as they write it: signs of life, and the sign that one ended as it should."""

from __future__ import annotations

from dataclasses import dataclass, field

from sqlalchemy import delete, insert, update

from app.database import Session, database_time
from app.health.processes import own_identity
from app.tables import workers

REMEMBERED_S = 86_400.0  # a worker that is silent for longer is gone: its row is old news


@dataclass(frozen=True, slots=True)
class Sign:
    """One sign of life.

    Attributes
    ----------
    name : str
        Of the worker's parent process, ``host:process``.
    version : str
        Of the program.
    slots : int
        Its living pool children: jobs it can run at once.
    busy : int
        Of these, those that have a task.
    process : str or None
        Who signs, as `app.health.processes` names it: the process that makes the sign.
    """

    name: str
    version: str
    slots: int
    busy: int
    process: str | None = field(default_factory=own_identity)


def note_started(session: Session, sign: Sign) -> None:
    """Write a worker's first sign of life; a namesake before it (a container's process 1) is forgotten."""
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
    """Write that a worker takes no more jobs because it was asked to end."""
    session.execute(update(workers).where(workers.c.name == name).values(stopped_at=database_time(), busy=0))


def _insert(session: Session, sign: Sign) -> None:
    session.execute(
        insert(workers).values(
            name=sign.name,
            version=sign.version,
            slots=sign.slots,
            busy=sign.busy,
            process=sign.process,
            started_at=database_time(),
            seen_at=database_time(),
        )
    )
