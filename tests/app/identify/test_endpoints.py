"""Laws of POST /identify and POST /validate/identify over real HTTP, with the broker away."""

from __future__ import annotations

import json
import statistics
import time
from typing import Any

import httpx
import pytest

from app.jobs import store, turns
from tests.app import calls
from tests.app.calls import JSON, LARGE_ANSWER_S, fault, prompt_fault
from tests.app.request_documents import SAMPLE_NAMES, Document, identify_document, sample_document
from tests.app.running_service import RunningService


def post(service: RunningService, document: Document, **headers: str) -> httpx.Response:
    """Make a request for an identification."""
    return calls.post(service, "/identify", document, **headers)


def test_accepts_with_the_broker_away(any_service: RunningService) -> None:
    """Four samples: 202, the place of the job, a queued row that the worker will find."""
    document = identify_document()
    answer = post(any_service, document)
    assert answer.status_code == 202
    job = answer.json()
    assert answer.headers["location"] == job["links"]["self"] == f"/jobs/{job['id']}"
    assert (job["status"], job["attempt"], job["progress"]) == ("queued", 0, None)
    assert [sample["name"] for sample in job["request"]["samples"]] == list(SAMPLE_NAMES)
    with any_service.database.read() as session:
        assert (unit := turns.next_unit(session)) is not None
        assert unit.job_id == job["id"]
        stored = store.load_request(session, job["id"])
    assert stored["aircraft"] == document["aircraft"]
    assert stored["flight"] == document["flight"]
    assert [s["theta_rad"] for s in stored["samples"]] == [s["theta_rad"] for s in document["samples"]]
    assert stored["search"] == {"method": "hybrid", "seed": 1}
    with any_service.database.write() as session:
        store.request_cancel(session, "local", job["id"])


def test_answers_in_100_ms(service: RunningService) -> None:
    """Four samples of a thousand rows together are accepted in under 100 ms (median of ten)."""
    text = json.dumps(identify_document())
    times = []
    for _ in range(11):
        start = time.perf_counter()
        assert service.client.post("/identify", content=text, headers=JSON).status_code == 202
        times.append(time.perf_counter() - start)
    median_ms = 1e3 * statistics.median(times[1:])
    print(f"POST /identify: {median_ms:.0f} ms")
    assert median_ms < 100.0


def test_same_key_same_answer(any_service: RunningService) -> None:
    """An idempotency key gives the first job again for the same body, and a conflict for another."""
    document = identify_document()
    first = post(any_service, document, **{"Idempotency-Key": "a-key"})
    again = post(any_service, document, **{"Idempotency-Key": "a-key"})
    assert again.status_code == first.status_code == 202
    assert again.json()["id"] == first.json()["id"]
    assert again.headers["location"] == first.headers["location"]
    assert again.headers["idempotency-replayed"] == "true"
    assert "idempotency-replayed" not in first.headers
    document["search"]["seed"] = 2
    problem = fault(post(any_service, document, **{"Idempotency-Key": "a-key"}), 409)
    assert (problem["code"], problem["pointer"]) == ("idempotency_conflict", "#header/Idempotency-Key")


def test_uploaded_and_inline_are_the_same(service: RunningService) -> None:
    """A request that refers to an uploaded flight stores the same rows as one with the rows inline."""
    document = identify_document()
    columns = {key: value for key, value in document["samples"][1].items() if key not in ("name", "role")}
    uploaded = service.client.post("/trajectories", json={"name": "flight", **columns}).json()
    document["samples"] = [{"trajectory_id": uploaded["id"], "weight": 2.0}]
    job = post(service, document).json()
    with service.database.read() as session:
        stored = store.load_request(session, job["id"])["samples"]
    assert stored == [{**columns, "name": "flight", "role": "train", "weight": 2.0}]


def newest_jobs(service: RunningService) -> list[str]:
    """Ids of the newest jobs."""
    page = service.client.get("/jobs", params={"limit": 200}).raise_for_status().json()
    return [job["id"] for job in page["jobs"]]


