"""SQL of the sender: claims with a fence and a lease, and the outcomes of tries.

A claim takes a delivery together with its destination: scheme, host and port, per owner. There is one try at
a time for each destination, and after a failure it pauses for a while, whatever else is waiting for it. Other
owners' deliveries to the same place are independent, so no owner can block another's receiver.

Any number of senders may share the table: a claim is a compare-and-set on the fence, and a stale claim can
only record a success. Locks are always taken in the same order, the webhooks of a destination before their
deliveries.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass
from random import Random
from typing import Any

from sqlalchemy import ColumnElement, Row, select, update

from app.database import Session, database_time
from app.documents import Document
from app.leases import LeasedTable
from app.tables import webhook_deliveries, webhooks
from app.webhooks.outbox import CHALLENGE_EVENT, DELIVERED, GIVEN_UP, WAITING
from app.webhooks.posting import Answer
from app.webhooks.retries import MAX_TRIES, next_delay_s

Clock = Callable[
    [], ColumnElement[float]
]  # an SQL expression: the database's time, unless a test replaces it

LEASE_S = 60.0  # s; far longer than one try and one commit can take
GONE_REASON = "The receiver answered 410 Gone: it refuses further messages."
DISABLED = "The webhook was disabled."
NEVER_SETTLED = "All senders stopped before the outcome of their try was known."
MAX_CLAIMS = (
    MAX_TRIES + 5
)  # after more tries without an outcome, the delivery itself is assumed to kill senders
MAX_ERROR = 300

DELIVERIES = LeasedTable(
    webhook_deliveries,
    key=(webhook_deliveries.c.id,),
    lease=webhook_deliveries.c.next_at,  # a delivery whose lease has ended is due again; no reaper is needed
    waiting=WAITING,
    held=(WAITING,),
    ends=(DELIVERED, GIVEN_UP),
    returning=(
        webhook_deliveries.c.webhook_id,
        webhook_deliveries.c.type,
        webhook_deliveries.c.payload,
        webhook_deliveries.c.attempt,
        webhook_deliveries.c.fence,
    ),
)


@dataclass(frozen=True, slots=True)
class Due:
    """A due delivery, as read by a sender."""

    id: str
    fence: int
    owner: str
    destination: str


@dataclass(frozen=True, slots=True)
class Dispatch:
    """A sender's right to try one delivery until its lease runs out."""

    id: str
    webhook_id: str
    owner: str
    destination: str
    url: str
    secret: str
    payload: Document
    tries: int  # including the one of this claim
    fence: int
    at: float  # of the claim, s since 1970 UTC

    @property
    def key(self) -> tuple[str]:
        """Key of the delivery's row."""
        return (self.id,)

    @property
    def challenge(self) -> str | None:
        """The value that the receiver must return; None if any 2xx is sufficient."""
        if self.payload["type"] != CHALLENGE_EVENT:
            return None
        return str(self.payload["data"]["challenge"])


def due(
    session: Session,
    limit: int,
    per_owner: int,
    under_way: Mapping[str, int] | None = None,
    clock: Clock = database_time,
) -> list[Due]:
    """Due deliveries: the longest waiting one of each free destination.

    At most `per_owner` of one owner, including those `under_way` (number by owner), so that many slow
    receivers do not delay other owners.
    """
    table, now = webhook_deliveries, clock()
    its_time = (table.c.status == WAITING, table.c.next_at <= now)
    # one index step for each webhook, however much is waiting, and one in all if nothing is
    first = select(table.c.id).where(table.c.webhook_id == webhooks.c.id, *its_time)
    first = first.order_by(table.c.next_at, table.c.id).limit(1).correlate(webhooks)
    free = (
        select(webhooks.c.owner, webhooks.c.destination, first.scalar_subquery().label("first"))
        .where(
            webhooks.c.sending_until <= now,
            webhooks.c.paused_until <= now,
            select(table.c.id).where(*its_time).exists(),
        )
        .subquery()
    )
    rows = session.execute(
        select(table.c.id, table.c.fence, free.c.owner, free.c.destination)
        .join(free, free.c.first == table.c.id)
        .order_by(table.c.next_at, table.c.id)
    )
    owners, chosen = Counter(under_way), dict[tuple[str, str], Due]()
    for row in rows:
        if (row.owner, row.destination) not in chosen and owners[row.owner] < per_owner:
            owners[row.owner] += 1
            chosen[row.owner, row.destination] = Due(*row)
    return list(chosen.values())[:limit]


