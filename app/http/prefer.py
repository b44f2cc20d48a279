"""The headers ``Prefer: wait=n`` (RFC 7240) and ``Idempotency-Key``."""

from __future__ import annotations

import re
from typing import Annotated

from fastapi import Header

WAIT = re.compile(r"(?:^|[,;])\s*wait\s*=\s*\"?(\d{1,6})\"?\s*(?:$|[,;])", re.IGNORECASE)

PreferHeader = Annotated[
    str | None,
    Header(
        alias="Prefer",
        description="`wait=n`: answer when the job has ended, after n seconds at the latest.",
        examples=["wait=30"],
        max_length=200,
    ),
]

IdempotencyKeyHeader = Annotated[
    str | None,
    Header(
        alias="Idempotency-Key",
        description="Makes a repeated request safe: the same key and body give the first answer again.",
        examples=["8e03978e-40d5-43e8-bc93-6894a57f9324"],
        min_length=1,
        max_length=255,
        pattern=r"^[\x21-\x7e]+$",
    ),
]


def wait_seconds(prefer: str | None, most: float) -> float:
    """Seconds that the client prefers to wait, at most `most`; 0 when it says nothing of it."""
    match = WAIT.search(prefer or "")
    return min(float(match[1]), most) if match else 0.0
