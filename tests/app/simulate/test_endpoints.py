"""Laws of POST /simulate and POST /validate/simulate."""

from __future__ import annotations

from typing import Any

import pytest

from app.jobs import store
from morphdata.parameters import flown_with
from morphdata.simulate import SimulateRequest
from tests.app.calls import assert_named, changed, post
from tests.app.request_documents import RESULT, Document, identify_document, simulate_document
from tests.app.running_service import RunningService

TABLE = {"kind": "tabulated", "time_s": [0.0, 0.1, 0.2], "angle_rad": [0.0, 0.1, 0.2]}
SPLINE = {"kind": "spline", "knot_time_s": [0.0, 1.0, 2.0], "knot_angle_rad": [0.0, 0.5, 1.0]}
AS_IDENTIFIED = {
    "lattice": {"chordwise": 2, "spanwise": 8, "core": {"law": "line", "fraction": 0.1}, "shape": "trimmed"},
    "step_s": 0.004,
    "start": "given",
}


def stored(service: RunningService, document: Document) -> Document:
    """Post a request and give what the worker reads of it."""
    answer = post(service, "/simulate", document)
    assert answer.status_code == 202, answer.text
    with service.database.read() as session:
        return store.load_request(session, answer.json()["id"])


def equivalent(**model: Any) -> Document:
    """Make a request for a flight of an equivalent model."""
    return changed(simulate_document(), "/model", {"kind": "equivalent", **model})


def identified(service: RunningService, owner: str = "local", **model: Any) -> str:
    """Leave an identified model and give its id."""
    with service.database.write() as session:
        job = store.create_job(session, owner=owner, operation="identify", request=identify_document())
        claim = store.claim_job(session, job.id, "a test")
        assert claim is not None
        store.finish_job(
            session, claim, "succeeded", result={**RESULT, "model": {**RESULT["model"], **model}}
        )
        model_id = store.get_job(session, owner, job.id).model_id
    assert model_id is not None
    return model_id


@pytest.mark.parametrize(
    "schedules",
    [
        {"both": {"kind": "hold", "angle_rad": 0.3}},
        {"both": {"kind": "constant_rate", "final_rad": 0.5, "rate_rad_s": 0.4}},
        {"both": {"kind": "quadratic", "final_rad": -0.5, "duration_s": 1.0, "start_s": 0.1}},
        {"left": SPLINE, "right": TABLE},
    ],
)
def test_every_kind_of_schedule_reaches_the_worker(service: RunningService, schedules: Document) -> None:
    """Schedules arrive with their defaults filled in and nothing changed."""
    document = changed(simulate_document(), "/schedules", schedules)
    for side, schedule in stored(service, document)["schedules"].items():
        assert schedules[side].items() <= schedule.items()


def test_every_option_reaches_the_worker(service: RunningService) -> None:
    """Model, lattice, step, start, output and air of a flexible flight arrive as they were sent."""
    document = simulate_document()
    document["model"] = {"kind": "flexible", "elements": 6, **AS_IDENTIFIED}
    document["output_step_s"] = 0.02
    document["environment"] = {
        "gust": {"amplitude_m_s": 3.0, "gradient_m": 30.0, "start_s": 0.5, "direction_n": [0.0, 0.0, -1.0]},
        "turbulence": {"wind_20ft_m_s": 7.7, "sigma_high_m_s": 1.5},
        "seed": 4,
    }
    read = stored(service, document)
    assert {name: read[name] for name in document if name != "schedules"} == {
        name: document[name] for name in document if name != "schedules"
    }


def test_a_steady_flight_reaches_the_worker(service: RunningService) -> None:
    """A climbing turn with a sideslip, and the drives that trim it."""
    steady = {"climb_rad": 0.1, "turn_rate_rad_s": 0.05, "sideslip_rad": -0.02, "roll_trim_drive": "none"}
    document = simulate_document()
    document["flight"] = {**document["flight"], **steady}
    assert steady.items() <= stored(service, document)["flight"].items()


def test_parameters_reach_the_worker(service: RunningService) -> None:
    """Parameters are taken from an identification's result, or from the model in it."""
    for given in (RESULT["model"], RESULT):
        model = stored(service, equivalent(parameters=given))["model"]
        assert RESULT["model"].items() <= model["parameters"].items()
        assert "lattice" not in model


