"""The whole OpenAPI document against a running service that demands keys, with two tenants.

Whatever is sent: no 5xx, no status and no content type that the document does not have, every answer in its
schema, and nothing of another tenant's. The seed is fixed; ``MORPHID_FUZZ_SEED`` sets another.
"""

from __future__ import annotations

import copy
import json
import os
from collections import Counter
from collections.abc import Callable, Iterator
from typing import Any

import httpx
import pytest
import schemathesis
from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st
from pydantic import TypeAdapter
from schemathesis import Case, GenerationMode
from schemathesis.checks import not_a_server_error
from schemathesis.specs.openapi.checks import (
    content_type_conformance,
    response_headers_conformance,
    response_schema_conformance,
    status_code_conformance,
)

from app.settings import Settings
from morphdata.base import Identifier
from tests.app.request_documents import RESULT
from tests.app.running_service import DEAD_BROKER, RunningService, running_service
from tests.app.tenants import Tenant, client_json, new_tenant, replenish, short_requests
from tests.app.webhooks.receiver import NOBODY
from tests.servers.stores import migrated_sqlite

SEED = int(os.environ.get("MORPHID_FUZZ_SEED", "20260401"))
QUICK, LONG = 6, 50  # examples of each kind for each operation
CHECKS = [
    not_a_server_error,
    status_code_conformance,
    content_type_conformance,
    response_headers_conformance,
    response_schema_conformance,
]
JSON = "application/json"
Operation = Any  # of the document, by schemathesis
VOLATILE = ("queue", "eta_s", "request_id")  # others' jobs rightly change one's place in the queue
GUESSES = ["own", "foreign", "made_up"]


