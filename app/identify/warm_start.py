"""Where a search begins: a reference to an earlier job or model becomes the model itself, once for all."""

from __future__ import annotations

import json

from app.database import Session
from app.documents import Document
from app.errors import InvalidRequest, JobNotFound, ModelNotFound
from app.jobs import repository as jobs
from app.jobs.rows import get_job
from app.models import repository as models
from app.models.checks import known_model_faults
from app.models.left_models import left_model
from app.models.service import as_given
from morphdata.faults import Fault
from morphdata.identify import IdentifyRequest
from morphdata.parameters import KnownModel, WholeResult
from morphdata.search import WarmStart
from morphdata.vehicle import model_surfaces_faults

POINTER = "/search/warm_start"
WAYS = ("job_id", "model_id", "parameters")


def warm_start_document(session: Session, owner: str, request: IdentifyRequest) -> Document:
    """Build what the worker reads of `search.warm_start`: nothing, or the parameters of a model that fits.

    Raises
    ------
    InvalidRequest
        There is no such model, or it has another form than what is sought.
    """
    warm_start = request.search.warm_start
    if warm_start is None:
        return {}
    given = [name for name in WAYS if getattr(warm_start, name) is not None]
    if len(given) != 1:
        raise _refused(
            "given_twice" if given else "missing",
            f"{' and '.join(given) or 'Nothing'} is given to begin from.",
            "",
            f"Give one of {', '.join(WAYS)}.",
        )
    parameters = _parameters(session, owner, warm_start)
    _require_fit(request, parameters, f"/{given[0]}")
    return {"warm_start": {"parameters": parameters}}


def _parameters(session: Session, owner: str, warm_start: WarmStart) -> Document:
    if warm_start.model_id is not None:
        try:
            _, document = models.get_model(session, owner, warm_start.model_id)
        except ModelNotFound as error:
            raise _refused("model_not_found", error.detail, "/model_id", error.hint) from None
        return as_given(document["model"])
    if warm_start.job_id is not None:
        return _of_job(session, owner, warm_start.job_id)
    faults = known_model_faults(KnownModel(parameters=warm_start.parameters), POINTER)
    if faults:
        raise InvalidRequest.of(faults)
    given = warm_start.parameters
    model = given.model if isinstance(given, WholeResult) else given
    return {} if model is None else model.model_dump(exclude_none=True)


def _of_job(session: Session, owner: str, job_id: str) -> Document:
    """Find the model that a job left, whole or as its best so far."""
    try:
        job = get_job(session, owner, job_id)
    except JobNotFound as error:
        raise _refused("job_not_found", error.detail, "/job_id", error.hint) from None
    text = jobs.result_json(session, owner, job_id)
    left = None if text is None else left_model(job.operation, json.loads(text))
    if left is None:
        state = "has ended" if job.finished else f"is {job.status.value}"
        hint = "Wait for its end, or cancel it: what it has found by then is its result."
        raise _refused(
            "no_model",
            f"Job {job_id} ({job.operation}) {state} and has left no model.",
            "/job_id",
            "Name an identification or a study with a result." if job.finished else hint,
        )
    return as_given(left["model"])


def _require_fit(request: IdentifyRequest, parameters: Document, at: str) -> None:
    sought, known = request.model.links_per_wing, parameters.get("links_per_wing")
    if known != sought:
        raise _refused(
            "links_differ",
            f"The search seeks {sought} links per wing and would begin from a model with {known}.",
            at,
            f"Begin from a model with {sought}, or set model.links_per_wing to {known}.",
        )
    faults = list(model_surfaces_faults(request.aircraft, parameters, f"{POINTER}{at}"))
    if faults:
        raise InvalidRequest.of(faults)
    if parameters.get("separate_wings") and not request.model.separate_wings:
        raise _refused(
            "wings_differ",
            "The search seeks wings that are alike and would begin from a model with wings of their own.",
            at,
            "Set model.separate_wings, or begin from a model whose wings are alike.",
        )


def _refused(code: str, detail: str, at: str, hint: str) -> InvalidRequest:
    return InvalidRequest.of([Fault(code, detail, f"{POINTER}{at}", hint)])