def test_validation_makes_no_job(service: RunningService) -> None:
    """Validate answers with a cost that grows with the search, and starts nothing."""
    before = newest_jobs(service)
    document = identify_document()
    small = service.client.post("/validate/identify", json=document)
    document["search"] = {"preset": "paper", "method": "pso", "generations": 20}
    large = service.client.post("/validate/identify", json=document)
    assert small.status_code == large.status_code == 200
    assert large.json()["cost"]["flights"] == 4 * 20 * 2500
    assert large.json()["cost"]["core_s"] > small.json()["cost"]["core_s"] > 0.0
    assert newest_jobs(service) == before


def test_waits_when_requested(service: RunningService) -> None:
    """`Prefer: wait=1` waits for an end that does not come, and says so."""
    start = time.perf_counter()
    answer = post(service, identify_document(), Prefer="respond-async, wait=1")
    assert answer.headers["preference-applied"] == "wait=1"
    assert 0.9 < time.perf_counter() - start < 5.0
    assert answer.json()["status"] == "queued"


def changed(path: str, value: Any) -> Document:
    """Build the valid request with one field changed."""
    return calls.changed(identify_document(), path, value)


# (field that is changed, its bad value, pointer of the fault, code, words that the hint must hold)
BAD_FIELDS = [
    ("/samples/0/phi_rad/17", float("nan"), None, "finite_number", "NaN"),
    ("/samples/0/theta_rad/3", float("inf"), None, "finite_number", "infinity"),
    ("/samples/1/psi_rad/5", "0.1", None, "float_type", "number"),
    ("/samples/0/phi_rad", [0.0] * 7, None, "unequal_lengths", "phi_rad"),
    ("/samples/2/time_s/40", 0.0, None, "time_not_rising", "Sort"),
    ("/samples/0/sweep_left_rad/57", 1.4, None, "sweep_out_of_range", "-1.3 to 1.3"),
    ("/samples/3/sweep_right_rad/5", 57.0, None, "sweep_out_of_range", "degrees"),
    ("/samples/0/thetas_rad", [0.0], None, "unknown_field", "theta_rad"),
    ("/samples/1/name", "train_rate_0.2", None, "name_not_unique", "name"),
    ("/samples/1/name", "../../etc/passwd", None, "string_pattern_mismatch", "letters"),
    ("/samples/1/weight", 0.0, None, "greater_than", "more than 0"),
    ("/samples/1/role", "test", None, "literal_error", "held_out"),
    (
        "/samples/1",
        {"trajectory_id": "traj_none"},
        "/samples/1/trajectory_id",
        "trajectory_not_found",
        "Upload",
    ),
    ("/samples", [], "/samples", "too_short", "more"),
    ("/samples", [{"trajectory_id": "x"}] * 65, "/samples", "too_long", "fewer"),
    ("/aircraft/wingspan_m", 6.0, None, "unknown_field", "span_m"),
    ("/aircraft/surfaces/0/span_m", -3.0, None, "greater_than", "more than 0"),
    ("/aircraft/surfaces/0/material/youngs_modulus_pa", 0.0, None, "greater_than", "more than 0"),
    ("/aircraft/surfaces/0/hinge/min_rad", 1.3, None, "range_upside_down", "Swap"),
    ("/aircraft/surfaces/1/name", "right wing", None, "name_not_unique", "Rename"),
    ("/aircraft/surfaces/1/hinge", None, "/aircraft/surfaces/1/hinge", "missing", "hinge"),
    ("/aircraft/surfaces/1/chord_m", None, None, "missing", "chord"),
    ("/aircraft/fuselage/density_kg_m3", None, None, "missing", "mass_kg"),
    ("/aircraft/fuselage/inertia_kg_m2", [1.0, -1.0, 1.0], None, "inertia_not_physical", "sign"),
    ("/flight/mach", 0.9, None, "less_than_equal", "0.7"),
    ("/flight/airspeed_m_s", True, None, "float_type", "number"),
    ("/model/links_per_wing", 17, None, "less_than_equal", "at most 16"),
    ("/model/links_per_wing", 2.5, None, "int_type", "whole"),
    (
        "/model/bounds/stiffness_nm_rad",
        [1e9, 1e2],
        "/model/bounds/stiffness_nm_rad/0",
        "range_upside_down",
        "low < high",
    ),
    (
        "/model/bounds/stiffness_nm_rad",
        [-5.0, 1e2],
        "/model/bounds/stiffness_nm_rad/0",
        "bound_not_positive",
        "positive",
    ),
    (
        "/model/bounds/damping_nms_rad",
        [1e-9, 1e9],
        "/model/bounds/damping_nms_rad/1",
        "bound_too_wide",
        "decades",
    ),
    ("/model/bounds/lag_s", [0.1, 1e3], "/model/bounds/lag_s/1", "bound_out_of_range", "Narrow"),
    ("/model/bounds/lag_s", [0.0, 0.1], "/model/bounds/lag_s/0", "bound_not_positive", "positive"),
    ("/model/bounds/division", [0.4, 0.5], "/model/bounds/division/0", "bounds_without_room", "1/3"),
    ("/search", {"method": "cma", "particles": 1}, "/search/particles", "greater_than_equal", "at least 4"),
    ("/model/aero_coefficients", ["lag_s", "lag_s"], "/model/aero_coefficients/1", "name_not_unique", "once"),
    ("/search/particles", 10**6, None, "less_than_equal", "100000"),
    ("/search/method", "genetic", None, "literal_error", "least_squares"),
    ("/search/seed", 2**60, None, "less_than_equal", "at most"),
]


