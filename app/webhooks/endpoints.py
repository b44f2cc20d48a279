"""Endpoints of webhooks."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Path

from app.audit.records import Action
from app.audit.repository import note
from app.errors import (
    BodyTooLarge,
    InvalidRequest,
    MalformedBody,
    TooManyWebhooks,
    UnsupportedMediaType,
    WebhookDisabled,
    WebhookNotFound,
    WebhookPending,
)
from app.http.context import CallerDep, OwnerDep, ServiceDep, demands
from app.http.json_body import JsonRoute
from app.http.parameters import ID_PATTERN, CursorQuery, LimitQuery
from app.http.problems import documented
from app.keys.records import Scope
from app.webhooks import repository, service
from app.webhooks.schemas import (
    EXAMPLE_WEBHOOK,
    Challenge,
    ChallengeAnswer,
    Delivery,
    DeliveryPage,
    Message,
    NewWebhook,
    Webhook,
    WebhookList,
    WebhookRequest,
)

router = APIRouter(tags=["webhooks"], route_class=JsonRoute, dependencies=[demands(Scope.WEBHOOKS)])

WebhookId = Annotated[str, Path(pattern=ID_PATTERN, examples=[EXAMPLE_WEBHOOK])]


@router.post(
    "/webhooks",
    operation_id="create_webhook",
    summary="Create a webhook",
    status_code=201,
    responses=documented(MalformedBody, BodyTooLarge, UnsupportedMediaType, InvalidRequest, TooManyWebhooks),
)
def create_webhook(app: ServiceDep, caller: CallerDep, request: WebhookRequest) -> NewWebhook:
    """Register an address; only this response contains the secret that signs every message.

    The webhook is `pending` until its receiver answers the `webhook.challenge`, which is sent at once.
    Messages follow Standard Webhooks. Each end of a job is sent at least once, in no fixed order.
    """
    service.check_address(app.webhook_policy, request.url)
    with app.database.write() as session:
        made = service.create(session, caller.owner, request)
        note(session, caller, Action.WEBHOOK_CREATE, made.id)
        return made


@router.get("/webhooks", operation_id="list_webhooks", summary="List webhooks")
def list_webhooks(app: ServiceDep, owner: OwnerDep) -> WebhookList:
    """Your webhooks, newest first."""
    with app.database.read() as session:
        return WebhookList(webhooks=repository.list_webhooks(session, owner))


@router.get(
    "/webhooks/{webhook_id}",
    operation_id="get_webhook",
    summary="Look at a webhook",
    responses=documented(InvalidRequest, WebhookNotFound),
)
def get_webhook(app: ServiceDep, owner: OwnerDep, webhook_id: WebhookId) -> Webhook:
    """Address, events and, if it is disabled, the reason."""
    with app.database.read() as session:
        return repository.get_webhook(session, owner, webhook_id)


@router.delete(
    "/webhooks/{webhook_id}",
    operation_id="delete_webhook",
    summary="Delete a webhook",
    status_code=204,
    responses=documented(InvalidRequest, WebhookNotFound),
)
def delete_webhook(app: ServiceDep, caller: CallerDep, webhook_id: WebhookId) -> None:
    """Delete a webhook with its deliveries, sent or not."""
    with app.database.write() as session:
        repository.delete_webhook(session, caller.owner, webhook_id)
        note(session, caller, Action.WEBHOOK_DELETE, webhook_id)


@router.post(
    "/webhooks/{webhook_id}/enable",
    operation_id="enable_webhook",
    summary="Enable a webhook",
    responses=documented(InvalidRequest, WebhookNotFound),
)
def enable_webhook(app: ServiceDep, caller: CallerDep, webhook_id: WebhookId) -> Webhook:
    """Challenge the receiver of a disabled or pending webhook again; its answer enables the webhook.

    Jobs that ended meanwhile are not reported: list them.
    """
    with app.database.write() as session:
        enabled = service.enable(session, caller.owner, webhook_id)
        note(session, caller, Action.WEBHOOK_UPDATE, webhook_id)
        return enabled


@router.post(
    "/webhooks/{webhook_id}/test",
    operation_id="test_webhook",
    summary="Send a test message",
    status_code=202,
    responses=documented(InvalidRequest, WebhookNotFound, WebhookDisabled, WebhookPending),
)
def test_webhook(app: ServiceDep, owner: OwnerDep, webhook_id: WebhookId) -> Delivery:
    """Send a `webhook.test` message within a few seconds; see its outcome in the deliveries."""
    with app.database.write() as session:
        return service.test(session, owner, webhook_id)


@router.get(
    "/webhooks/{webhook_id}/deliveries",
    operation_id="list_webhook_deliveries",
    summary="List what was sent to a webhook",
    responses=documented(InvalidRequest, WebhookNotFound),
)
def list_webhook_deliveries(
    app: ServiceDep,
    owner: OwnerDep,
    webhook_id: WebhookId,
    cursor: CursorQuery = None,
    limit: LimitQuery = 50,
) -> DeliveryPage:
    """Messages with the outcome of their last try, newest first."""
    with app.database.read() as session:
        return repository.list_deliveries(session, owner, webhook_id, cursor=cursor, limit=limit)


messages = APIRouter(tags=["webhooks"])  # not served: messages to receivers, for the OpenAPI document


@messages.post(
    "job_ended",
    operation_id="job_ended",
    summary="A job has ended",
    responses={
        204: {"description": "Any 2xx: the message was taken."},
        "default": {"description": "Not taken: it is sent again. 410 disables the webhook."},
    },
    status_code=204,
)
def job_ended(message: Message) -> None:
    """Sent to webhooks by Standard Webhooks: `webhook-id`, `webhook-timestamp` and `webhook-signature`."""


@messages.post(
    "webhook_challenge",
    operation_id="webhook_challenge",
    summary="Challenge",
    responses={
        200: {"description": "The challenge as it came: the webhook is enabled."},
        "default": {"description": "Not answered: it is sent again. 410 disables the webhook."},
    },
)
def webhook_challenge(message: Challenge) -> ChallengeAnswer:  # type: ignore[empty-body]
    """Sent, signed like every message, before a webhook is sent anything else."""