def claim(
    session: Session, chosen: Collection[Due], lease_s: float = LEASE_S, clock: Clock = database_time
) -> list[Dispatch]:
    """Claim those of the chosen deliveries that no other sender has taken since, with their destinations."""
    # in the same order for all senders, to avoid deadlocks
    inorder = sorted(chosen, key=lambda item: (item.owner, item.destination))
    return [taken for seen in inorder if (taken := _claim(session, seen, lease_s, clock)) is not None]


def _claim(session: Session, seen: Due, lease_s: float, clock: Clock) -> Dispatch | None:
    hooks = _locked(session, seen.owner, seen.destination)
    now = float(session.scalar(select(clock())) or 0.0)
    free = [hook.id for hook in hooks.values() if max(hook.sending_until, hook.paused_until) <= now]
    row = DELIVERIES.claim(
        session,
        (seen.id,),
        webhook_deliveries.c.fence == seen.fence,
        webhook_deliveries.c.webhook_id.in_(free),
        lease_until=now + lease_s,
    )
    if row is None:
        return None
    hook = hooks[row.webhook_id]
    closed = hook.disabled_at is not None or (hook.verified_at is None and row.type != CHALLENGE_EVENT)
    if closed or row.attempt > MAX_CLAIMS:
        # closed: its job ended just as the webhook was disabled
        _give_up(session, webhook_deliveries.c.id == seen.id, DISABLED if closed else NEVER_SETTLED, clock)
        return None
    _set_hooks(session, hooks, sending_until=now + lease_s)
    return Dispatch(
        id=seen.id,
        webhook_id=row.webhook_id,
        owner=seen.owner,
        destination=seen.destination,
        url=hook.url,
        secret=hook.secret,
        payload=row.payload,
        tries=row.attempt,
        fence=row.fence,
        at=now,
    )


def settle(
    session: Session, dispatch: Dispatch, answer: Answer, *, rng: Random, clock: Clock = database_time
) -> str | None:
    """Record the outcome of a try: delivered, to be tried again, or given up; and free the destination.

    Returns the delivery's new status; None if the claim is stale and nothing was written.
    """
    hooks = _locked(session, dispatch.owner, dispatch.destination)
    hook = hooks.get(dispatch.webhook_id)
    held = select(webhook_deliveries.c.id).where(
        *DELIVERIES.at(dispatch.key), webhook_deliveries.c.fence == dispatch.fence
    )
    if hook is not None and session.scalar(held) is None:
        return None  # the destination also belongs to another sender now
    _set_hooks(session, hooks, sending_until=0.0)
    if hook is None:
        return None  # deleted, and its deliveries with it
    if answer.delivered:
        if not _write(session, dispatch, answer, DELIVERED, None, clock):
            return None
        _set_hooks(session, hooks, paused_until=0.0)
        verified = {} if dispatch.challenge is None else {"verified_at": clock()}
        _set_hooks(session, [hook.id], failures=0, **verified)
        return DELIVERED
    delay_s = None if answer.gone else next_delay_s(dispatch.tries, answer.retry_after_s, rng)
    status, next_at = (GIVEN_UP, None) if delay_s is None else (WAITING, clock() + delay_s)
    if not _write(session, dispatch, answer, status, next_at, clock):
        return None
    pause_s = None if answer.gone else next_delay_s(hook.failures + 1, answer.retry_after_s, rng)
    _set_hooks(session, hooks, paused_until=clock() + (pause_s or 0.0))
    _count_failure(session, hooks, hook, answer, clock)
    return status


