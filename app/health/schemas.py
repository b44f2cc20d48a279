"""Health on the wire."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, Field


class Liveness(BaseModel):
    """The process answers."""

    status: Literal["alive"] = "alive"
    version: str


class Readiness(BaseModel):
    """Whether the service can take requests, part by part."""

    status: Literal["ready", "not_ready"]
    database: str = Field(examples=["ok"])
    broker: str = Field(
        examples=["ok"],
        description="Without a broker jobs are still accepted; they start when the broker is back.",
    )
