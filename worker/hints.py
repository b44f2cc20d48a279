"""Wake-up messages on the worker's side: parsed strictly and rebuilt before Celery sees them.

Anything else a message carries (time limits, callbacks, compression, a broken body) never reaches Celery,
which would act on it or crash. A malformed message is dropped and counted.
"""

from __future__ import annotations

import base64
import json
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal
from uuid import uuid4

from pydantic import AwareDatetime, BaseModel, ConfigDict, Field, TypeAdapter

from app.jobs.queue import QUEUE, RUN_JOB

REAP = "morphid.reap"
MAX_BYTES = 16_384  # ours have about a thousand


class _Headers(BaseModel):
    task: Literal["morphid.run_job", "morphid.reap"]
    expires: AwareDatetime | None = None


class _Properties(BaseModel):
    body_encoding: Literal["base64"]


class _Envelope(BaseModel):
    body: str
    content_type: Literal["application/json"] = Field(alias="content-type")
    headers: _Headers
    properties: _Properties


class _ReapOptions(BaseModel):
    model_config = ConfigDict(extra="forbid")
    republish_after_s: float | None = Field(default=None, ge=0.0, le=86_400.0, allow_inf_nan=False)


# positional arguments, named ones, and Celery's additions, which are not read here
_JobName = Annotated[str, Field(max_length=64)]
_RUN_JOB_BODY = TypeAdapter(tuple[tuple[_JobName], dict[str, Any], Any])
_REAP_BODY = TypeAdapter(tuple[tuple[()], _ReapOptions, Any])


@dataclass(frozen=True, slots=True)
class Hint:
    """The content of a wake-up message."""

    task: str  # `RUN_JOB` or `REAP`
    arguments: list[str] = field(default_factory=list)  # the job that caused it, for `RUN_JOB`
    options: dict[str, float] = field(default_factory=dict)  # how to reap, for `REAP`
    id: str = field(
        default_factory=lambda: str(uuid4())
    )  # unique: two messages with the same id would count as one

    def headers(self) -> dict[str, Any]:
        """Return the headers of a Celery message (protocol 2)."""
        return {
            "lang": "py",
            "task": self.task,
            "id": self.id,
            "root_id": self.id,
            "parent_id": None,
            "eta": None,
            "expires": None,
            "retries": 0,
            "timelimit": [None, None],
            "argsrepr": repr(tuple(self.arguments)),
            "kwargsrepr": repr(self.options),
            "ignore_result": True,
        }

    def body(self) -> bytes:
        """Return the body of a Celery message."""
        return json.dumps([self.arguments, self.options, {}]).encode()

    def packed(self) -> bytes:
        """Return the whole message in the form that kombu stores in a Redis list."""
        return json.dumps(
            {
                "body": base64.b64encode(self.body()).decode(),
                "content-type": "application/json",
                "content-encoding": "utf-8",
                "headers": self.headers(),
                "properties": {
                    "correlation_id": self.id,
                    "delivery_tag": self.id,
                    "delivery_info": {"exchange": "", "routing_key": QUEUE},
                    "body_encoding": "base64",
                },
            }
        ).encode()


def read_hint(message: bytes, clock: Callable[[], float] = time.time) -> Hint | None:
    """Read a message from the broker; None for an expired one, ValueError for a malformed one."""
    if len(message) > MAX_BYTES:
        raise ValueError("too long")
    envelope = _Envelope.model_validate_json(message)
    headers, body = envelope.headers, base64.b64decode(envelope.body, validate=True)
    if headers.expires is not None and headers.expires.timestamp() < clock():
        return None
    if headers.task == RUN_JOB:
        arguments, _, _ = _RUN_JOB_BODY.validate_json(body)
        return Hint(RUN_JOB, list(arguments))
    _, options, _ = _REAP_BODY.validate_json(body)
    return Hint(REAP, [], options.model_dump(exclude_none=True))
