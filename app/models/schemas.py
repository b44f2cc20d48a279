"""Schemas of identified models."""

from __future__ import annotations

from datetime import datetime
from typing import Any

from pydantic import BaseModel, ConfigDict, Field

from morphdata.identified import IdentifiedParameters, SampleFit


class ModelSummary(BaseModel):
    """An identified model without its parameters."""

    model_config = ConfigDict(from_attributes=True)

    id: str = Field(examples=["model_01k0c3v9fh8x2m4n6p8q0r2s4t"])
    name: str
    links_per_wing: int | None = Field(description="The most of any surface, where they differ.")
    job_id: str | None = Field(description="The job that identified it; null if deleted.")
    created_at: datetime


class ModelPage(BaseModel):
    """Models, newest first."""

    models: list[ModelSummary]
    next_cursor: str | None = Field(description="Pass as `cursor` to get the next page; null on the last.")


class IdentifiedModel(ModelSummary):
    """An identified model with all data needed to fly it."""

    model: IdentifiedParameters
    fit: list[SampleFit]
    aircraft: dict[str, Any]
    flight: dict[str, Any]
    options: dict[str, Any] = Field(description="The `model` part of the request: lattice, step, start.")
