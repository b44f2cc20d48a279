"""The outbox: a job's end and its deliveries are written in one transaction.

Workers import it: nothing here speaks HTTP.
"""

from __future__ import annotations

import secrets

from sqlalchemy import delete, insert, select

from app.database import Session, current_time, database_time, insert_new
from app.documents import Document
from app.identifiers import new_identifier
from app.jobs.records import moment
from app.leases import LeasedRow, Note
from app.tables import models, webhook_deliveries, webhooks

WAITING = "waiting"
DELIVERED = "delivered"
GIVEN_UP = "given_up"

TEST_EVENT = "webhook.test"
CHALLENGE_EVENT = "webhook.challenge"
CHALLENGE_BYTES = 24
ERROR_MEMBERS = ("code", "detail", "hint")
MAX_DETAIL = 1000  # characters of an error message; the job itself keeps the whole


def note_end(session: Session, row: LeasedRow, _note: Note) -> None:
    """Write one delivery for each of the owner's webhooks that has subscribed to this end of a job."""
    event = f"job.{row.status}"
    # key share: a webhook that is just being deleted must not make the job's end fail
    hooks = session.execute(
        select(webhooks.c.id, webhooks.c.events)
        .where(
            webhooks.c.owner == row.owner,
            webhooks.c.verified_at.is_not(None),
            webhooks.c.disabled_at.is_(None),
        )
        .order_by(webhooks.c.id)
        .with_for_update(read=True, key_share=True)
    ).all()
    for hook in hooks:
        if event in hook.events:
            session.execute(
                insert_new(session, webhook_deliveries)
                .values(new_delivery(hook.id, event, _ended(session, event, row), job_id=row.id))
                .on_conflict_do_nothing()
            )


def new_delivery(webhook_id: str, event: str, payload: Document, *, job_id: str | None = None) -> Document:
    """Columns of a delivery to be sent at once."""
    return {
        "id": new_identifier("msg"),
        "webhook_id": webhook_id,
        "job_id": job_id,
        "type": event,
        "payload": payload,
        "status": WAITING,
        "attempt": 0,
        "fence": 0,
        "next_at": database_time(),
        "created_at": database_time(),
    }


def note_challenge(session: Session, webhook_id: str) -> str:
    """Write a delivery that the receiver must answer before it is sent anything else; return its id."""
    challenge = secrets.token_urlsafe(CHALLENGE_BYTES)
    return note_message(session, webhook_id, CHALLENGE_EVENT, challenge=challenge)


def note_message(session: Session, webhook_id: str, event: str, **data: str) -> str:
    """Write a delivery that is about the webhook itself, and return its id."""
    at = moment(current_time(session))
    payload = {"type": event, "timestamp": at.isoformat(), "data": {"webhook_id": webhook_id, **data}}
    values = new_delivery(webhook_id, event, payload)
    session.execute(insert(webhook_deliveries).values(values))
    return str(values["id"])


def forget_ended(session: Session, older_than_s: float) -> int:
    """Delete deliveries that ended longer ago; return their number."""
    return session.execute(
        delete(webhook_deliveries).where(
            webhook_deliveries.c.status.in_((DELIVERED, GIVEN_UP)),
            webhook_deliveries.c.finished_at < database_time() - older_than_s,
        )
    ).rowcount


def _ended(session: Session, event: str, row: LeasedRow) -> Document:
    at = f"/jobs/{row.id}"
    error = row.error and {name: str(row.error.get(name, ""))[:MAX_DETAIL] for name in ERROR_MEMBERS}
    return {
        "type": event,
        "timestamp": moment(row.finished_at).isoformat(),
        "data": {
            "id": row.id,
            "operation": row.operation,
            "status": row.status,
            "error": error or None,
            "model_id": session.scalar(select(models.c.id).where(models.c.job_id == row.id)),
            "links": {"self": at, "result": f"{at}/result", "artifacts": f"{at}/artifacts"},
        },
    }
