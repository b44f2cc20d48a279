"""Laws of `search.warm_start` at the API, over real HTTP on both databases."""

from __future__ import annotations

from typing import Any

import pytest

from app.jobs import store
from tests.app.calls import fault, post
from tests.app.request_documents import RESULT, STUDY_RESULT, Document, identify_document, study_document
from tests.app.running_service import RunningService

LINKS = RESULT["model"]["links_per_wing"]
WHOLE = {**RESULT["model"], "separate_wings": False}  # with its defaults, as a request gets them


def request(warm_start: Document, **model: Any) -> Document:
    """An identification that begins somewhere."""
    document = identify_document()
    document["model"] = {"links_per_wing": LINKS, **model}
    document["search"] = {"seed": 2, "warm_start": warm_start}
    return document


def posted(service: RunningService, document: Document) -> Document:
    """The search that the worker reads of an accepted request."""
    answer = post(service, "/identify", document)
    assert answer.status_code == 202, answer.text
    with service.database.read() as session:
        stored = store.load_request(session, answer.json()["id"])
    search: Document = stored["search"]
    return search


def ended_job(
    service: RunningService, status: str, result: Document | None, *, operation: str = "identify"
) -> Document:
    """A job that has left a result, or none."""
    with service.database.write() as session:
        job = store.create_job(session, owner="local", operation=operation, request={"aircraft": {}})
    service.finish(service.claim(job.id), status, result=result)
    document: Document = service.client.get(f"/jobs/{job.id}").json()
    return document


@pytest.mark.parametrize("status", ["succeeded", "cancelled"])
def test_begins_from_a_job(any_service: RunningService, status: str) -> None:
    """The worker reads the model itself, that of a whole or of a partial result, not a reference."""
    job = ended_job(any_service, status, RESULT)
    search = posted(any_service, request({"job_id": job["id"]}))
    assert search["warm_start"] == {"parameters": WHOLE}
    any_service.client.delete(f"/jobs/{job['id']}").raise_for_status()


def test_begins_from_a_model_or_its_parameters(any_service: RunningService) -> None:
    """An identified model, one given outright, or a whole result: the worker reads the same."""
    job = ended_job(any_service, "succeeded", RESULT)
    by_id = posted(any_service, request({"model_id": job["model_id"]}))
    assert by_id["warm_start"] == {"parameters": WHOLE}
    outright = posted(any_service, request({"parameters": {"model": RESULT["model"]}}))
    assert outright["warm_start"] == {"parameters": WHOLE}
    assert "warm_start" not in posted(any_service, {**request({}), "search": {"seed": 2}})


def test_begins_from_the_recommended_model_of_a_study(service: RunningService) -> None:
    """Of a study it is the model that was recommended."""
    job = ended_job(service, "succeeded", STUDY_RESULT, operation="study")
    links = STUDY_RESULT["recommended"]["links_per_wing"]
    search = posted(service, request({"job_id": job["id"]}, links_per_wing=links))
    assert search["warm_start"]["parameters"]["links_per_wing"] == links


def never_flown() -> Document:
    """An earlier result: a model together with flights that it did not fly."""
    return {**RESULT, "fit": [{**RESULT["fit"][0], "J_identified": None}]}


@pytest.mark.parametrize(
    "result", [never_flown(), {**RESULT, "model": None}], ids=["null cost", "null model"]
)
def test_nothing_begins_from_a_model_that_never_flew(service: RunningService, result: Document) -> None:
    """Neither is it kept as a model, nor does a search begin from its job or from its document."""
    for status in ("succeeded", "cancelled"):
        job = ended_job(service, status, result)
        assert job["model_id"] is None
        assert refusal(service, request({"job_id": job["id"]})) == ("/search/warm_start/job_id", "no_model")
    pointer, _ = refusal(service, request({"parameters": result}))
    assert pointer == "/search/warm_start/parameters/model"


def refusal(service: RunningService, document: Document) -> tuple[str, str]:
    """Pointer and code of a refused request."""
    first = fault(post(service, "/identify", document))["errors"][0]
    assert first["hint"]
    return first["pointer"], first["code"]


def test_what_does_not_fit_is_named(service: RunningService) -> None:
    """Each fault names the field: nothing or two things given, another's job, no result, other links."""
    at = "/search/warm_start"
    assert refusal(service, request({})) == (at, "missing")
    twice = {"job_id": "job_x", "model_id": "model_x"}
    assert refusal(service, request(twice)) == (at, "given_twice")
    assert refusal(service, request({"job_id": "job_x"})) == (f"{at}/job_id", "job_not_found")
    assert refusal(service, request({"model_id": "model_x"})) == (f"{at}/model_id", "model_not_found")
    failed = ended_job(service, "failed", None)
    assert refusal(service, request({"job_id": failed["id"]})) == (f"{at}/job_id", "no_model")
    job = ended_job(service, "succeeded", RESULT)
    other = request({"job_id": job["id"]}, links_per_wing=LINKS + 1)
    assert refusal(service, other) == (f"{at}/job_id", "links_differ")
    ragged = {**RESULT["model"], "division": [0.5] * (LINKS + 1)}
    pointer, _ = refusal(service, request({"parameters": ragged}))
    assert pointer.startswith(f"{at}/parameters")


def test_anothers_job_is_no_start(service: RunningService) -> None:
    """What another owner has identified is not found."""
    with service.database.write() as session:
        job = store.create_job(session, owner="someone", operation="identify", request={"aircraft": {}})
        claim = store.claim_job(session, job.id, "w")
        assert claim is not None
        store.finish_job(session, claim, "succeeded", result=RESULT)
    with service.database.read() as session:
        model_id = store.get_job(session, "someone", job.id).model_id
    at = "/search/warm_start"
    assert refusal(service, request({"job_id": job.id})) == (f"{at}/job_id", "job_not_found")
    assert refusal(service, request({"model_id": model_id})) == (f"{at}/model_id", "model_not_found")


def test_a_study_begins_nowhere(service: RunningService) -> None:
    """A study seeks models of several sizes: it takes no start."""
    document = {**study_document(), "search": {"warm_start": {"job_id": "job_x"}}}
    assert fault(post(service, "/study", document))["pointer"] == "/search/warm_start"
