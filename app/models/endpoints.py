"""Endpoints of identified models."""

from __future__ import annotations

from operator import attrgetter

from fastapi import APIRouter

from app.audit.records import Action
from app.audit.repository import note
from app.database import Session
from app.errors import InvalidRequest, ModelNotFound
from app.http.context import CallerDep, OwnerDep, ServiceDep, demands
from app.http.parameters import CursorQuery, IdPath, LimitQuery
from app.http.problems import documented
from app.keys.records import Scope
from app.models import repository
from app.models.schemas import IdentifiedModel, ModelPage

router = APIRouter(tags=["models"], generate_unique_id_function=attrgetter("name"))


@router.get(
    "/models",
    dependencies=[demands(Scope.DATA_READ)],
    summary="List identified models",
    responses=documented(InvalidRequest),
)
def list_models(
    app: ServiceDep,
    owner: OwnerDep,
    cursor: CursorQuery = None,
    limit: LimitQuery = 50,
) -> ModelPage:
    """Your identified models, newest first."""
    with app.database.read() as session:
        return repository.list_models(session, owner, cursor=cursor, limit=limit)


@router.get(
    "/models/{model_id}",
    dependencies=[demands(Scope.DATA_READ)],
    summary="Get an identified model",
    responses=documented(InvalidRequest, ModelNotFound),
)
def get_model(app: ServiceDep, owner: OwnerDep, model_id: IdPath) -> IdentifiedModel:
    """Return parameters, fit, aircraft and flight of one model."""
    with app.database.read() as session:
        summary, document = repository.get_model(session, owner, model_id)
    return IdentifiedModel(**summary.model_dump(), **document)


@router.delete(
    "/models/{model_id}",
    dependencies=[demands(Scope.DATA_WRITE)],
    summary="Delete an identified model",
    status_code=204,
    responses=documented(InvalidRequest, ModelNotFound),
)
def delete_model(app: ServiceDep, caller: CallerDep, model_id: IdPath) -> None:
    """Delete a model; its job keeps the result, and jobs that were started with it have copies."""

    def remove(session: Session) -> None:
        repository.delete_model(session, caller.owner, model_id)
        note(session, caller, Action.MODEL_DELETE, model_id)

    app.database.write_even_if_full(remove)
