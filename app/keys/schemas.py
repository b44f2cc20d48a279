"""Schemas of the caller's own key."""

from __future__ import annotations

from datetime import datetime

from pydantic import BaseModel, Field

from app.keys.records import Quota, Scope, Usage


class KeyAbout(BaseModel):
    """The key used for the request."""

    id: str = Field(examples=["key_01k0c3v9fh8x2m4n6p8q0r2s4t"])
    name: str = Field(examples=["laboratory"])
    prefix: str = Field(description="The part of the key that may be shown.", examples=["4k7m2x9q"])
    expires_at: datetime | None


class LimitAndUse(BaseModel):
    """Limit and use of one quota; no limit if `limit` is null."""

    used: int
    limit: int | None


class Quotas(BaseModel):
    """Limits and present use of the key."""

    jobs_in_flight: LimitAndUse
    flights_per_day: LimitAndUse = Field(description="Since midnight UTC; running jobs by their estimate.")
    stored_bytes: LimitAndUse

    @classmethod
    def of(cls, used: Usage, quota: Quota) -> Quotas:
        """Combine use and limits."""
        return cls(
            jobs_in_flight=LimitAndUse(used=used.jobs_in_flight, limit=quota.max_jobs_in_flight),
            flights_per_day=LimitAndUse(used=used.flights_today, limit=quota.max_flights_per_day),
            stored_bytes=LimitAndUse(used=used.stored_bytes, limit=quota.max_stored_bytes),
        )


class Me(BaseModel):
    """Identity, permissions and quotas of the caller."""

    owner: str = Field(description="Keys of one owner see the same data.", examples=["aeroelastics"])
    scopes: list[Scope]
    key: KeyAbout | None = Field(description="Null if the service requires no keys.")
    quotas: Quotas | None = Field(description="Null if the service requires no keys.")