def test_a_model_is_named_by_its_id(any_service: RunningService) -> None:
    """`model_id` becomes the parameters of that model, flown as it was identified, unless overridden."""
    model_id = identified(any_service, **AS_IDENTIFIED)
    read = stored(any_service, equivalent(model_id=model_id))
    # with its defaults, as one that stands in the request
    parameters = {**RESULT["model"], "separate_wings": False, **AS_IDENTIFIED}
    assert read["model"] == {"kind": "equivalent", "parameters": parameters}
    flown = flown_with(SimulateRequest.parse(read).model)
    assert (flown.start, flown.step_s) == (AS_IDENTIFIED["start"], AS_IDENTIFIED["step_s"])
    assert flown.lattice.model_dump() == AS_IDENTIFIED["lattice"]
    other = stored(any_service, equivalent(model_id=model_id, start="trim", step_s=0.002))
    flown = flown_with(SimulateRequest.parse(other).model)
    assert (flown.start, flown.step_s) == ("trim", 0.002)
    assert flown.lattice.model_dump() == AS_IDENTIFIED["lattice"]


def test_start_of_an_identified_model_is_checked(service: RunningService) -> None:
    """A model identified from a given start needs a flight with one, though the request does not say so."""
    document = equivalent(model_id=identified(service, **AS_IDENTIFIED))
    del document["flight"]["start"]
    assert_named(service, "/simulate", document, "/flight/start", "start_missing", "trim")


def test_another_owners_model_is_not_found(service: RunningService) -> None:
    """A model that is not there, or is someone else's, is named by its field."""
    for model_id in ("model_none", identified(service, owner="someone")):
        document = equivalent(model_id=model_id)
        assert_named(service, "/simulate", document, "/model/model_id", "model_not_found", "GET /models")


def schedules(**sides: Any) -> tuple[str, Document]:
    """Change all schedules."""
    return "/schedules", sides


RATE = {"kind": "constant_rate", "final_rad": 1.0}
# (field that is changed, its bad value, pointer of the fault, code, words that the hint must hold)
BAD_FIELDS = [
    (*schedules(both=TABLE, left=TABLE), "/schedules/left", "given_twice", "Leave one"),
    (*schedules(fold=TABLE), "/schedules/fold", "unknown_drive", "sweep_left"),
    ("/schedules", TABLE, "/schedules", "missing", "Name the drive"),
    (*schedules(both={**RATE}), "/schedules/both/duration_s", "missing", "one of them"),
    (
        *schedules(both={**RATE, "duration_s": 1.0, "rate_rad_s": 1.0}),
        "/schedules/both/rate_rad_s",
        "given_twice",
        "one of them",
    ),
    (
        *schedules(both={**RATE, "initial_rad": 1.0, "rate_rad_s": 1.0}),
        "/schedules/both/final_rad",
        "nothing_to_morph",
        "hold",
    ),
    (
        *schedules(both={**RATE, "rate_rad_s": 10.0}),
        "/schedules/both/ramp_s",
        "ramp_too_long",
        "0.05",
    ),
    (
        *schedules(both={**RATE, "final_rad": 1.4, "duration_s": 2.0}),
        "/schedules/both/final_rad",
        "sweep_out_of_range",
        "-1.3 to 1.3",
    ),
    (
        *schedules(left=TABLE, right={**TABLE, "angle_rad": [0.0, 0.1, -1.5]}),
        "/schedules/right/angle_rad/2",
        "sweep_out_of_range",
        "-1.3 to 1.3",
    ),
    (
        *schedules(both={**SPLINE, "knot_time_s": [0.0, 1.0, 1.0]}),
        "/schedules/both/knot_time_s/2",
        "time_not_rising",
        "Sort",
    ),
    (
        *schedules(both={**SPLINE, "knot_angle_rad": [0.0, 1.0]}),
        "/schedules/both/knot_angle_rad",
        "unequal_lengths",
        "every time",
    ),
    (*schedules(both={"kind": "step"}), "/schedules/both", "union_tag_invalid", "constant_rate"),
    (*schedules(both={"final_rad": 1.0}), "/schedules/both", "union_tag_not_found", "kind"),
    (
        *schedules(both={**TABLE, "angles_rad": [1.0]}),
        "/schedules/both/angles_rad",
        "unknown_field",
        "angle_rad",
    ),
    ("/model", {"kind": "solid"}, "/model", "union_tag_invalid", "flexible"),
    ("/model", {"kind": "rigid", "elements": 4}, "/model/elements", "unknown_field", "another object"),
    ("/model", {"kind": "flexible", "elements": 0}, "/model/elements", "greater_than_equal", "at least 1"),
    ("/model", {"kind": "equivalent"}, "/model/parameters", "missing", "model_id"),
    (
        "/model",
        {"kind": "equivalent", "model_id": "x", "parameters": RESULT["model"]},
        "/model/model_id",
        "given_twice",
        "one of them",
    ),
    ("/model/step_s", 0.5, "/model/step_s", "less_than_equal", "at most 0.02"),
    ("/model/lattice/core/law", "none", "/model/lattice/core/law", "literal_error", "smoothed"),
    ("/duration_s", 1e4, "/duration_s", "less_than_equal", "at most 600"),
    ("/flight/turn_rate_rad_s", 1.0, "/flight/turn_rate_rad_s", "unsteady_flight", "turn less"),
    ("/flight/yaw_trim_drive", "rudder", "/flight/yaw_trim_drive", "no_such_drive", "sweep_right"),
    ("/output_step_s", 2.0, "/output_step_s", "too_few_rows", "3 to"),
    ("/environment/gust", {"amplitude_m_s": 3.0}, "/environment/gust/gradient_m", "missing", "Add"),
    (
        "/environment/gust",
        {"amplitude_m_s": 3.0, "gradient_m": 30.0, "direction_n": [0.0, 0.0, 0.0]},
        "/environment/gust/direction_n",
        "no_direction",
        "up",
    ),
]


