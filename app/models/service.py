"""Identified models as the endpoints show them, and as other requests use them."""

from __future__ import annotations

from app.database import Session
from app.documents import Document
from app.errors import InvalidRequest, ModelNotFound
from app.models import repository
from app.models.schemas import IdentifiedModel, ModelPage, ModelSummary
from morphdata.faults import Fault, InvalidInput
from morphdata.parameters import KnownModel, Parameters

HOW_IDENTIFIED = ("lattice", "step_s", "start")  # a model flies as it was identified, unless told otherwise


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


def known_model(session: Session, owner: str, model: KnownModel, pointer: str = "/model") -> Document:
    """Build the model that a worker flies: ``parameters`` outright, and how they are to be flown.

    Raises
    ------
    InvalidRequest
        The owner has no such model.
    """
    parameters = _parameters(session, owner, model, f"{pointer}/model_id")
    chosen = model.model_dump(include=set(HOW_IDENTIFIED), exclude_none=True)
    identified = {name: parameters[name] for name in HOW_IDENTIFIED if parameters.get(name) is not None}
    return {"parameters": parameters, **identified, **chosen}


def as_given(model: Document) -> Document:
    """Give a stored model in the form that the same parameters get when a request holds them outright.

    So a job's request, in which references are resolved, makes the same job when it is posted again. A model
    that no request could hold any more, of an earlier version say, stays as it is.
    """
    try:
        return Parameters.parse(model).model_dump(exclude_none=True)
    except InvalidInput:
        return model


def _parameters(session: Session, owner: str, model: KnownModel, pointer: str) -> Document:
    """Find the parameters: in the request, or in the owner's identified model."""
    if model.known is not None:
        return model.known.model_dump(exclude_none=True)
    try:
        _, document = repository.get_model(session, owner, model.model_id or "")
    except ModelNotFound as error:
        fault = Fault("model_not_found", error.detail, pointer, error.hint)
        raise InvalidRequest.of([fault]) from None
    return as_given(document["model"])
