"""Schemas of health responses."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, Field


class Liveness(BaseModel):
    """The process is alive."""

    status: Literal["alive"] = "alive"
    version: str


class WorkerState(BaseModel):
    """The workers, by their signs of life: each comes from the loop that hands jobs to their children."""

    status: Literal["ok", "none", "stalled", "unknown"] = Field(
        description="`stalled`: there are workers, but none of them takes jobs; `unknown`: no database."
    )
    alive: int = Field(description="Workers that take jobs.")
    stalled: int = Field(description="Workers that no longer accept jobs but have not exited.")
    slots: int = Field(description="Jobs that can run at once.")
    busy: int = Field(description="Slots in use.")


class Readiness(BaseModel):
    """Whether the service can do its work, part by part."""

    status: Literal["ready", "degraded", "not_ready"] = Field(
        description="`degraded`: jobs are accepted and kept; without workers none starts, without a broker "
        "each starts a second late."
    )
    database: str = Field(examples=["ok"], description="`ok`, `not migrated` or `unreachable (...)`.")
    broker: str = Field(
        examples=["ok"],
        description="Reply to a PING with our password. Without a broker workers find jobs by polling.",
    )
    workers: WorkerState
