"""SQL of webhooks as their owner sees them; every statement is filtered by owner."""

from __future__ import annotations

from typing import Any

from sqlalchemy import Column, ColumnElement, Row, delete, func, insert, select, update

from app.database import Session, database_time, insert_new
from app.errors import WebhookNotFound
from app.identifiers import new_identifier
from app.pages import read_page
from app.tables import owners, webhook_deliveries, webhooks
from app.webhooks.addresses import destination_of
from app.webhooks.deliveries import give_up_waiting, lock_waiting
from app.webhooks.outbox import WAITING
from app.webhooks.schemas import Delivery, DeliveryPage, Webhook

REOPENED = "Replaced by a new challenge."

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


def _webhook(row: Row[*tuple[Any, ...]]) -> Webhook:
    status = "pending" if row.verified_at is None else "enabled"
    if row.disabled_at is not None:
        status = "disabled"
    columns = dict(row._mapping)  # noqa: SLF001 - SQLAlchemy's documented name
    return Webhook.model_validate({**columns, "status": status, "enabled": status == "enabled"})


def insert_webhook(session: Session, owner: str, url: str, events: list[str], secret: str) -> Webhook:
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
    """Count the owner's webhooks; a lock blocks other counts and creations until the transaction ends."""
    session.execute(insert_new(session, owners).values(owner=owner).on_conflict_do_nothing())
    session.execute(select(owners.c.owner).where(owners.c.owner == owner).with_for_update())
    count = session.scalar(select(func.count()).select_from(webhooks).where(webhooks.c.owner == owner))
    return count or 0


def list_webhooks(session: Session, owner: str) -> list[Webhook]:
    """Every webhook of `owner`, newest first."""
    rows = session.execute(select(*COLUMNS).where(webhooks.c.owner == owner).order_by(webhooks.c.id.desc()))
    return [_webhook(row) for row in rows]


def get_webhook(session: Session, owner: str, webhook_id: str) -> Webhook:
    """Read one webhook, or raise `WebhookNotFound`."""
    row = session.execute(
        select(*COLUMNS).where(webhooks.c.id == webhook_id, webhooks.c.owner == owner)
    ).one_or_none()
    if row is None:
        raise WebhookNotFound(webhook_id)
    return _webhook(row)


def delete_webhook(session: Session, owner: str, webhook_id: str) -> None:
    """Delete a webhook with its deliveries, or raise `WebhookNotFound`."""
    mine = (webhooks.c.id == webhook_id, webhooks.c.owner == owner)
    if session.scalar(select(webhooks.c.id).where(*mine).with_for_update()) is None:
        raise WebhookNotFound(webhook_id)
    lock_waiting(session, webhook_id)  # in the same order as senders, to avoid deadlocks
    session.execute(delete(webhooks).where(*mine))


def reopen_webhook(session: Session, owner: str, webhook_id: str) -> Webhook:
    """Reset a webhook's failures and its receiver's answer; its waiting deliveries are given up."""
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
    session: Session, owner: str, webhook_id: str, *, cursor: str | None, limit: int
) -> DeliveryPage:
    """One page of a webhook's deliveries, or raise `WebhookNotFound`."""
    get_webhook(session, owner, webhook_id)
    query = select(webhook_deliveries).where(webhook_deliveries.c.webhook_id == webhook_id)
    rows, next_cursor = read_page(session, query, webhook_deliveries.c.id, cursor=cursor, limit=limit)
    return DeliveryPage(deliveries=[_delivery(row) for row in rows], next_cursor=next_cursor)


def get_delivery(session: Session, delivery_id: str) -> Delivery:
    """Read a delivery written in this transaction."""
    row = session.execute(select(webhook_deliveries).where(webhook_deliveries.c.id == delivery_id)).one()
    return _delivery(row)


def _delivery(row: Row[*tuple[Any, ...]]) -> Delivery:
    next_try_at = row.next_at if row.status == WAITING else None
    columns = dict(row._mapping)  # noqa: SLF001 - SQLAlchemy's documented name
    return Delivery.model_validate({**columns, "tries": row.attempt, "next_try_at": next_try_at})