@pytest.mark.parametrize(
    ("path", "value", "pointer", "code", "words"),
    BAD_FIELDS,
    ids=[f"{f[2]}:{f[3]}" for f in BAD_FIELDS],
)
def test_bad_field_is_named(
    service: RunningService, path: str, value: Any, pointer: str, code: str, words: str
) -> None:
    """Every bad field gets its pointer, a stable code and a hint with the way out."""
    assert_named(service, "/simulate", changed(simulate_document(), path, value), pointer, code, words)


BAD_PARAMETERS: list[tuple[str, Any, str, str]] = [
    ("/links_per_wing", 3, "/division", "wrong_shape"),
    ("/division", [0.5, 0.6], "/division", "division_not_whole"),
    ("/division", [[0.5, 0.5], [0.5]], "/division", "wrong_shape"),
    ("/division", [0.5, -0.5], "/division/1", "greater_than"),
    ("/stiffness_nm_rad", [[1.0, 2.0]], "/stiffness_nm_rad/0", "too_short"),
    ("/damping_nms_rad", [], "/damping_nms_rad", "wrong_shape"),
    ("/damping_nms_rad", [[0.1, -0.2, 0.3]], "/damping_nms_rad/0/1", "greater_than_equal"),
    ("/aero/lag_s", None, "/aero/lag_s", "float_type"),
    ("/stiffness", [], "/stiffness", "unknown_field"),
]


@pytest.mark.parametrize(("path", "value", "pointer", "code"), BAD_PARAMETERS)
def test_bad_parameters_are_named(
    service: RunningService, path: str, value: Any, pointer: str, code: str
) -> None:
    """Numbers of a model that do not fit together are named before a job is made, in a whole result too."""
    model = changed(RESULT["model"], path, value)
    assert_named(service, "/simulate", equivalent(parameters=model), f"/model/parameters{pointer}", code, "")
    whole = {**RESULT, "model": model}
    at = f"/model/parameters/model{pointer}"
    assert_named(service, "/simulate", equivalent(parameters=whole), at, code, "")


