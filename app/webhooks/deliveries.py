"""SQL of the sender: claims with a fence and a lease, and what became of a try.

Any number of senders may share the table: a claim is a compare-and-set on the fence, and a stale claim writes
nothing but a success. Locks are taken in one order, the webhook before its deliveries.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass
from random import Random
from typing import Any

from sqlalchemy import ColumnElement, Row, func, select, update

from app.database import Session, database_time
from app.documents import Document
from app.tables import webhook_deliveries, webhooks
from app.webhooks.outbox import DELIVERED, GIVEN_UP, WAITING
from app.webhooks.posting import Answer
from app.webhooks.retries import MAX_TRIES, next_delay_s

Clock = Callable[[], ColumnElement[float]]  # an SQL expression: the database's time unless a test says other

LEASE_S = 60.0  # far beyond the patience with one receiver and one commit
GONE_REASON = "The receiver answered 410 Gone: it wants no more messages."
DISABLED = "The webhook was disabled."
NEVER_SETTLED = "Every sender ended before it knew what became of its try."
MAX_CLAIMS = MAX_TRIES + 5  # more: senders die over this delivery
MAX_ERROR = 300


@dataclass(frozen=True, slots=True)
class Due:
    """A delivery whose time has come, as a sender saw it."""

    id: str
    fence: int
    owner: str


@dataclass(frozen=True, slots=True)
class Dispatch:
    """A sender's right to try one delivery until its lease runs out.

    Attributes
    ----------
    tries : int
        With the one that this claim is for.
    at : float
        Of the claim, s since 1970 UTC.
    """

    id: str
    webhook_id: str
    owner: str
    url: str
    secret: str
    payload: Document
    tries: int
    fence: int
    at: float


def due(
    session: Session, limit: int, per_owner: int, busy: Collection[str] = (), clock: Clock = database_time
) -> list[Due]:
    """Deliveries whose time has come, the longest waiting first.

    Parameters
    ----------
    per_owner : int
        At most so many of one owner: thousands that wait for a slow receiver do not hold up the others.
    busy
        Owners who have as many under way as they may.
    """
    table = webhook_deliveries
    rank = func.row_number().over(partition_by=webhooks.c.owner, order_by=(table.c.next_at, table.c.id))
    waiting = (
        select(table.c.id, table.c.fence, table.c.next_at, webhooks.c.owner, rank.label("rank"))
        .join(webhooks, webhooks.c.id == table.c.webhook_id)
        .where(table.c.status == WAITING, table.c.next_at <= clock(), webhooks.c.owner.not_in(busy))
        .subquery()
    )
    rows = session.execute(
        select(waiting.c.id, waiting.c.fence, waiting.c.owner)
        .where(waiting.c.rank <= per_owner)
        .order_by(waiting.c.next_at, waiting.c.id)
        .limit(limit)
    )
    return [Due(row.id, row.fence, row.owner) for row in rows]


def claim(
    session: Session, chosen: Collection[Due], lease_s: float = LEASE_S, clock: Clock = database_time
) -> list[Dispatch]:
    """Take those of the chosen deliveries that no other sender has taken since."""
    taken = []
    # in one order for all senders: none waits for another in a ring
    for seen in sorted(chosen, key=lambda item: item.id):
        row = session.execute(
            update(webhook_deliveries)
            .where(
                webhook_deliveries.c.id == seen.id,
                webhook_deliveries.c.fence == seen.fence,
                webhook_deliveries.c.status == WAITING,
            )
            .values(
                fence=seen.fence + 1,
                attempt=webhook_deliveries.c.attempt + 1,
                next_at=clock() + lease_s,
            )
            .returning(
                webhook_deliveries.c.webhook_id,
                webhook_deliveries.c.payload,
                webhook_deliveries.c.attempt,
                clock().label("at"),
            )
        ).one_or_none()
        if row is None:
            continue
        hook = session.execute(
            select(webhooks.c.url, webhooks.c.secret, webhooks.c.disabled_at).where(
                webhooks.c.id == row.webhook_id
            )
        ).one()
        if hook.disabled_at is not None:  # its job ended in the moment in which the webhook was disabled
            _give_up(session, webhook_deliveries.c.id == seen.id, DISABLED, clock)
            continue
        if row.attempt > MAX_CLAIMS:
            _give_up(session, webhook_deliveries.c.id == seen.id, NEVER_SETTLED, clock)
            continue
        taken.append(
            Dispatch(
                id=seen.id,
                webhook_id=row.webhook_id,
                owner=seen.owner,
                url=hook.url,
                secret=hook.secret,
                payload=row.payload,
                tries=row.attempt,
                fence=seen.fence + 1,
                at=row.at,
            )
        )
    return taken


def settle(
    session: Session,
    dispatch: Dispatch,
    answer: Answer,
    *,
    rng: Random,
    disable_after: int,
    clock: Clock = database_time,
) -> str | None:
    """Write what became of a try: delivered, to be tried again, or given up.

    Parameters
    ----------
    disable_after : int
        The webhook is disabled when so many deliveries in a row were given up.

    Returns
    -------
    str or None
        The delivery's status now; None when the claim is stale, and nothing was written.
    """
    hook = session.execute(
        select(webhooks.c.failures, webhooks.c.disabled_at)
        .where(webhooks.c.id == dispatch.webhook_id)
        .with_for_update(key_share=True)  # jobs that end at this moment need not wait
    ).one_or_none()
    if hook is None:
        return None  # deleted, and its deliveries with it
    if answer.delivered:
        written = _write(session, dispatch, answer, DELIVERED, None, clock)
        if written and hook.failures:
            _set_hook(session, dispatch.webhook_id, failures=0)
        return DELIVERED if written else None
    delay_s = None if answer.gone else next_delay_s(dispatch.tries, answer.retry_after_s, rng)
    if delay_s is not None:
        return WAITING if _write(session, dispatch, answer, WAITING, clock() + delay_s, clock) else None
    if not _write(session, dispatch, answer, GIVEN_UP, None, clock):
        return None
    _count_failure(session, dispatch.webhook_id, hook, answer, disable_after, clock)
    return GIVEN_UP


def release(session: Session, dispatch: Dispatch, clock: Clock = database_time) -> None:
    """Give a claim back: the sender stops before it knows the answer. The try is not counted."""
    session.execute(
        update(webhook_deliveries)
        .where(*_held(dispatch), webhook_deliveries.c.status == WAITING)
        .values(next_at=clock(), attempt=webhook_deliveries.c.attempt - 1)
    )


def _held(dispatch: Dispatch) -> tuple[ColumnElement[bool], ...]:
    return webhook_deliveries.c.id == dispatch.id, webhook_deliveries.c.fence == dispatch.fence


def _write(
    session: Session,
    dispatch: Dispatch,
    answer: Answer,
    status: str,
    next_at: ColumnElement[float] | None,
    clock: Clock,
) -> bool:
    # a success counts even where the delivery was given up meanwhile: the receiver has it
    former = (WAITING, GIVEN_UP) if status == DELIVERED else (WAITING,)
    changed = session.execute(
        update(webhook_deliveries)
        .where(*_held(dispatch), webhook_deliveries.c.status.in_(former))
        .values(
            status=status,
            next_at=next_at,
            response_status=answer.status,
            error=None if answer.error is None else answer.error[:MAX_ERROR],
            finished_at=None if status == WAITING else clock(),
        )
    )
    return changed.rowcount == 1


def _count_failure(
    session: Session,
    webhook_id: str,
    hook: Row[Any, Any],
    answer: Answer,
    disable_after: int,
    clock: Clock,
) -> None:
    failures = hook.failures + 1
    _set_hook(session, webhook_id, failures=failures)
    if hook.disabled_at is not None:
        return
    if answer.gone:
        disable(session, webhook_id, GONE_REASON, clock)
    elif failures >= disable_after:
        reason = f"{failures} deliveries in a row were given up; the last: {answer.error}"
        disable(session, webhook_id, reason, clock)


def disable(session: Session, webhook_id: str, reason: str, clock: Clock = database_time) -> None:
    """Send nothing more to a webhook; what waits for it is given up."""
    _set_hook(session, webhook_id, disabled_at=clock(), disabled_reason=reason[:200])
    lock_waiting(session, webhook_id)
    _give_up(session, webhook_deliveries.c.webhook_id == webhook_id, DISABLED, clock)


def _set_hook(session: Session, webhook_id: str, **values: object) -> None:
    session.execute(update(webhooks).where(webhooks.c.id == webhook_id).values(**values))


def lock_waiting(session: Session, webhook_id: str) -> list[str]:
    """Ids of a webhook's waiting deliveries, locked in the order in which senders claim."""
    return list(
        session.scalars(
            select(webhook_deliveries.c.id)
            .where(webhook_deliveries.c.webhook_id == webhook_id, webhook_deliveries.c.status == WAITING)
            .order_by(webhook_deliveries.c.id)
            .with_for_update()
        )
    )


def _give_up(session: Session, which: ColumnElement[bool], error: str, clock: Clock) -> None:
    session.execute(
        update(webhook_deliveries)
        .where(which, webhook_deliveries.c.status == WAITING)
        .values(status=GIVEN_UP, next_at=None, error=error, finished_at=clock())
    )
