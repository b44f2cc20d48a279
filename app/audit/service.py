"""Noting what a caller does."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from app.audit import repository
from app.audit.records import Action
from app.database import Session

if TYPE_CHECKING:
    from app.http.context import Caller


def note(
    session: Session,
    caller: Caller,
    action: Action,
    target: str | None = None,
    *,
    detail: Mapping[str, Any] | None = None,
) -> None:
    """Note what `caller` did to `target`, in the transaction that did it.

    Parameters
    ----------
    target
        Id of the thing.
    detail
        A few small facts; never a secret, never content.
    """
    repository.insert_entry(
        session,
        action,
        owner=caller.owner,
        key_id=caller.key_id,
        target=target,
        request_id=caller.request_id,
        address=caller.address,
        detail=detail,
    )
