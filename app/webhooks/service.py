"""Creating, enabling and testing webhooks."""

from __future__ import annotations

import base64
import secrets

from app.database import Session
from app.errors import InvalidRequest, TooManyWebhooks, WebhookDisabled, WebhookPending
from app.webhooks import repository
from app.webhooks.addresses import AddressPolicy, AddressRefused
from app.webhooks.outbox import TEST_EVENT, note_challenge, note_message
from app.webhooks.schemas import Delivery, NewWebhook, Webhook, WebhookRequest
from morphdata.faults import Fault

MAX_WEBHOOKS = 20  # of one owner
SECRET_BYTES = 32  # Standard Webhooks requires 24 to 64


def check_address(policy: AddressPolicy, url: str) -> None:
    """Refuse an address that webhooks may not use; resolves the name, so call it outside transactions."""
    try:
        policy.check_now(url)
    except AddressRefused as error:
        raise InvalidRequest.of([Fault("address_refused", str(error), "/url", error.hint)]) from None


def new_secret() -> str:
    """Make a secret in the form used by libraries of Standard Webhooks."""
    return "whsec_" + base64.b64encode(secrets.token_bytes(SECRET_BYTES)).decode()


def create(session: Session, owner: str, request: WebhookRequest) -> NewWebhook:
    """Store a webhook, make its secret, and have its receiver challenged."""
    if repository.count_webhooks(session, owner) >= MAX_WEBHOOKS:
        raise TooManyWebhooks(f"You have {MAX_WEBHOOKS} webhooks.")
    secret = new_secret()
    stored = repository.insert_webhook(session, owner, request.url, list(request.events), secret)
    note_challenge(session, stored.id)
    return NewWebhook(**stored.model_dump(), secret=secret)


def enable(session: Session, owner: str, webhook_id: str) -> Webhook:
    """Challenge the receiver of a disabled or pending webhook again; an enabled one is unchanged."""
    hook = repository.get_webhook(session, owner, webhook_id)
    if not hook.enabled:
        hook = repository.reopen_webhook(session, owner, webhook_id)
        note_challenge(session, webhook_id)
    return hook


def test(session: Session, owner: str, webhook_id: str) -> Delivery:
    """Write a test message."""
    status = repository.get_webhook(session, owner, webhook_id).status
    if status == "disabled":
        raise WebhookDisabled(f"Webhook {webhook_id} is disabled.")
    if status == "pending":
        raise WebhookPending(f"The receiver of webhook {webhook_id} has not answered the challenge yet.")
    return repository.get_delivery(session, note_message(session, webhook_id, TEST_EVENT))
