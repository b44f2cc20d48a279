"""Identified models as the endpoints show them."""

from __future__ import annotations

from app.database import Session
from app.models import repository
from app.models.schemas import IdentifiedModel, ModelPage, ModelSummary


def _shown(model: repository.ModelSummary) -> ModelSummary:
    return ModelSummary(
        id=model.id,
        name=model.name,
        links_per_wing=model.links_per_wing,
        job_id=model.job_id,
        created_at=model.created_at,
    )


def page(session: Session, owner: str, *, cursor: str | None, limit: int) -> ModelPage:
    """One page of the owner's models, newest first."""
    found = repository.list_models(session, owner, before=cursor, limit=limit + 1)
    shown = found[:limit]
    return ModelPage(
        models=[_shown(model) for model in shown], next_cursor=shown[-1].id if len(found) > limit else None
    )


def get(session: Session, owner: str, model_id: str) -> IdentifiedModel:
    """One model with its document."""
    summary, document = repository.get_model(session, owner, model_id)
    return IdentifiedModel(**_shown(summary).model_dump(), **document)
