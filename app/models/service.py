"""Identified models as requests use them."""

from __future__ import annotations

from pydantic import ValidationError

from app.database import Session
from app.documents import Document
from app.errors import InvalidRequest, ModelNotFound
from app.models import repository
from app.models.checks import known_model_faults
from morphdata.faults import Fault
from morphdata.parameters import KnownModel, Parameters, WholeResult

HOW_IDENTIFIED = ("lattice", "step_s", "start")  # a model flies as it was identified, unless told otherwise


def known_model(session: Session, owner: str, model: KnownModel, pointer: str = "/model") -> Document:
    """Build the model that a worker flies: ``parameters`` outright, and how they are to be flown.

    Raises
    ------
    InvalidRequest
        The owner has no such model, or the parameters do not fit together.
    """
    faults = known_model_faults(model, pointer)
    if faults:
        raise InvalidRequest.of(faults)
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
        return Parameters.model_validate(model).model_dump(exclude_none=True)
    except ValidationError:
        return model


def _parameters(session: Session, owner: str, model: KnownModel, pointer: str) -> Document:
    """Find the parameters: in the request, or in the owner's identified model."""
    given = model.parameters
    if given is not None:
        return (given.model if isinstance(given, WholeResult) else given).model_dump(exclude_none=True)
    try:
        _, document = repository.get_model(session, owner, model.model_id or "")
    except ModelNotFound as error:
        fault = Fault("model_not_found", error.detail, pointer, error.hint)
        raise InvalidRequest.of([fault]) from None
    return as_given(document["model"])
