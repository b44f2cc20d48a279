"""Laws of the endpoints of identified models."""

from __future__ import annotations

from app.jobs import store
from tests.app.request_documents import RESULT, identify_document
from tests.app.running_service import RunningService


def test_models_are_listed_newest_first_in_pages(any_service: RunningService) -> None:
    """Every success leaves one model; pages hold each once, newest first."""
    for _ in range(3):
        with any_service.database.write() as session:
            job = store.create_job(session, owner="local", operation="identify", request=identify_document())
            claim = store.claim_job(session, job.id, "w")
            assert claim is not None
            store.finish_job(session, claim, "succeeded", result=RESULT)
    first = any_service.client.get("/models", params={"limit": 2}).json()
    rest = any_service.client.get("/models", params={"limit": 2, "cursor": first["next_cursor"]}).json()
    models = first["models"] + rest["models"]
    assert rest["next_cursor"] is None
    assert len({model["job_id"] for model in models}) == 3
    assert [model["id"] for model in models] == sorted((model["id"] for model in models), reverse=True)
    assert {model["links_per_wing"] for model in models} == {2}


def test_another_owners_model_is_not_found(service: RunningService) -> None:
    """A model of someone else is 404, and not in the list."""
    with service.database.write() as session:
        job = store.create_job(session, owner="someone", operation="identify", request=identify_document())
        claim = store.claim_job(session, job.id, "w")
        assert claim is not None
        store.finish_job(session, claim, "succeeded", result=RESULT)
        model_id = store.get_job(session, "someone", job.id).model_id
    assert service.client.get(f"/models/{model_id}").status_code == 404
    listed = service.client.get("/models", params={"limit": 100}).json()
    assert listed["next_cursor"] is None
    assert model_id not in [model["id"] for model in listed["models"]]
    for path in ("", "/result", "/events", "/artifacts", "/artifacts/x.svg"):
        assert service.client.get(f"/jobs/{job.id}{path}").status_code == 404
    assert service.client.post(f"/jobs/{job.id}/cancel").status_code == 404
    assert service.client.delete(f"/jobs/{job.id}").status_code == 404
