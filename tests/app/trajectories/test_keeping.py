"""Laws of listing and deleting uploaded flights and identified models, over real HTTP on both databases."""

from __future__ import annotations

from typing import Any

from sqlalchemy import select

from app.database import Database
from app.documents import packed
from app.jobs import store
from app.tables import audit_log
from app.trajectories.repository import insert_trajectory
from app.trajectories.schemas import TrajectoryUpload
from tests.app.calls import fault, post
from tests.app.request_documents import RESULT, SAMPLE_NAMES, identify_document, sample_document
from tests.app.running_service import RunningService

COLUMNS = ("time_s", "sweep_left_rad", "sweep_right_rad", "phi_rad", "theta_rad", "psi_rad")


def uploaded(service: RunningService, name: str) -> str:
    """Upload an example flight under a name and give its id."""
    sample = sample_document(SAMPLE_NAMES[0])
    answer = post(service, "/trajectories", {"name": name, **{column: sample[column] for column in COLUMNS}})
    assert answer.status_code == 201, answer.text
    trajectory_id: str = answer.json()["id"]
    return trajectory_id


def of_someone(database: Database) -> str:
    """Another owner's flight."""
    sample = sample_document(SAMPLE_NAMES[0])
    columns = {column: sample[column] for column in COLUMNS}
    upload = TrajectoryUpload(name="theirs", **columns)
    with database.write() as session:
        return insert_trajectory(session, "someone", None, upload, packed(columns)).id


def deeds(database: Database, target: str) -> list[Any]:
    """What the audit log says of a thing."""
    with database.read() as session:
        return list(session.scalars(select(audit_log.c.action).where(audit_log.c.target == target)))


def test_pages_hold_every_flight_once(any_service: RunningService) -> None:
    """Newest first, without rows, and nobody else's."""
    theirs = of_someone(any_service.database)
    made = [uploaded(any_service, f"flight-{number}") for number in range(3)]
    first = any_service.client.get("/trajectories", params={"limit": 2}).json()
    rest = any_service.client.get(
        "/trajectories", params={"limit": 200, "cursor": first["next_cursor"]}
    ).json()
    seen = [flight["id"] for flight in first["trajectories"] + rest["trajectories"]]
    assert seen == sorted(set(seen), reverse=True)
    assert set(made) <= set(seen)
    assert theirs not in seen
    assert rest["next_cursor"] is None
    assert "time_s" not in first["trajectories"][0]


def test_deleting_a_flight_harms_no_job(any_service: RunningService) -> None:
    """The flight is gone, for its owner only; a job that was started with it reads its own copy."""
    theirs, mine = of_someone(any_service.database), uploaded(any_service, "mine")
    document = {**identify_document(), "samples": [{"trajectory_id": mine, "role": "train"}]}
    job = post(any_service, "/identify", document).json()
    client = any_service.client
    assert client.delete(f"/trajectories/{mine}").status_code == 204
    for _ in range(2):
        assert fault(client.delete(f"/trajectories/{mine}"), 404)["code"] == "trajectory_not_found"
    assert client.get(f"/trajectories/{mine}").status_code == 404
    assert fault(client.delete(f"/trajectories/{theirs}"), 404)
    with any_service.database.read() as session:
        [sample] = store.load_request(session, job["id"])["samples"]
    assert sample["time_s"] == sample_document(SAMPLE_NAMES[0])["time_s"]
    assert deeds(any_service.database, mine)[-1] == "trajectory.delete"


def test_deleting_a_model_leaves_its_job(any_service: RunningService) -> None:
    """The model is gone, for its owner only; the job keeps its result and names no model any more."""
    found = {}
    for owner in ("local", "someone"):
        with any_service.database.write() as session:
            job = store.create_job(session, owner=owner, operation="identify", request=identify_document())
            claim = store.claim_job(session, job.id, "w")
            assert claim is not None
            assert store.finish_job(session, claim, "succeeded", result=RESULT)
            found[owner] = store.get_job(session, owner, job.id)
    client, mine = any_service.client, found["local"]
    assert client.delete(f"/models/{mine.model_id}").status_code == 204
    assert fault(client.get(f"/models/{mine.model_id}"), 404)
    assert fault(client.delete(f"/models/{found['someone'].model_id}"), 404)
    assert client.get(f"/jobs/{mine.id}").json()["model_id"] is None
    assert client.get(f"/jobs/{mine.id}/result").json()["model"] == RESULT["model"]
    assert deeds(any_service.database, str(mine.model_id)) == ["model.delete"]
