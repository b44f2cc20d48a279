"""SQL of the audit log."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from sqlalchemy import delete, insert, select

from app.audit.records import Action, Entry
from app.database import Session, database_time
from app.identifiers import new_identifier
from app.jobs.records import moment
from app.tables import audit_log

if TYPE_CHECKING:
    from app.http.context import Caller

TARGET_LENGTH = 160
DONE = "done"


def note(
    session: Session,
    caller: Caller,
    action: Action,
    target: str,
    *,
    detail: Mapping[str, Any] | None = None,
) -> None:
    """Record what `caller` did to the object with the id `target`, in the same transaction.

    ``detail`` holds a few small facts, never secrets or content.
    """
    insert_entry(
        session,
        action,
        owner=caller.owner,
        key_id=caller.key_id,
        target=target,
        request_id=caller.request_id,
        address=caller.address,
        detail=detail,
    )


def insert_entry(
    session: Session,
    action: Action,
    *,
    owner: str | None,
    key_id: str | None = None,
    target: str | None = None,
    outcome: str = DONE,
    request_id: str | None = None,
    address: str | None = None,
    detail: Mapping[str, Any] | None = None,
) -> None:
    """Record one action in its own transaction, so that a rollback also removes the record."""
    session.execute(
        insert(audit_log).values(
            id=new_identifier("audit"),
            at=database_time(),
            owner=owner,
            key_id=key_id,
            action=action.value,
            target=None if target is None else target[:TARGET_LENGTH],
            outcome=outcome,
            request_id=request_id or None,
            address=address or None,
            detail=None if detail is None else dict(detail),
        )
    )


def list_entries(
    session: Session,
    *,
    owner: str | None = None,
    action: str | None = None,
    limit: int,
) -> list[Entry]:
    """List entries, newest first; optionally of one owner or one kind."""
    query = select(audit_log).order_by(audit_log.c.at.desc(), audit_log.c.id.desc()).limit(limit)
    if owner is not None:
        query = query.where(audit_log.c.owner == owner)
    if action is not None:
        query = query.where(audit_log.c.action == action)
    return [Entry(**{**dict(row), "at": moment(row["at"])}) for row in session.execute(query).mappings()]


def prune(session: Session, older_than_s: float) -> int:
    """Delete entries older than a number of seconds; return how many were deleted."""
    old = delete(audit_log).where(audit_log.c.at < database_time() - older_than_s)
    return int(session.execute(old).rowcount)
