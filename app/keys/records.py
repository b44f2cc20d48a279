"""Values returned by the key store, plain and frozen. No web framework here: workers settle quotas too."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from enum import StrEnum


class Scope(StrEnum):
    """Permissions of a key; every route requires one of these."""

    JOBS_READ = "jobs:read"
    JOBS_WRITE = "jobs:write"
    DATA_READ = "data:read"
    DATA_WRITE = "data:write"
    WEBHOOKS = "webhooks"
    METRICS = "metrics"


EVERY_SCOPE = frozenset(Scope)
USUAL_SCOPES = EVERY_SCOPE - {Scope.METRICS}  # metrics cover all owners: for the operator

SCOPE_MEANINGS = {
    Scope.JOBS_READ: "view jobs, their events, results and files",
    Scope.JOBS_WRITE: "start, cancel and delete jobs; validate requests",
    Scope.DATA_READ: "read uploaded flights and identified models",
    Scope.DATA_WRITE: "upload flights; delete flights and identified models",
    Scope.WEBHOOKS: "create, read, test and delete webhooks",
    Scope.METRICS: "read the metrics of the whole service",
}


@dataclass(frozen=True, slots=True)
class Quota:
    """Limits of a key's use; None: no limit."""

    max_jobs_in_flight: int | None = None
    max_flights_per_day: int | None = None
    max_stored_bytes: int | None = None


NO_QUOTA = Quota()


@dataclass(frozen=True, slots=True)
class Usage:
    """Present use of a key."""

    jobs_in_flight: int
    flights_today: int
    stored_bytes: int


@dataclass(frozen=True, slots=True)
class ApiKey:
    """One key without its secret."""

    id: str
    owner: str
    name: str
    prefix: str
    scopes: frozenset[Scope]
    quota: Quota
    created_at: datetime
    expires_at: datetime | None
    revoked_at: datetime | None
    last_used_at: datetime | None
    expired: bool  # by the database's clock, when the row was read

    @property
    def state(self) -> str:
        """``active``, ``expired`` or ``revoked``."""
        if self.revoked_at is not None:
            return "revoked"
        return "expired" if self.expired else "active"
