"""Laws of POST /optimize and POST /validate/optimize."""

from __future__ import annotations

import math
from typing import Any

import pytest

from app.jobs import store
from morphdata.optimize import Limits
from tests.app.calls import assert_named, changed, post
from tests.app.request_documents import RESULT, optimize_document
from tests.app.running_service import RunningService

# (field that is changed, its bad value, pointer of the fault, code, words that the hint must hold)
BAD_FIELDS = [
    ("/morph/final_rad", 0.0, None, "nothing_to_morph", "another"),
    ("/morph/final_rad", 1.4, None, "sweep_out_of_range", "-1.3 to 1.3"),
    ("/morph/initial_rad", -1.4, None, "sweep_out_of_range", "-1.3 to 1.3"),
    ("/morph/final_rad", 57.0, None, "less_than_equal", "at most 3.14"),
    ("/morph/duration_s", 1.0, None, "morph_too_short", "more than 1 s"),
    ("/morph/duration_s", 0.7, None, "morph_too_short", "max_rate_rad_s"),
    ("/limits/max_accel_rad_s2", 0.5, "/morph/duration_s", "morph_too_short", "2.828"),
    ("/limits/max_accel_rad_s2", 1.0, "/morph/duration_s", "morph_too_short", "2 s"),
    ("/limits/max_rate_rad_s", 0.0, None, "greater_than", "more than 0"),
    ("/limits/monotonic", "yes", None, "bool_type", "true"),
    ("/morph/knots", 2, None, "greater_than_equal", "at least 3"),
    ("/morph/settle_s", -1.0, None, "greater_than_equal", "at least 0"),
    ("/morph/goal", "speed", None, "literal_error", "minimum_time"),
    ("/morph/goal", "minimum_time", "/morph/max_variation_rad2", "missing", "Add"),
    ("/morph/max_variation_rad2", 0.5, None, "not_used", "minimum_time"),
    ("/weights", {"phi": 0.0, "theta": 0.0, "psi": 0.0}, None, "weights_all_zero", "weight"),
    ("/weights/phi", -1.0, None, "greater_than_equal", "at least 0"),
    ("/search/method", "least_squares", None, "literal_error", "hybrid"),
    ("/search/particles", 10**6, None, "less_than_equal", "10000"),
    ("/verify", "rigid", None, "literal_error", "flexible"),
    ("/flexible/elements", 1000, None, "less_than_equal", "at most 100"),
    ("/model", {}, "/model/parameters", "missing", "model_id"),
    ("/model", {"model_id": "model_none"}, "/model/model_id", "model_not_found", "GET /models"),
    ("/model/parameters/links_per_wing", 4, "/model/parameters/division", "wrong_shape", "result"),
    ("/model/step_s", 0.02, None, "less_than_equal", "at most 0.01"),
    ("/model/kind", "equivalent", None, "unknown_field", "another object"),
]


@pytest.mark.parametrize(
    ("path", "value", "pointer", "code", "words"),
    BAD_FIELDS,
    ids=[f"{f[0]}={str(f[1])[:20]}" for f in BAD_FIELDS],
)
def test_bad_field_is_named(
    service: RunningService, path: str, value: Any, pointer: str | None, code: str, words: str
) -> None:
    """Every bad field gets its pointer, a stable code and a hint with the way out."""
    document = changed(optimize_document(), path, value)
    assert_named(service, "/optimize", document, pointer or path, code, words)


@pytest.mark.parametrize(
    ("limits", "expected_s"),
    [
        (Limits(), 0.0),
        (Limits(max_rate_rad_s=0.5), 2.0),  # the mean rate may come near the limit, not reach it
        (Limits(max_accel_rad_s2=4.0), 1.0),  # half a radian each to speed up and to brake: 2 sqrt(1 / 4)
        (Limits(max_rate_rad_s=1.0, max_accel_rad_s2=2.0), 1.5),  # 0.5 s up, 0.5 s at full rate, 0.5 s down
        (Limits(max_rate_rad_s=10.0, max_accel_rad_s2=4.0), 1.0),  # the rate is never reached
    ],
)
def test_the_shortest_morph_is_that_of_full_power(limits: Limits, expected_s: float) -> None:
    """Rest to rest over 1 rad takes no less than full acceleration, full rate and full braking."""
    assert math.isclose(limits.shortest_morph_s(1.0), expected_s)


