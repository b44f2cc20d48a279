"""What endpoints ask of webhooks."""

from __future__ import annotations

from app.database import Session
from app.errors import InvalidRequest, TooManyWebhooks, WebhookDisabled, WebhookPending
from app.webhooks import repository
from app.webhooks.addresses import AddressPolicy, AddressRefused
from app.webhooks.outbox import note_challenge, note_test
from app.webhooks.repository import StoredDelivery, StoredWebhook
from app.webhooks.schemas import (
    Delivery,
    DeliveryPage,
    NewWebhook,
    Webhook,
    WebhookList,
    WebhookRequest,
    WebhookStatus,
)
from app.webhooks.signature import new_secret
from morphdata.faults import Fault

MAX_WEBHOOKS = 20  # of one owner


def _shown(hook: StoredWebhook) -> Webhook:
    return Webhook(
        id=hook.id,
        url=hook.url,
        events=hook.events,
        status=_status(hook),
        enabled=_status(hook) == "enabled",
        disabled_at=hook.disabled_at,
        disabled_reason=hook.disabled_reason,
        failures=hook.failures,
        created_at=hook.created_at,
    )


def _status(hook: StoredWebhook) -> WebhookStatus:
    if hook.disabled_at is not None:
        return "disabled"
    return "pending" if hook.verified_at is None else "enabled"


def _shown_delivery(delivery: StoredDelivery) -> Delivery:
    return Delivery(
        id=delivery.id,
        type=delivery.type,
        job_id=delivery.job_id,
        status=delivery.status,
        tries=delivery.attempt,
        response_status=delivery.response_status,
        error=delivery.error,
        created_at=delivery.created_at,
        next_try_at=delivery.next_at,
        finished_at=delivery.finished_at,
    )


def check_address(policy: AddressPolicy, url: str) -> None:
    """Refuse an address that nothing would be sent to; looks the name up, so not inside a transaction.

    Raises
    ------
    InvalidRequest
    """
    try:
        policy.check_now(url)
    except AddressRefused as error:
        raise InvalidRequest.of([Fault("address_refused", str(error), "/url", error.hint)]) from None


def create(session: Session, owner: str, request: WebhookRequest) -> NewWebhook:
    """Store a webhook, make its secret, and have its receiver challenged.

    Raises
    ------
    TooManyWebhooks
    """
    if repository.count_webhooks(session, owner) >= MAX_WEBHOOKS:
        raise TooManyWebhooks(MAX_WEBHOOKS)
    secret = new_secret()
    stored = repository.insert_webhook(session, owner, request.url, list(request.events), secret)
    note_challenge(session, stored.id)
    return NewWebhook(**_shown(stored).model_dump(), secret=secret)


def listing(session: Session, owner: str) -> WebhookList:
    """Every webhook of the owner."""
    return WebhookList(webhooks=[_shown(hook) for hook in repository.list_webhooks(session, owner)])


def get(session: Session, owner: str, webhook_id: str) -> Webhook:
    """One webhook."""
    return _shown(repository.get_webhook(session, owner, webhook_id))


def enable(session: Session, owner: str, webhook_id: str) -> Webhook:
    """Challenge the receiver of a disabled or pending webhook anew; leave an enabled one as it is."""
    hook = repository.get_webhook(session, owner, webhook_id)
    if _status(hook) != "enabled":
        hook = repository.reopen_webhook(session, owner, webhook_id)
        note_challenge(session, webhook_id)
    return _shown(hook)


def test(session: Session, owner: str, webhook_id: str) -> Delivery:
    """Write a test message.

    Raises
    ------
    WebhookDisabled, WebhookPending
    """
    status = _status(repository.get_webhook(session, owner, webhook_id))
    if status == "disabled":
        raise WebhookDisabled(webhook_id)
    if status == "pending":
        raise WebhookPending(webhook_id)
    delivery_id = note_test(session, webhook_id)
    return _shown_delivery(repository.get_delivery(session, delivery_id))


def delivery_page(
    session: Session, owner: str, webhook_id: str, *, cursor: str | None, limit: int
) -> DeliveryPage:
    """One page of a webhook's deliveries, newest first."""
    found = repository.list_deliveries(session, owner, webhook_id, before=cursor, limit=limit + 1)
    shown = found[:limit]
    return DeliveryPage(
        deliveries=[_shown_delivery(delivery) for delivery in shown],
        next_cursor=shown[-1].id if len(found) > limit else None,
    )