@pytest.fixture(scope="module", params=["sqlite", pytest.param("postgres", marks=pytest.mark.slow)])
def guarded(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[RunningService]:
    """A running service that demands keys; Postgres refuses texts that SQLite takes."""
    if request.param == "sqlite":
        url = migrated_sqlite(tmp_path_factory.mktemp("guarded") / "s.sqlite3")
    else:
        url = request.getfixturevalue("postgres_server").migrated_database()
    chosen = Settings(
        database_url=url,
        broker_url=DEAD_BROKER,
        auth="keys",
        max_wait_s=0.05,
        max_body_bytes=2**20,
        event_poll_s=0.02,
    )
    with running_service(chosen) as running:
        yield running


@pytest.fixture(scope="module")
def tenants(guarded: RunningService) -> Iterator[tuple[Tenant, Tenant]]:
    """The caller, and the tenants whose data must not be seen."""
    ours, theirs = new_tenant(guarded, "tenant-a"), new_tenant(guarded, "tenant-b")
    yield ours, theirs
    for tenant in (ours, theirs):
        tenant.client.close()


@pytest.fixture(scope="module")
def operations(guarded: RunningService) -> list[Operation]:
    """Every operation of the service's own document, deletions last."""
    document = guarded.client.get("/openapi.json").raise_for_status().json()
    schema = schemathesis.openapi.from_dict(document)
    schema.config.update(base_url=guarded.url)
    found = [result.ok() for result in schema.get_all_operations()]
    return sorted(found, key=lambda operation: operation.method.upper() == "DELETE")


def fuzz(
    examples: int, strategy: st.SearchStrategy[Any], test: Callable[[Any], None], chosen: int = SEED
) -> None:
    """Run `test` on so many examples, the same ones for the same seed."""
    limits = settings(
        max_examples=examples,
        deadline=None,
        database=None,
        phases=[Phase.explicit, Phase.generate, Phase.shrink],
        suppress_health_check=list(HealthCheck),
    )
    seed(chosen)(limits(given(strategy)(test)))()


def cases(operation: Operation) -> st.SearchStrategy[tuple[Case, str]]:
    """Requests that the document allows and others, about own, foreign and made-up things."""
    modes = (GenerationMode.POSITIVE, GenerationMode.NEGATIVE)
    strategies = [operation.as_strategy(generation_mode=mode) for mode in modes if _can(operation, mode)]
    return st.tuples(st.one_of(strategies), st.sampled_from(GUESSES))


def _can(operation: Operation, mode: GenerationMode) -> bool:
    """Nothing can be wrong in a request that has no parts."""
    parts = [*operation.iter_parameters(), *operation.body]
    return mode is GenerationMode.POSITIVE or bool(parts)


def send(case: Case, asking: Tenant) -> httpx.Response:
    """Send a case with a tenant's key; event streams are requested as JSON because they do not end."""
    headers = dict(asking.headers)
    if case.path.endswith("/events"):
        headers["Accept"] = JSON
    response = case.call(headers=headers, timeout=30.0)
    # not ready is what readiness is there to say, and documented
    unready = case.path == "/readyz" and response.status_code == 503
    case.validate_response(response, checks=CHECKS[1:] if unready else CHECKS, headers=headers)
    return response  # type: ignore[return-value]


def point_at(case: Case, tenant: Tenant) -> bool:
    """Put ids of a tenant's things into the path; False when it has no place for one."""
    names = [name for name in case.path_parameters or {} if name in tenant.ids]
    for name in names:
        case.path_parameters[name] = tenant.ids[name][len(str(case.query)) % len(tenant.ids[name])]
    return bool(names)


def assert_nothing_leaks(response: Any, theirs: Tenant, what: str) -> None:
    """No answer holds anything of the other tenant's."""
    assert theirs.marker not in response.text, f"{what} shows another tenant's things"


def look_at_everything(
    examples: int, operations: list[Operation], guarded: RunningService, tenants: tuple[Tenant, Tenant]
) -> None:
    """Fuzz every operation as the first tenant; the second one's things stay unseen and unchanged."""
    ours, theirs = tenants
    replenish(guarded, ours)  # an earlier test may have deleted what there was
    before = everything(theirs)
    failures: list[Exception] = []
    seen: dict[str, Counter[int]] = {}
    for operation in operations:
        if operation.method.upper() == "DELETE":
            replenish(guarded, ours)
        try:
            statuses = seen.setdefault(operation.label, Counter())
            fuzz(examples, cases(operation), look_at(operation, ours, theirs, statuses))
        except Exception as failure:  # noqa: BLE001 - all operations are tested before any failure is reported
            failures.append(failure)
        for hook in client_json(ours, "/webhooks")["webhooks"]:
            if hook["id"] not in ours.ids["webhook_id"]:  # there is a limit, which few requests should meet
                ours.client.delete(f"/webhooks/{hook['id']}")
    if failures:
        raise ExceptionGroup("operations that do not do what the document says", failures)
    assert everything(theirs) == before
    if examples >= LONG:  # otherwise a suite that is refused everywhere would prove nothing
        plain = [operation.label for operation in operations if not operation.body]
        assert [label for label in plain if min(seen[label]) >= 300] == []


def look_at(
    operation: Operation, ours: Tenant, theirs: Tenant, statuses: Counter[int]
) -> Callable[[Any], None]:
    """Make the test of one operation."""

    def once(chosen: tuple[Case, str]) -> None:
        case, about = chosen
        pointed = about != "made_up" and point_at(case, ours if about == "own" else theirs)
        response = send(case, ours)
        statuses[response.status_code] += 1
        assert_nothing_leaks(response, theirs, operation.label)
        if pointed and about == "foreign":
            assert 400 <= response.status_code < 500, f"{operation.label} touches another tenant's things"

    return once


def everything(tenant: Tenant) -> dict[str, Any]:
    """All that a tenant can read of its own."""
    found: dict[str, Any] = {}
    for path in ("/jobs?limit=200", "/models", "/webhooks"):
        found[path] = client_json(tenant, path)
    for job_id in tenant.ids["job_id"]:
        for part in ("", "/artifacts", "/result"):
            found[job_id + part] = tenant.client.get(f"/jobs/{job_id}{part}").text
    for trajectory_id in tenant.ids["trajectory_id"]:
        found[trajectory_id] = client_json(tenant, f"/trajectories/{trajectory_id}")
    return {key: _lasting(value) for key, value in found.items()}


def _lasting(value: Any) -> Any:
    """Leave out what differs from request to request."""
    if isinstance(value, dict):
        return {key: _lasting(item) for key, item in value.items() if key not in VOLATILE}
    if isinstance(value, list):
        return [_lasting(item) for item in value]
    try:
        return _lasting(json.loads(value)) if isinstance(value, str) and value[:1] in "{[" else value
    except ValueError:
        return value


def test_the_document_is_what_the_service_does(
    operations: list[Operation], guarded: RunningService, tenants: tuple[Tenant, Tenant]
) -> None:
    """Nothing undocumented, nothing broken and nothing of another tenant's, in a short run."""
    look_at_everything(QUICK, operations, guarded, tenants)


@pytest.mark.slow
def test_the_document_is_what_the_service_does_for_long(
    operations: list[Operation], guarded: RunningService, tenants: tuple[Tenant, Tenant]
) -> None:
    """The same with many more requests."""
    print(f"MORPHID_FUZZ_SEED={SEED}")
    look_at_everything(LONG, operations, guarded, tenants)


# ------------------------------------------------- requests that are valid but for one thing

ODD = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(min_value=-(2**70), max_value=2**70),
    st.floats(allow_nan=True, allow_infinity=True),
    st.text(max_size=20),
    st.text(alphabet="\x00\ud800\u202e/.%~'\"<>=+-@\r\n", max_size=8),
    st.sampled_from([[], {}, [[]], [None] * 5, {"": {}}, 1e308, -0.0, 5e-324, 2**53 + 1, "NaN", "null", ""]),
)