def test_a_front_needs_a_limit(service: RunningService) -> None:
    """Without rate and acceleration limits a front of durations has no shortest one."""
    document = changed(optimize_document(), "/morph/goal", "pareto")
    document["limits"] = {"monotonic": False}
    assert_named(service, "/optimize", document, "/limits", "missing", "max_rate_rad_s")


def test_a_start_must_be_there(service: RunningService) -> None:
    """`model.start = "given"` without `flight.start` is refused."""
    document = changed(optimize_document(), "/model/start", "given")
    del document["flight"]["start"]
    assert_named(service, "/optimize", document, "/flight/start", "start_missing", "trim")


def test_a_rigid_aircraft_is_refused(service: RunningService) -> None:
    """Where nothing bends there is no equivalent model."""
    document = optimize_document()
    for surface in document["aircraft"]["surfaces"]:
        surface["flexible"] = False
    assert_named(service, "/optimize", document, "/aircraft/surfaces", "nothing_to_bend", "flexible")


def test_every_option_reaches_the_worker(service: RunningService) -> None:
    """All of morph, limits, weights, search, verification and lattice arrive as they were sent."""
    document = optimize_document()
    document["model"] = {
        "parameters": RESULT["model"],
        "lattice": {
            "chordwise": 2,
            "spanwise": 6,
            "core": {"law": "smoothed", "fraction": 0.05},
            "shape": "trimmed",
        },
        "start": "given",
    }
    document["morph"] = {
        "initial_rad": 0.1,
        "final_rad": 1.0,
        "duration_s": 4.0,
        "knots": 5,
        "settle_s": 1.0,
        "free_values": True,
        "goal": "minimum_time",
        "max_variation_rad2": 0.4,
        "front_points": 5,
    }
    document["limits"] = {
        "max_rate_rad_s": 1.0,
        "max_accel_rad_s2": 6.0,
        "monotonic": False,
        "max_hinge_torque_nm": 900.0,
    }
    document["weights"] = {"phi": 1.0, "theta": 2.0, "psi": 0.0}
    document["search"] = {
        "method": "pso",
        "particles": 20,
        "generations": 10,
        "c1": 1.5,
        "c2": 1.5,
        "inertia": 0.7,
        "seed": 3,
        "max_seconds": 60.0,
    }
    document["verify"] = "flexible"
    document["flexible"] = {"elements": 5}
    answer = post(service, "/optimize", document)
    assert answer.status_code == 202, answer.text
    with service.database.read() as session:
        read = store.load_request(session, answer.json()["id"])
    assert RESULT["model"].items() <= read["model"]["parameters"].items()
    for part in document:
        if part != "model":
            assert read[part] == document[part]
    assert (read["model"]["lattice"], read["model"]["start"]) == (document["model"]["lattice"], "given")
    assert answer.json()["request"]["final_rad"] == 1.0


def test_cost_grows_with_what_is_requested(service: RunningService) -> None:
    """More particles, a front of durations, verification: each costs more; too much is refused."""

    def cost(path: str = "/search/seed", value: Any = 1) -> float:
        answer = post(service, "/validate/optimize", changed(optimize_document(), path, value))
        assert answer.status_code == 200, answer.text
        return float(answer.json()["cost"]["core_s"])

    plain = cost()
    assert cost("/search/preset", "paper") > plain
    assert cost("/morph/goal", "pareto") > plain
    assert cost("/verify", "flexible") > plain
    endless = changed(
        optimize_document(), "/search", {"method": "pso", "particles": 10_000, "generations": 10_000}
    )
    assert_named(service, "/optimize", endless, "/search/generations", "too_much_work", "fewer")
