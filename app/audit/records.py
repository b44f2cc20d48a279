"""Recorded actions and the entries of the audit log."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from enum import StrEnum
from typing import Any


class Action(StrEnum):
    """Actions that are recorded."""

    JOB_POST = "job.post"
    JOB_CANCEL = "job.cancel"
    JOB_DELETE = "job.delete"
    TRAJECTORY_POST = "trajectory.post"
    TRAJECTORY_DELETE = "trajectory.delete"
    MODEL_DELETE = "model.delete"
    WEBHOOK_CREATE = "webhook.create"
    WEBHOOK_UPDATE = "webhook.update"
    WEBHOOK_DELETE = "webhook.delete"
    KEY_CREATE = "key.create"
    KEY_REVOKE = "key.revoke"
    AUTH_REFUSED = "auth.refused"


@dataclass(frozen=True, slots=True)
class Entry:
    """One recorded action."""

    id: str
    at: datetime
    owner: str | None
    key_id: str | None
    action: str
    target: str | None
    outcome: str
    request_id: str | None
    address: str | None
    detail: Mapping[str, Any] | None
