"""Schemas of webhooks."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, field_validator

from app.jobs.schemas import EXAMPLE_ID
from morphdata.base import Document

EXAMPLE_WEBHOOK = "hook_01k0c3v9fh8x2m4n6p8q0r2s4t"
EXAMPLE_CHALLENGE = "pJ5mXw0cQ1l3nR8tZ2vB7dK4sY6uE9hA"
EXAMPLE_URL = "https://example.com/hooks/morphid"
JobEvent = Literal["job.succeeded", "job.failed", "job.cancelled", "job.expired"]
WebhookStatus = Literal["pending", "enabled", "disabled"]
DeliveryStatus = Literal["waiting", "delivered", "given_up"]
EVERY_EVENT: list[JobEvent] = ["job.succeeded", "job.failed", "job.cancelled", "job.expired"]


class WebhookRequest(Document):
    """Address and events of a new webhook."""

    model_config = ConfigDict(
        json_schema_extra={"examples": [{"url": EXAMPLE_URL, "events": ["job.succeeded", "job.failed"]}]}
    )

    url: Annotated[str, Field(min_length=1, max_length=2000)] = Field(
        description="`https`, without user name; the name must resolve to public addresses, now and at every "
        "try. Port 443, or 1024 and above."
    )
    events: Annotated[list[JobEvent], Field(min_length=1, max_length=4)] = Field(
        default=EVERY_EVENT, description="No duplicates; default: all."
    )

    @field_validator("events")
    @classmethod
    def _each_once(cls, events: list[JobEvent]) -> list[JobEvent]:
        return [event for event in EVERY_EVENT if event in events]


class Webhook(BaseModel):
    """An address that is notified when jobs end."""

    id: str = Field(examples=[EXAMPLE_WEBHOOK])
    url: str = Field(examples=[EXAMPLE_URL])
    events: list[JobEvent]
    status: WebhookStatus = Field(
        description="`pending` until the receiver has answered the challenge; only `enabled` webhooks are "
        "sent messages about jobs."
    )
    enabled: bool = Field(description="Whether `status` is `enabled`.")
    disabled_at: datetime | None
    disabled_reason: str | None = Field(
        description="Why the webhook is disabled; enable it once the receiver works again."
    )
    failures: int = Field(description="Failed tries since the last success.")
    created_at: datetime


class NewWebhook(Webhook):
    """A webhook with its secret, which is shown this once."""

    secret: str = Field(
        description="Signs every message (Standard Webhooks, `v1`). Keep it; it is not shown again.",
        examples=["whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSwMfKQ9r8GKYo="],
    )


class WebhookList(BaseModel):
    """Webhooks, newest first."""

    webhooks: list[Webhook]


class Delivery(BaseModel):
    """One message to a webhook, however often it was tried."""

    id: str = Field(
        description="The `webhook-id` header, the same in every try.",
        examples=["msg_01k0c3v9fh8x2m4n6p8q0r2s4t"],
    )
    type: str = Field(examples=["job.succeeded", "webhook.challenge", "webhook.test"])
    job_id: str | None = Field(examples=[EXAMPLE_ID], description="null for a challenge or a test.")
    status: DeliveryStatus
    tries: int
    response_status: int | None = Field(description="HTTP status of the last answer.")
    error: str | None = Field(description="Why the last try failed.")
    created_at: datetime
    next_try_at: datetime | None
    finished_at: datetime | None


class DeliveryPage(BaseModel):
    """Deliveries, newest first."""

    deliveries: list[Delivery]
    next_cursor: str | None = Field(description="Pass as `cursor` to get the next page; null on the last.")


class MessageError(BaseModel):
    """Why a job did not succeed."""

    code: str
    detail: str
    hint: str


class MessageLinks(BaseModel):
    """Links to the parts of the job, relative to the root of this service."""

    self: str
    result: str
    artifacts: str


class MessageData(BaseModel):
    """The job that ended."""

    id: str = Field(examples=[EXAMPLE_ID])
    operation: str = Field(examples=["identify"])
    status: Literal["succeeded", "failed", "cancelled", "expired"]
    error: MessageError | None
    model_id: str | None
    links: MessageLinks


class ChallengeData(BaseModel):
    """The value that the receiver must return."""

    webhook_id: str = Field(examples=[EXAMPLE_WEBHOOK])
    challenge: str = Field(examples=[EXAMPLE_CHALLENGE])


class Challenge(BaseModel):
    """The message sent to a new or disabled webhook before anything else."""

    type: Literal["webhook.challenge"]
    timestamp: datetime
    data: ChallengeData


class ChallengeAnswer(BaseModel):
    """The answer of a receiver that accepts the messages."""

    challenge: str = Field(examples=[EXAMPLE_CHALLENGE])


class Message(BaseModel):
    """The message sent to a webhook when a job has ended."""

    type: JobEvent
    timestamp: datetime = Field(description="When the job ended.")
    data: MessageData