@pytest.mark.parametrize(
    ("path", "value", "pointer", "code", "words"),
    BAD_FIELDS,
    ids=[f"{f[0]}={str(f[1])[:20]}" for f in BAD_FIELDS],
)
def test_bad_field_is_named(
    service: RunningService, path: str, value: Any, pointer: str | None, code: str, words: str
) -> None:
    """Every bad field gets its pointer, a stable code and a hint with the way out, within a second."""
    calls.assert_named(service, "/identify", changed(path, value), pointer or path, code, words)


def test_several_faults_are_reported_at_once(service: RunningService) -> None:
    """Independent faults are reported together, at most 20."""
    document = changed("/samples/0/time_s/40", 0.0)
    document["samples"][1]["theta_rad"][9] = 2.0
    pointers = [item["pointer"] for item in fault(post(service, document))["errors"]]
    assert pointers == ["/samples/0/time_s/40", "/samples/1/theta_rad/9"]
    document["samples"] = [{"bad": 1}] * 60
    assert len(fault(post(service, document))["errors"]) == 20


def test_held_out_alone_is_refused(service: RunningService) -> None:
    """Without a training sample there is nothing to fit."""
    document = identify_document()
    for sample in document["samples"]:
        sample["role"] = "held_out"
    assert fault(post(service, document))["errors"][0]["code"] == "no_training_sample"


def test_given_start_needs_a_start(service: RunningService) -> None:
    """`model.start = "given"` without `flight.start` is refused."""
    document = changed("/model/start", "given")
    del document["flight"]["start"]
    assert fault(post(service, document))["errors"][0]["pointer"] == "/flight/start"


def test_auto_mach_is_checked(service: RunningService) -> None:
    """`mach: "auto"` is accepted below the limit and refused beyond it."""
    assert post(service, changed("/flight/mach", "auto")).status_code == 202
    document = changed("/flight/mach", "auto")
    document["flight"]["airspeed_m_s"] = 280.0
    assert fault(post(service, document))["errors"][0]["code"] == "unsupported_regime"


