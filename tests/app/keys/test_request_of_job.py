"""Who may see the request of a job."""

from __future__ import annotations

from app.keys.records import Scope
from tests.app.key_holders import holder, make_key
from tests.app.request_documents import simulate_document
from tests.app.running_service import RunningService


def test_nobody_else_sees_it(keyed_service: RunningService) -> None:
    """Another owner's job is not there; a key that may not read jobs may not read requests."""
    mine = make_key(keyed_service.database, "mine")
    reader = make_key(keyed_service.database, "mine", scopes=[Scope.JOBS_READ])
    writer = make_key(keyed_service.database, "mine", scopes=[Scope.JOBS_WRITE])
    other = make_key(keyed_service.database, "other")
    with holder(keyed_service, mine.text) as client:
        job = client.post("/simulate", json=simulate_document()).raise_for_status().json()["id"]
    statuses = {}
    for name, key in (("reader", reader), ("writer", writer), ("other", other)):
        with holder(keyed_service, key.text) as client:
            statuses[name] = client.get(f"/jobs/{job}/request").status_code
    assert statuses == {"reader": 200, "writer": 403, "other": 404}
