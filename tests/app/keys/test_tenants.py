"""Two tenants on one service: another's things are as if they did not exist, to the byte."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import httpx
import pytest

from app.main import routed_app
from app.openapi import openapi_document
from tests.app.key_holders import holder, make_key
from tests.app.request_documents import (
    RESULT,
    Document,
    identify_document,
    optimize_document,
    sample_document,
    simulate_document,
    study_document,
)
from tests.app.running_service import RunningService
from tests.app.webhooks.receiver import NOBODY

NOBODYS = {
    "job_id": "job_01k0c3v9fh8x2m4n6p8q0r2s4t",
    "model_id": "model_01k0c3v9fh8x2m4n6p8q0r2s4t",
    "trajectory_id": "traj_01k0c3v9fh8x2m4n6p8q0r2s4t",
    "webhook_id": "hook_01k0c3v9fh8x2m4n6p8q0r2s4t",
}
FILE = "curves.csv"
QUERY = {"/models/{model_id}/export": {"format": "npz"}}  # of routes that do without none


@dataclass(frozen=True)
class Tenants:
    """The owner of one thing of every kind, and a stranger with every scope.

    Attributes
    ----------
    things : dict
        Name of a path parameter -> id of the owner's thing.
    """

    owner: httpx.Client
    stranger: httpx.Client
    things: dict[str, str]


@pytest.fixture(scope="module")
def tenants(keyed_service: RunningService) -> Iterator[Tenants]:
    """Alpha owns; beta looks."""
    keys = [make_key(keyed_service.database, owner) for owner in ("alpha", "beta")]
    with holder(keyed_service, keys[0].text) as owner, holder(keyed_service, keys[1].text) as stranger:
        job = made(owner.post("/identify", json=identify_document()))
        keyed_service.finish(
            keyed_service.claim(job), "succeeded", result=RESULT, artifacts={FILE: b"t\n0\n"}
        )
        flight = sample_document("train_rate_0.5")
        del flight["role"]
        things = {
            "job_id": job,
            "model_id": owner.get(f"/jobs/{job}").json()["model_id"],
            "trajectory_id": made(owner.post("/trajectories", json=flight)),
            "webhook_id": made(owner.post("/webhooks", json={"url": NOBODY})),
        }
        yield Tenants(owner, stranger, things)


def made(answer: httpx.Response) -> str:
    """The id of what a call made."""
    identifier: str = answer.raise_for_status().json()["id"]
    return identifier


def reported(answer: httpx.Response, ids: dict[str, str]) -> tuple[int, dict[str, str], str]:
    """The contents of a response, except for ids sent by the caller and the time of day."""
    text = answer.text
    for identifier in ids.values():
        text = text.replace(identifier, "ID")
    headers = {name: value for name, value in answer.headers.items() if name != "date"}
    return answer.status_code, headers, text


@lru_cache(maxsize=1)
def published() -> Document:
    """The OpenAPI document."""
    return openapi_document(routed_app())


def operations() -> list[tuple[str, str]]:
    """Every operation with a path parameter."""
    paths = published()["paths"]
    return [(method, path) for path, found in paths.items() for method in found if "{" in path]


def place(path: str, ids: dict[str, str]) -> str:
    """The path with ids in it."""
    return re.sub(r"\{(\w+)\}", lambda name: {**ids, "name": FILE}[name[1]], path)


@pytest.mark.parametrize(("method", "path"), operations(), ids=lambda part: part)
def test_anothers_thing_is_no_thing(tenants: Tenants, method: str, path: str) -> None:
    """Every route with an id: a stranger gets the same 404 as for an id that was never given out."""
    headers = {"X-Request-ID": "same", "Accept": "application/json"}
    theirs, nobodys = (
        tenants.stranger.request(method, place(path, ids), headers=headers, params=QUERY.get(path))
        for ids in (tenants.things, NOBODYS)
    )
    assert theirs.status_code == 404
    assert reported(theirs, tenants.things) == reported(nobodys, NOBODYS)


def test_the_owner_still_has_everything(tenants: Tenants) -> None:
    """What the stranger tried changed nothing; the lists of each show their own things only."""
    for path, parameter in (
        ("/jobs", "job_id"),
        ("/models", "model_id"),
        ("/webhooks", "webhook_id"),
    ):
        assert tenants.things[parameter] in tenants.owner.get(path).text
        assert tenants.things[parameter] not in tenants.stranger.get(path).text
        assert tenants.owner.get(f"{path}/{tenants.things[parameter]}").status_code == 200
    assert tenants.owner.get(f"/trajectories/{tenants.things['trajectory_id']}").status_code == 200
    assert tenants.owner.get(f"/jobs/{tenants.things['job_id']}/artifacts/{FILE}").status_code == 200


def bodies(ids: dict[str, str]) -> list[tuple[str, Document]]:
    """A request for every field that names something."""
    sample = {"role": "train", "trajectory_id": ids["trajectory_id"]}
    identify, study = identify_document(), study_document()
    identify["samples"] = study["samples"] = [sample]
    equivalent = {"kind": "equivalent", "model_id": ids["model_id"]}
    warm = {**identify_document(), "model": {"links_per_wing": RESULT["model"]["links_per_wing"]}}
    return [
        *(
            ("identify", {**warm, "search": {"warm_start": {name: ids[name]}}})
            for name in ("job_id", "model_id")
        ),
        ("identify", identify),
        ("study", study),
        ("simulate", {**simulate_document(), "model": equivalent}),
        ("optimize", {**optimize_document(), "model": {"model_id": ids["model_id"]}}),
    ]


def id_fields(start: Any) -> set[str]:
    """Names of all fields below a schema that end in ``_id``."""
    components = published()["components"]["schemas"]
    pending, seen, found = [start], set(), set()
    while pending:
        part = pending.pop()
        if isinstance(part, list):
            pending.extend(part)
        elif isinstance(part, dict):
            pending.extend(part.values())
            found |= {name for name in part.get("properties", {}) if name.endswith("_id")}
            reference = str(part.get("$ref", "")).rpartition("/")[2]
            if reference and reference not in seen:
                seen.add(reference)
                pending.append(components[reference])
    return found


def test_every_field_with_an_id_is_in_these_tests() -> None:
    """A request field that names something and is missing here would go untested."""
    paths = published()["paths"]
    bodies = [reported.get("requestBody") for found in paths.values() for reported in found.values()]
    fields = id_fields(bodies)
    assert fields == {"trajectory_id", "model_id", "job_id"}


def test_bodies_cannot_name_anothers_things(tenants: Tenants) -> None:
    """In a body too another's id is the same fault as one never given out; for its owner it is valid."""
    headers = {"X-Request-ID": "same"}
    for (operation, theirs), (_, nobodys) in zip(bodies(tenants.things), bodies(NOBODYS), strict=True):
        for path in (f"/{operation}", f"/validate/{operation}"):
            answers = [tenants.stranger.post(path, json=body, headers=headers) for body in (theirs, nobodys)]
            assert answers[0].status_code == 422, path
            assert reported(answers[0], tenants.things) == reported(answers[1], NOBODYS)
        assert tenants.owner.post(f"/validate/{operation}", json=theirs).status_code == 200


def test_keys_of_one_owner_see_the_same(keyed_service: RunningService, tenants: Tenants) -> None:
    """A second key of the owner sees what the first one made."""
    with holder(keyed_service, make_key(keyed_service.database, "alpha").text) as colleague:
        assert colleague.get(f"/jobs/{tenants.things['job_id']}").status_code == 200


def test_idempotency_keys_are_an_owners_own(tenants: Tenants) -> None:
    """The same idempotency key and body of two owners are two jobs."""
    header = {"Idempotency-Key": "the-same"}
    first, second = (
        made(client.post("/simulate", json=simulate_document(), headers=header))
        for client in (tenants.owner, tenants.stranger)
    )
    assert first != second
    assert tenants.stranger.get(f"/jobs/{first}").status_code == 404