def test_full_aircraft_is_accepted(service: RunningService) -> None:
    """Every optional field of aircraft, flight and model is understood and reaches the worker."""
    document = identify_document()
    wing, other = document["aircraft"]["surfaces"]
    del wing["chord_m"]
    wing.update(root_chord_m=0.35, tip_chord_m=0.25, elastic_axis_offset_m=-0.02, mass_axis_offset_m=0.01)
    wing["hinge"].update(min_rad=-0.1, max_rad=1.2)
    other["section"] = {
        "ei_flap_n_m2": 5e4,
        "ei_edge_n_m2": 5e5,
        "gj_n_m2": 3e4,
        "mass_per_length_kg_m": 15.0,
        "inertia_per_length_kg_m": [0.1, 0.2, 0.1],
    }
    tail = {**identify_document()["aircraft"]["surfaces"][0], "name": "tail", "position_m": [-2.5, 0.0, 0.0]}
    del tail["hinge"]
    tail["flexible"] = False
    document["aircraft"]["surfaces"].append(tail)
    document["aircraft"]["fuselage"] = {
        "mass_kg": 875.0,
        "inertia_kg_m2": [[60.0, 0.0, -1.0], [0.0, 1800.0, 0.0], [-1.0, 0.0, 1850.0]],
        "centre_of_mass_m": [0.05, 0.0, 0.0],
    }
    document["flight"].update(mach=0.4, wind_n_m_s=[1.0, 0.0, 0.0])
    document["model"] = {
        "links_per_wing": 4,
        "separate_wings": True,
        "aero_coefficients": ["lift_factor"],
        "bounds": {"stiffness_nm_rad": [1e2, 1e6], "lift_factor": [0.5, 1.5]},
        "lattice": {
            "chordwise": 4,
            "spanwise": 12,
            "core": {"law": "smoothed", "fraction": 0.04},
            "shape": "trimmed",
        },
        "step_s": 0.004,
        "start": "given",
    }
    answer = post(service, document)
    assert answer.status_code == 202, answer.text
    with service.database.read() as session:
        stored = store.load_request(session, answer.json()["id"])
    for part in ("aircraft", "flight", "model"):
        assert stored[part] == document[part]


def test_too_many_rows_are_refused(service: RunningService) -> None:
    """A million rows are refused by the field that holds them, within seconds."""
    document = identify_document()
    rows = [0] * 10**6
    columns = [key for key in sample_document(SAMPLE_NAMES[0]) if key.endswith(("_rad", "_s"))]
    # all columns at this length are more than any body may hold, so two of them are that long
    assert len(columns) * len(json.dumps(rows, separators=(",", ":"))) > service.settings.max_body_bytes
    document["samples"] = [{column: [0] for column in columns} | {"name": "long", "role": "train"}]
    document["samples"][0].update(time_s=rows, sweep_right_rad=rows)
    problem = prompt_fault(service, "/identify", document, within_s=LARGE_ANSWER_S)
    assert (problem["code"], problem["pointer"]) == ("invalid_request", "/samples/0/time_s")


def test_rows_of_uploads_are_counted_before_they_are_read(service: RunningService) -> None:
    """A short request that names a long flight many times is refused quickly."""
    rows = 50_000
    zero = [0.0] * rows
    columns = dict.fromkeys(("sweep_left_rad", "sweep_right_rad", "phi_rad", "theta_rad", "psi_rad"), zero)
    flight = {"time_s": [0.01 * row for row in range(rows)], **columns}
    uploaded = service.client.post("/trajectories", json=flight).raise_for_status().json()
    document = identify_document()
    document["samples"] = [{"trajectory_id": uploaded["id"], "name": f"s{i}"} for i in range(64)]
    assert prompt_fault(service, "/identify", document)["errors"][0]["code"] == "too_many_rows"


def test_a_million_samples_are_refused(service: RunningService) -> None:
    """A million sample objects are refused before they are built, within seconds."""
    document = {"samples": [{}] * 10**6}
    problem = prompt_fault(service, "/identify", document, 400, within_s=LARGE_ANSWER_S)
    assert problem["pointer"] == "/samples"


def test_form_is_not_json(service: RunningService) -> None:
    """A body of another kind is refused by its kind."""
    answer = service.client.post("/identify", data={"aircraft": "x"})
    assert fault(answer, 415)["pointer"] == "#header/Content-Type"
    assert fault(service.client.post("/identify", headers=JSON), 400)["code"] == "malformed_body"
