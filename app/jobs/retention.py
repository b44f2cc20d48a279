"""Deletion of old jobs, flights, delivered messages and audit entries. Models are kept.

It runs in rounds of a few rows, so that transactions are short; several processes may do so at once.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

from sqlalchemy import ColumnElement, Table, delete, select

from app.audit.repository import prune
from app.database import Session, database_time
from app.jobs.records import FINISHED
from app.settings import Settings
from app.tables import idempotency_keys, jobs, trajectories
from app.webhooks.outbox import forget_ended

DAY_S = 86_400.0
ROUND_LIMIT = 100  # rows of a table in one round: their files may be megabytes each


@dataclass(frozen=True, slots=True)
class Keep:
    """Retention in days; 0: for ever."""

    jobs: float = 0.0  # with events, results and files, counted from their end
    trajectories: float = 0.0  # uploaded flights; jobs have their own copies
    deliveries: float = 0.0  # webhook messages, counted from their end
    audit: float = 0.0  # entries of the audit log

    @classmethod
    def of(cls, settings: Settings) -> Keep:
        """Read the operator's settings."""
        return cls(**{field.name: getattr(settings, f"keep_{field.name}_days") for field in fields(cls)})


@dataclass(frozen=True, slots=True)
class Forgotten:
    """Numbers of rows deleted in one round."""

    jobs: int = 0
    trajectories: int = 0
    deliveries: int = 0
    audit: int = 0

    @property
    def more(self) -> bool:
        """Whether another round may find more."""
        return ROUND_LIMIT in (self.jobs, self.trajectories)


def forget(session: Session, keep: Keep) -> Forgotten:
    """Run one round."""
    return Forgotten(
        jobs=forget_jobs(session, keep.jobs) if keep.jobs else 0,
        trajectories=_forget_trajectories(session, keep.trajectories) if keep.trajectories else 0,
        deliveries=forget_ended(session, keep.deliveries * DAY_S) if keep.deliveries else 0,
        audit=prune(session, keep.audit * DAY_S) if keep.audit else 0,
    )


def forget_jobs(session: Session, days: float) -> int:
    """Delete older finished jobs with everything that belongs to them except their models."""
    ended = jobs.c.status.in_(FINISHED) & (jobs.c.finished_at < database_time() - days * DAY_S)
    ids = _some(session, jobs, ended)
    if ids:
        session.execute(delete(jobs).where(jobs.c.id.in_(ids)))
        session.execute(delete(idempotency_keys).where(idempotency_keys.c.job_id.in_(ids)))
    return len(ids)


def _forget_trajectories(session: Session, days: float) -> int:
    ids = _some(session, trajectories, trajectories.c.created_at < database_time() - days * DAY_S)
    if ids:
        session.execute(delete(trajectories).where(trajectories.c.id.in_(ids)))
    return len(ids)


def _some(session: Session, table: Table, old: ColumnElement[bool]) -> list[str]:
    """Ids of some old rows that no other process is deleting at the moment."""
    query = select(table.c.id).where(old).limit(ROUND_LIMIT).with_for_update(skip_locked=True)
    return list(session.scalars(query))
