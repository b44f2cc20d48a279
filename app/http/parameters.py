"""Parameters shared by routes: identifiers, pages of a list, `Prefer: wait=n` and `Idempotency-Key`."""

from __future__ import annotations

import re
from typing import Annotated

from fastapi import Header, Path, Query

ID_PATTERN = r"^[A-Za-z0-9_]{1,64}$"
WAIT = re.compile(r"(?:^|[,;])\s*wait\s*=\s*\"?(\d{1,6})\"?\s*(?:$|[,;])", re.IGNORECASE)  # RFC 7240

IdPath = Annotated[str, Path(pattern=ID_PATTERN)]
CursorQuery = Annotated[str | None, Query(pattern=ID_PATTERN, description="From `next_cursor`.")]
LimitQuery = Annotated[int, Query(ge=1, le=200)]
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
        description="Makes a repeated request safe: the same key and body return the first response again.",
        examples=["8e03978e-40d5-43e8-bc93-6894a57f9324"],
        min_length=1,
        max_length=255,
        pattern=r"^[\x21-\x7e]+$",
    ),
]


def wait_seconds(prefer: str | None, max_s: float) -> float:
    """Seconds that the client prefers to wait, at most `max_s`; 0 when it states no preference."""
    match = WAIT.search(prefer or "")
    return min(float(match[1]), max_s) if match else 0.0
