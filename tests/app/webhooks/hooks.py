"""Webhooks and jobs in the database, a clock that is turned by hand, and senders."""

from __future__ import annotations

import asyncio
import time
from dataclasses import dataclass, field
from random import Random
from types import SimpleNamespace
from typing import Any

from sqlalchemy import ColumnElement, literal, select, update

from app.database import Database, database_time
from app.identifiers import new_identifier
from app.jobs import store
from app.leases import Note
from app.tables import webhook_deliveries, webhooks
from app.webhooks import repository
from app.webhooks.outbox import note_challenge, note_end
from app.webhooks.posting import Timeouts
from app.webhooks.schemas import EVERY_EVENT
from app.webhooks.sender import SenderSettings, WebhookSender
from app.webhooks.service import new_secret
from tests.app.webhooks.receiver import TO_LOOPBACK

OWNER = "local"


@dataclass
class HandClock:
    """Stands still until it is turned."""

    now: float = field(default_factory=time.time)

    def __call__(self) -> ColumnElement[float]:
        """The time as SQL."""
        return literal(self.now)

    def turn(self, seconds: float) -> None:
        """Let time pass."""
        self.now += seconds


def new_hook(database: Database, url: str, *, owner: str = OWNER, events: list[str] | None = None) -> str:
    """Store a webhook, unchecked, whose receiver is known to want its messages; return its id."""
    with database.write() as session:
        hook = repository.insert_webhook(session, owner, url, list(events or EVERY_EVENT), new_secret())
        session.execute(update(webhooks).where(webhooks.c.id == hook.id).values(verified_at=database_time()))
    return hook.id


def challenged_hook(database: Database, url: str, *, owner: str = OWNER) -> str:
    """Store a webhook whose receiver has yet to answer; return its id."""
    with database.write() as session:
        hook = repository.insert_webhook(session, owner, url, list(EVERY_EVENT), new_secret())
        note_challenge(session, hook.id)
    return hook.id


def new_job(database: Database, owner: str = OWNER) -> str:
    """Store a queued job."""
    with database.write() as session:
        return store.create_job(session, owner=owner, operation="identify", request={}).id


def ended_job(database: Database, status: str = "succeeded", owner: str = OWNER, **end: Any) -> str:
    """Play a worker that takes and ends a job."""
    job_id = new_job(database, owner)
    with database.write() as session:
        claim = store.claim_job(session, job_id, "a test")
        assert claim is not None
        assert store.finish_job(session, claim, status, **end)
    return job_id


def many_ends(database: Database, count: int, owner: str = OWNER) -> None:
    """Let so many jobs end, as far as the outbox sees of it."""
    with database.write() as session:
        for _ in range(count):
            row: Any = SimpleNamespace(
                id=new_identifier("job"),
                owner=owner,
                operation="identify",
                status="succeeded",
                finished_at=time.time(),
                error=None,
                model_id=None,
            )
            note_end(session, row, Note("succeeded"))


def deliveries(database: Database, **equal: Any) -> list[Any]:
    """Rows of deliveries, oldest first."""
    query = select(webhook_deliveries).order_by(webhook_deliveries.c.id)
    for name, value in equal.items():
        query = query.where(webhook_deliveries.c[name] == value)
    with database.read() as session:
        return list(session.execute(query).all())


def hook_row(database: Database, hook_id: str) -> Any:
    """Row of a webhook."""
    with database.read() as session:
        return session.execute(select(webhooks).where(webhooks.c.id == hook_id)).one()


def sender(database: Database, **settings: Any) -> WebhookSender:
    """A sender to whom loopback is the internet."""
    chosen: dict[str, Any] = {
        "policy": TO_LOOPBACK,
        "timeouts": Timeouts(2.0, 2.0, 4.0),
        "poll_s": 0.02,
        "rng": Random(1),
        **settings,
    }
    return WebhookSender(database, SenderSettings(**chosen))


def send_due(database: Database, **settings: Any) -> int:
    """Send what is due now, once, and count the tries."""
    return asyncio.run(sender(database, **settings).send_due())
