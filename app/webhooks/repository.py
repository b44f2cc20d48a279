"""SQL of webhooks as their owner sees them; every statement is filtered by owner."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import Column, ColumnElement, Row, delete, func, insert, select, update

from app.database import Session, database_time, insert_new
from app.errors import WebhookNotFound
from app.identifiers import new_identifier
from app.jobs.records import moment, optional_moment
from app.tables import owners, webhook_deliveries, webhooks
from app.webhooks.addresses import destination_of
from app.webhooks.deliveries import give_up_waiting, lock_waiting
from app.webhooks.outbox import WAITING

REOPENED = "A new challenge took its place."

COLUMNS = (
    webhooks.c.id,
    webhooks.c.url,
    webhooks.c.events,
    webhooks.c.failures,
    webhooks.c.verified_at,
    webhooks.c.disabled_at,
    webhooks.c.disabled_reason,
    webhooks.c.created_at,
)


@dataclass(frozen=True, slots=True)
class StoredWebhook:
    """One webhook without its secret."""

    id: str
    url: str
    events: list[str]
    failures: int
    verified_at: datetime | None
    disabled_at: datetime | None
    disabled_reason: str | None
    created_at: datetime


@dataclass(frozen=True, slots=True)
class StoredDelivery:
    """One delivery without its payload."""

    id: str
    type: str
    job_id: str | None
    status: str
    attempt: int
    response_status: int | None
    error: str | None
    created_at: datetime
    next_at: datetime | None
    finished_at: datetime | None


def _webhook(row: Row[*tuple[Any, ...]]) -> StoredWebhook:
    return StoredWebhook(
        id=row.id,
        url=row.url,
        events=row.events,
        failures=row.failures,
        verified_at=optional_moment(row.verified_at),
        disabled_at=optional_moment(row.disabled_at),
        disabled_reason=row.disabled_reason,
        created_at=moment(row.created_at),
    )


def insert_webhook(session: Session, owner: str, url: str, events: list[str], secret: str) -> StoredWebhook:
    """Store a webhook whose address was checked and whose receiver has not answered yet."""
    destination = destination_of(url)
    others = (webhooks.c.owner == owner, webhooks.c.destination == destination)

    def of_others(column: Column[float]) -> ColumnElement[float]:
        return func.coalesce(select(func.max(column)).where(*others).scalar_subquery(), 0.0)

    row = session.execute(
        insert(webhooks)
        .values(
            id=new_identifier("hook"),
            owner=owner,
            url=url,
            destination=destination,
            sending_until=of_others(webhooks.c.sending_until),
            paused_until=of_others(webhooks.c.paused_until),
            events=events,
            secret=secret,
            failures=0,
            created_at=database_time(),
        )
        .returning(*COLUMNS)
    ).one()
    return _webhook(row)


def count_webhooks(session: Session, owner: str) -> int:
    """Count the owner's webhooks; until the transaction ends nobody else counts or makes any of them."""
    session.execute(insert_new(session, owners).values(owner=owner).on_conflict_do_nothing())
    session.execute(select(owners.c.owner).where(owners.c.owner == owner).with_for_update())
    count = session.scalar(select(func.count()).select_from(webhooks).where(webhooks.c.owner == owner))
    return count or 0


def list_webhooks(session: Session, owner: str) -> list[StoredWebhook]:
    """Every webhook of `owner`, newest first."""
    rows = session.execute(select(*COLUMNS).where(webhooks.c.owner == owner).order_by(webhooks.c.id.desc()))
    return [_webhook(row) for row in rows]


def get_webhook(session: Session, owner: str, webhook_id: str) -> StoredWebhook:
    """Read one webhook.

    Raises
    ------
    WebhookNotFound
        When `owner` has no such webhook.
    """
    row = session.execute(
        select(*COLUMNS).where(webhooks.c.id == webhook_id, webhooks.c.owner == owner)
    ).one_or_none()
    if row is None:
        raise WebhookNotFound(webhook_id)
    return _webhook(row)


def delete_webhook(session: Session, owner: str, webhook_id: str) -> None:
    """Delete a webhook with its deliveries.

    Raises
    ------
    WebhookNotFound
        When `owner` has no such webhook.
    """
    found = session.execute(
        select(webhooks.c.id).where(webhooks.c.id == webhook_id, webhooks.c.owner == owner).with_for_update()
    ).one_or_none()
    if found is None:
        raise WebhookNotFound(webhook_id)
    lock_waiting(session, webhook_id)  # as senders do it: no two wait for each other
    session.execute(delete(webhooks).where(webhooks.c.id == webhook_id, webhooks.c.owner == owner))


def reopen_webhook(session: Session, owner: str, webhook_id: str) -> StoredWebhook:
    """Forget a webhook's failures and its receiver's answer; what still waits for it is given up.

    Raises
    ------
    WebhookNotFound
        When `owner` has no such webhook.
    """
    row = session.execute(
        update(webhooks)
        .where(webhooks.c.id == webhook_id, webhooks.c.owner == owner)
        .values(failures=0, paused_until=0.0, verified_at=None, disabled_at=None, disabled_reason=None)
        .returning(*COLUMNS)
    ).one_or_none()
    if row is None:
        raise WebhookNotFound(webhook_id)
    give_up_waiting(session, webhook_id, REOPENED)
    return _webhook(row)


def list_deliveries(
    session: Session, owner: str, webhook_id: str, *, before: str | None, limit: int
) -> list[StoredDelivery]:
    """Newest deliveries of a webhook first, older than the id `before` when given.

    Raises
    ------
    WebhookNotFound
        When `owner` has no such webhook.
    """
    get_webhook(session, owner, webhook_id)
    table = webhook_deliveries
    query = select(table).where(table.c.webhook_id == webhook_id).order_by(table.c.id.desc()).limit(limit)
    if before is not None:
        query = query.where(table.c.id < before)
    return [_delivery(row) for row in session.execute(query)]


def get_delivery(session: Session, delivery_id: str) -> StoredDelivery:
    """Read a delivery that this very transaction has written."""
    row = session.execute(select(webhook_deliveries).where(webhook_deliveries.c.id == delivery_id)).one()
    return _delivery(row)


def _delivery(row: Row[*tuple[Any, ...]]) -> StoredDelivery:
    return StoredDelivery(
        id=row.id,
        type=row.type,
        job_id=row.job_id,
        status=row.status,
        attempt=row.attempt,
        response_status=row.response_status,
        error=row.error,
        created_at=moment(row.created_at),
        next_at=optional_moment(row.next_at) if row.status == WAITING else None,
        finished_at=optional_moment(row.finished_at),
    )