def _locked(session: Session, owner: str, destination: str) -> dict[str, Row[Any, Any]]:
    """An owner's webhooks to a destination, by id, locked, but not against jobs that are just ending."""
    rows = session.execute(
        select(webhooks)
        .where(webhooks.c.owner == owner, webhooks.c.destination == destination)
        .order_by(webhooks.c.id)
        .with_for_update(key_share=True)
    )
    return {row.id: row for row in rows}


def release(session: Session, dispatch: Dispatch, clock: Clock = database_time) -> None:
    """Release a claim because the sender stops before it knows the outcome. The try is not counted."""
    hooks = _locked(session, dispatch.owner, dispatch.destination)
    if DELIVERIES.give_back(session, dispatch, next_at=clock()) is not None:
        _set_hooks(session, hooks, sending_until=0.0)


def _write(
    session: Session,
    dispatch: Dispatch,
    answer: Answer,
    status: str,
    next_at: ColumnElement[float] | None,
    clock: Clock,
) -> bool:
    # a success counts even if the delivery was given up meanwhile: the receiver has it
    former = (WAITING, GIVEN_UP) if status == DELIVERED else (WAITING,)
    changed = DELIVERIES.settle(
        session,
        dispatch,
        *former,
        status=status,
        next_at=next_at,
        response_status=answer.status,
        error=None if answer.error is None else answer.error[:MAX_ERROR],
        finished_at=None if status == WAITING else clock(),
    )
    return changed is not None


def _count_failure(
    session: Session, hooks: dict[str, Row[Any, Any]], tried: Row[Any, Any], answer: Answer, clock: Clock
) -> None:
    """Count a failed try, and disable webhooks that reach the limit.

    A response concerns one webhook only. Without a response the destination failed, and with it every webhook
    that has something to send there, so a dead host with twenty webhooks is tried no more often than with
    one.
    """
    failed = {tried.id}
    if answer.status is None:
        table = webhook_deliveries.c
        waiting = select(table.webhook_id).where(table.webhook_id.in_(hooks), table.status == WAITING)
        failed |= set(session.scalars(waiting.distinct()))
    _set_hooks(session, failed, failures=webhooks.c.failures + 1)
    for hook in (hooks[name] for name in sorted(failed)):
        if hook.disabled_at is not None:
            continue
        if answer.gone:
            disable(session, hook.id, GONE_REASON, clock)
        elif hook.failures + 1 >= MAX_TRIES:
            reason = f"{hook.failures + 1} tries in a row failed; the last: {answer.error}"
            disable(session, hook.id, reason, clock)


def disable(session: Session, webhook_id: str, reason: str, clock: Clock = database_time) -> None:
    """Send nothing more to a webhook; its waiting deliveries are given up."""
    _set_hooks(session, [webhook_id], disabled_at=clock(), disabled_reason=reason[:200])
    give_up_waiting(session, webhook_id, DISABLED, clock)


def give_up_waiting(session: Session, webhook_id: str, why: str, clock: Clock = database_time) -> None:
    """Give up the waiting deliveries of a webhook."""
    lock_waiting(session, webhook_id)
    _give_up(session, webhook_deliveries.c.webhook_id == webhook_id, why, clock)


def _set_hooks(session: Session, ids: Iterable[str], **values: object) -> None:
    session.execute(update(webhooks).where(webhooks.c.id.in_(list(ids))).values(**values))


def lock_waiting(session: Session, webhook_id: str) -> list[str]:
    """Ids of a webhook's waiting deliveries, locked in the order in which senders claim."""
    table = webhook_deliveries.c
    waiting = select(table.id).where(table.webhook_id == webhook_id, table.status == WAITING)
    return list(session.scalars(waiting.order_by(table.id).with_for_update()))


def _give_up(session: Session, which: ColumnElement[bool], error: str, clock: Clock) -> None:
    session.execute(
        update(webhook_deliveries)
        .where(which, webhook_deliveries.c.status == WAITING)
        .values(status=GIVEN_UP, next_at=None, error=error, finished_at=clock())
    )
