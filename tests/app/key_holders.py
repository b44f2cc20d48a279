"""Keys for tests, and clients that hold them."""

from __future__ import annotations

import time
from collections.abc import Collection, Iterator
from contextlib import contextmanager

import httpx

from app.database import Database
from app.keys.records import EVERY_SCOPE, NO_QUOTA, Quota, Scope
from app.keys.service import NewKey, create_key
from tests.app.running_service import RunningService
from tests.plain_http import CERTIFICATES


def make_key(
    database: Database,
    owner: str = "alpha",
    *,
    scopes: Collection[Scope] = EVERY_SCOPE,
    quota: Quota = NO_QUOTA,
    expires_in_s: float | None = None,
) -> NewKey:
    """Make a key as the operator does."""
    expires_at = None if expires_in_s is None else time.time() + expires_in_s
    with database.write() as session:
        return create_key(
            session, owner=owner, name="a test", scopes=sorted(scopes), quota=quota, expires_at=expires_at
        )


def bearer(text: str) -> dict[str, str]:
    """The header that carries a key."""
    return {"Authorization": f"Bearer {text}"}


@contextmanager
def holder(service: RunningService, text: str) -> Iterator[httpx.Client]:
    """A client that sends this key with every request."""
    with httpx.Client(
        base_url=service.url, timeout=30.0, headers=bearer(text), verify=CERTIFICATES
    ) as client:
        yield client