def test_separate_wings_are_accepted(service: RunningService) -> None:
    """Each wing may have parameters of its own, with one more level of lists; one link has no joints."""
    separate = {
        **RESULT["model"],
        "separate_wings": True,
        "division": [[0.5, 0.5], [0.4, 0.6]],
        "stiffness_nm_rad": [[[1.0, 2.0, 3.0]], [[1.0, 2.0, 4.0]]],
        "damping_nms_rad": [[[1.0, 2.0, 3.0]], [[1.0, 2.0, 4.0]]],
    }
    assert stored(service, equivalent(parameters=separate))["model"]["parameters"] == separate
    third = {**separate, **{name: [*separate[name], separate[name][0]] for name in OWN}}
    at = "/model/parameters/division"
    assert_named(service, "/simulate", equivalent(parameters=third), at, "other_number_of_wings", "")
    single = {**RESULT["model"], "links_per_wing": 1, "division": [1.0]}
    for none in ([], [[]]):
        joints = {"stiffness_nm_rad": none, "damping_nms_rad": none}
        stored(service, equivalent(parameters={**single, **joints}))


OWN = {name: RESULT["model"][name] for name in ("division", "stiffness_nm_rad", "damping_nms_rad")}
SURFACES: dict[str, Any] = {
    "right wing": {**OWN, "profile_drag": 0.01, "zero_lift_rad": 0.0, "cm0": 0.0},
    "left wing": {"mirror_of": "right wing"},
}


def test_surfaces_may_have_parameters_of_their_own(service: RunningService) -> None:
    """By name, or as the mirror image of another; what does not fit is named."""
    model = {**RESULT["model"], "separate_wings": False, "surfaces": SURFACES}
    assert stored(service, equivalent(parameters=model))["model"]["parameters"] == model
    right = SURFACES["right wing"]
    for name, change, pointer, code in (
        ("right wing", {**right, "division": [0.5, 0.6]}, "/division", "division_not_whole"),
        ("right wing", {**right, "stiffness_nm_rad": []}, "/stiffness_nm_rad", "wrong_shape"),
        ("right wing", OWN, "/profile_drag", "missing"),
        ("left wing", {"mirror_of": "tail"}, "/mirror_of", "mirrors_nothing"),
        ("left wing", {"mirror_of": "left wing"}, "/mirror_of", "mirrors_nothing"),
        ("left wing", {"mirror_of": "right wing", "division": [1.0]}, "/division", "unknown_field"),
    ):
        wrong = {**model, "surfaces": {**SURFACES, name: change}}
        at = f"/model/parameters/surfaces/{name}{pointer}"
        assert_named(service, "/simulate", equivalent(parameters=wrong), at, code, "")
    alone = {**model, "surfaces": {"right wing": right}}
    at = "/model/parameters/surfaces"
    assert_named(service, "/simulate", equivalent(parameters=alone), at, "surface_without_parameters", "")


def test_work_is_bounded(service: RunningService) -> None:
    """More rows or more steps of a model than can be flown in reasonable time are refused by their field."""
    long = changed(simulate_document(), "/duration_s", 600.0)
    rows = changed(long, "/output_step_s", 0.001)
    assert_named(service, "/simulate", rows, "/output_step_s", "too_many_rows", "100000")
    flexible = changed(long, "/model", {"kind": "flexible"})
    assert_named(service, "/simulate", flexible, "/duration_s", "too_much_work", "step_s")
    assert post(service, "/validate/simulate", long).status_code == 200


def test_rigid_tails_need_no_schedule(service: RunningService) -> None:
    """A side without a hinge needs no schedule; a rigid aircraft has no equivalent model."""
    document = simulate_document()
    for surface in document["aircraft"]["surfaces"]:
        surface["flexible"] = False
    tail = document["aircraft"]["surfaces"][1]
    del tail["hinge"]
    tail["position_m"] = [-2.5, 0.0, 0.0]
    document["schedules"] = {document["aircraft"]["surfaces"][0]["side"]: TABLE}
    stored(service, document)
    bent = changed(document, "/model", {"kind": "flexible"})
    assert_named(service, "/simulate", bent, "/aircraft/surfaces", "nothing_to_bend", "flexible")


def test_the_listing_tells_what_flies(service: RunningService) -> None:
    """The job's summary names model, links and duration."""
    summary = post(service, "/simulate", equivalent(parameters=RESULT["model"])).json()["request"]
    assert (summary["model"], summary["links_per_wing"], summary["duration_s"]) == ("equivalent", 2, 2.5)
