"""Laws of POST /study and POST /validate/study."""

from __future__ import annotations

from typing import Any

import pytest

from app.jobs import store
from tests.app.calls import assert_named, changed, post
from tests.app.request_documents import STUDY_RESULT, in_both_spellings, study_document
from tests.app.running_service import RunningService


def test_the_worker_gets_the_list_of_links(service: RunningService) -> None:
    """The numbers reach the worker as they came, and the listing shows them; 1 to 6 are the default."""
    job = post(service, "/study", changed(study_document(), "/model/links_per_wing", [3, 1])).json()
    assert job["request"]["compared_links"] == [3, 1]
    assert job["request"]["links_per_wing"] is None
    plain = study_document()
    del plain["model"]
    default = post(service, "/study", plain).json()
    with service.database.read() as session:
        assert store.load_request(session, job["id"])["model"]["links_per_wing"] == [3, 1]
        assert store.load_request(session, default["id"])["model"]["links_per_wing"] == [1, 2, 3, 4, 5, 6]


def test_cost_is_that_of_all_identifications(service: RunningService) -> None:
    """The flights of a study are those of its identifications together."""
    document = study_document()
    document["search"] = {"method": "hybrid"}
    whole = service.client.post("/validate/study", json=document).json()["cost"]
    parts = [
        service.client.post(
            "/validate/identify", json=changed(document, "/model/links_per_wing", links)
        ).json()["cost"]
        for links in (1, 2, 3)
    ]
    assert whole["flights"] == sum(part["flights"] for part in parts)
    assert whole["core_s"] == pytest.approx(sum(part["core_s"] for part in parts))
    assert whole["parameters"] == parts[-1]["parameters"]


@pytest.mark.parametrize(
    ("path", "value", "pointer", "code", "words"),
    [
        ("/model/links_per_wing", [2, 3, 2], "/model/links_per_wing/2", "name_not_unique", "once"),
        ("/model/links_per_wing", [2, 17], "/model/links_per_wing/1", "less_than_equal", "at most 16"),
        ("/model/links_per_wing", [0], "/model/links_per_wing/0", "greater_than_equal", "at least 1"),
        ("/model/links_per_wing", [], "/model/links_per_wing", "too_short", "more"),
        ("/model/links_per_wing", 3, "/model/links_per_wing", "list_type", "list"),
        ("/model/links_per_wing", [1.5], "/model/links_per_wing/0", "int_type", "whole"),
        ("/samples/0/sweep_left_rad/57", 1.4, "/samples/0/sweep_left_rad/57", "sweep_out_of_range", "1.3"),
        ("/samples/2/time_s/40", 0.0, "/samples/2/time_s/40", "time_not_rising", "Sort"),
        ("/model/bounds/lag_s", [0.1, 1e3], "/model/bounds/lag_s/1", "bound_out_of_range", "Narrow"),
    ],
)
def test_bad_field_is_named(
    service: RunningService, path: str, value: Any, pointer: str, code: str, words: str
) -> None:
    """What is wrong with the list, with a sample or with the model is said with pointer and hint."""
    assert_named(service, "/study", changed(study_document(), path, value), pointer, code, words)


def test_given_start_needs_a_start(service: RunningService) -> None:
    """`model.start = "given"` without `flight.start` is refused, as for an identification."""
    document = changed(study_document(), "/model/start", "given")
    del document["flight"]["start"]
    assert_named(service, "/study", document, "/flight/start", "start_missing", "trim")


def test_the_recommended_model_is_kept(any_service: RunningService) -> None:
    """A finished study leaves the recommended model as a model of its own, with its fit."""
    job_id = post(any_service, "/study", study_document()).json()["id"]
    any_service.finish(any_service.claim(job_id), "succeeded", result=STUDY_RESULT)
    model_id = any_service.client.get(f"/jobs/{job_id}").json()["model_id"]
    kept = any_service.client.get(f"/models/{model_id}").json()
    assert kept["model"] == in_both_spellings(STUDY_RESULT["rows"][1]["model"])
    assert kept["fit"] == [{**each, "statistics": {}} for each in STUDY_RESULT["rows"][1]["fit"]]
    assert kept["links_per_wing"] == kept["options"]["links_per_wing"] == 2


def test_nothing_recommended_nothing_kept(service: RunningService) -> None:
    """A study whose models all diverged leaves a result and no model."""
    job_id = post(service, "/study", study_document()).json()["id"]
    result = {**STUDY_RESULT, "recommended": {"links_per_wing": None, "reason": "no model flew"}}
    service.finish(service.claim(job_id), "succeeded", result=result)
    assert service.client.get(f"/jobs/{job_id}").json()["model_id"] is None