def places(value: Any, at: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Every place in a document; of a list of numbers the first and the last."""
    found = [at] if at else []
    if isinstance(value, dict):
        for key, item in value.items():
            found += places(item, (*at, key))
    elif isinstance(value, list):
        for number in sorted({0, len(value) - 1} if value else ()):
            found += places(value[number], (*at, number))
    return found


@st.composite
def nearly_valid(draw: st.DrawFn, document: Any) -> Any:
    """A valid document with one to three places removed, replaced or added to."""
    changed = copy.deepcopy(document)
    for _ in range(draw(st.integers(1, 3))):
        options = places(changed)
        if not options:
            break
        *parents, last = draw(st.sampled_from(options))
        holder = changed
        for part in parents:
            holder = holder[part]
        deed = draw(st.sampled_from(["replace", "replace", "remove", "add"]))
        if deed == "remove" and isinstance(holder, dict):
            del holder[last]
        elif deed == "add" and isinstance(holder, dict):
            holder[draw(st.text(max_size=10))] = copy.deepcopy(draw(ODD))
        else:
            holder[last] = copy.deepcopy(draw(ODD))
    return changed


def spoil(
    examples: int, operations: list[Operation], ours: Tenant, theirs: Tenant, chosen: int = SEED
) -> None:
    """Send each operation's valid request with a few things wrong, to the call and to its validation."""
    by_path = {(operation.method.upper(), operation.path): operation for operation in operations}
    flight = {
        k: v for k, v in short_requests()["identify"]["samples"][0].items() if k not in ("role", "weight")
    }
    documents: dict[str, Any] = {f"/{name}": document for name, document in short_requests().items()}
    documents |= {f"/validate{path}": document for path, document in documents.items()}
    documents |= {
        "/trajectories": flight,
        "/webhooks": {"url": NOBODY, "events": ["job.failed"]},
    }
    for path, document in documents.items():
        operation = by_path["POST", path]
        assert answered(operation, document, ours, theirs) < 300  # before anything is odd
        fuzz(examples, nearly_valid(document), answers(operation, ours, theirs), chosen)


def answered(operation: Operation, body: Any, ours: Tenant, theirs: Tenant) -> int:
    """Send a body and look at the answer; its status."""
    # not sent by schemathesis: its encoder refuses NaN and lone surrogates, ours must answer them
    response = ours.post(operation.path, body)
    operation.Case(media_type=JSON).validate_response(response, checks=CHECKS)
    assert_nothing_leaks(response, theirs, operation.label)
    return response.status_code


def answers(operation: Operation, ours: Tenant, theirs: Tenant) -> Callable[[Any], None]:
    """Make the test of one operation's answers to bodies."""

    def once(body: Any) -> None:
        answered(operation, body, ours, theirs)

    return once


def test_nearly_valid_requests_are_answered(
    operations: list[Operation], tenants: tuple[Tenant, Tenant]
) -> None:
    """A valid request with something odd in it gets a documented answer, in a short run."""
    spoil(3 * QUICK, operations, *tenants)


@pytest.mark.slow
def test_nearly_valid_requests_are_answered_for_long(
    operations: list[Operation], guarded: RunningService, tenants: tuple[Tenant, Tenant]
) -> None:
    """The same with many more requests, half of them on each database."""
    print(f"MORPHID_FUZZ_SEED={SEED}")
    of_database = SEED + (guarded.database.engine.dialect.name == "postgresql")
    spoil(2 * LONG, operations, *tenants, of_database)


# ------------------------------------------------- another tenant's things, named in bodies and headers


def foreign_bodies(theirs: Tenant) -> list[tuple[str, Any]]:
    """Requests, valid but that they name things of another tenant's."""
    found = []
    requests = short_requests()
    for name in ("identify", "study"):
        document = copy.deepcopy(requests[name])
        document["samples"] = [{"trajectory_id": theirs.ids["trajectory_id"][0], "role": "train"}]
        found.append((name, document))
    model = theirs.ids["model_id"][0]
    found.append(("simulate", {**requests["simulate"], "model": {"kind": "equivalent", "model_id": model}}))
    found.append(("optimize", {**requests["optimize"], "model": {"model_id": model}}))
    for begin in ({"model_id": model}, {"job_id": theirs.ids["job_id"][0]}):
        document = {**requests["identify"], "model": {"links_per_wing": RESULT["model"]["links_per_wing"]}}
        found.append(("identify", {**document, "search": {"warm_start": begin}}))
    return found


def test_every_field_that_names_a_thing_is_tried(operations: list[Operation]) -> None:
    """A new field that takes an identifier belongs into `foreign_bodies`: it may lead to another tenant."""
    pattern = json.dumps(TypeAdapter(Identifier).json_schema()["pattern"])
    document = operations[0].schema.raw_schema
    found = {
        name
        for title, schema in document["components"]["schemas"].items()
        for name, of in schema.get("properties", {}).items()
        if pattern in json.dumps(of) and title != "Origin"  # an exported file carries it, nobody looks it up
    }
    assert found == {"trajectory_id", "model_id", "job_id"}


def test_bodies_cannot_name_anothers_things(tenants: tuple[Tenant, Tenant]) -> None:
    """Flights and models of another tenant's are unknown to call and validation: 422, as made-up ones.

    The very same request is valid for their owner.
    """
    ours, theirs = tenants
    for name, document in foreign_bodies(theirs):
        for path in (f"/{name}", f"/validate/{name}"):
            answer = ours.post(path, document)
            assert answer.status_code == 422, (path, answer.text)
            assert_nothing_leaks(answer, theirs, path)
            text = json.dumps(document)
            for identifier in (item for ids in theirs.ids.values() for item in ids):
                text = text.replace(f'"{identifier}"', '"x"')
            made_up = json.loads(text)
            codes = [[e["code"] for e in a.json()["errors"]] for a in (answer, ours.post(path, made_up))]
            assert codes[0] == codes[1]
        assert theirs.post(f"/validate/{name}", document).status_code == 200


def test_idempotency_keys_are_a_tenants_own(tenants: tuple[Tenant, Tenant]) -> None:
    """The same key and body from two tenants are two jobs."""
    ours, theirs = tenants
    document = short_requests()["simulate"]
    first, second = (
        tenant.made("/simulate", document, **{"Idempotency-Key": "k1"}) for tenant in (theirs, ours)
    )
    assert first != second
    assert theirs.made("/simulate", document, **{"Idempotency-Key": "k1"}) == first
    assert ours.client.get(f"/jobs/{first}").status_code == 404


def test_cursors_cannot_name_anothers_things(tenants: tuple[Tenant, Tenant]) -> None:
    """A cursor that is another tenant's id shows one's own things only."""
    ours, theirs = tenants
    for path, name in (("/jobs", "job_id"), ("/models", "model_id")):
        for identifier in theirs.ids[name]:
            answer = ours.client.get(path, params={"cursor": identifier, "limit": 200})
            assert answer.status_code == 200
            assert_nothing_leaks(answer, theirs, path)


def test_without_a_key_nothing_is_seen(guarded: RunningService, operations: list[Operation]) -> None:
    """Without a key and with a wrong one every operation but the health checks is 401, as documented."""
    for operation in operations:
        path = operation.path.replace("{", "").replace("}", "")
        for headers in ({}, {"Authorization": "Bearer nonsense"}):
            answer = guarded.client.request(operation.method.upper(), path, headers=headers)
            expected = {200, 503} if path in ("/livez", "/readyz") else {401, 429}
            assert answer.status_code in expected, (operation.label, answer.text)
