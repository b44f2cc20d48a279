"""The unknowns reported for a request are those of the search."""

from __future__ import annotations

from typing import Any

import pytest

from morphcore.identify import identification_from_request
from morphdata.identify import IdentifyRequest
from tests.app.request_documents import identify_document
from tests.app.running_service import RunningService
from tests.models.test_every_surface_its_own import surface


@pytest.mark.parametrize("roles", [("train", "train"), ("train", "held_out")])
@pytest.mark.parametrize("listed", [None, [], ["profile_drag", "lag_s"]])
@pytest.mark.parametrize("separate", [False, True])
@pytest.mark.parametrize("tail", [[], [surface("right tail"), surface("left tail")], [surface("left tail")]])
def test_the_unknowns_are_those_of_the_search(
    service: RunningService,
    roles: tuple[str, str],
    listed: list[str] | None,
    tail: list[dict[str, Any]],
    separate: bool,  # noqa: FBT001
) -> None:
    """Of symmetric and asymmetric samples, with corrections listed or left to the library."""
    document = identify_document()
    symmetric, asymmetric = (
        next(s for s in document["samples"] if s["name"].endswith(end)) for end in ("0.8", "asymmetric")
    )
    document["samples"] = [symmetric | {"role": roles[0]}, asymmetric | {"role": roles[1]}]
    document["model"] = {"links_per_wing": 2, "separate_wings": separate}
    if listed is not None:
        document["model"]["aero_coefficients"] = listed
    document["aircraft"]["surfaces"] += tail
    reported = service.client.post("/validate/identify", json=document).json()["cost"]
    assert (
        reported["parameters"] == identification_from_request(IdentifyRequest.parse(document)).space.dimension
    )


@pytest.mark.parametrize(
    ("links", "own_lift"),
    [({"wing": 3, "tail": 1}, None), ({"wing": 2, "tail": 4}, ["tail"]), (2, ["wing", "left tail"]), (2, [])],
)
@pytest.mark.parametrize("separate", [False, True])
def test_the_unknowns_of_unlike_surfaces(
    service: RunningService,
    links: Any,
    own_lift: list[str] | None,
    separate: bool,  # noqa: FBT001
) -> None:
    """With other numbers of links, and lift factors of their own where the request names them."""
    document = identify_document()
    document["model"] = {"links_per_wing": links, "separate_wings": separate}
    if own_lift is not None:
        document["model"]["own_lift"] = own_lift
    document["aircraft"]["surfaces"] += [surface("right tail"), surface("left tail")]
    reported = service.client.post("/validate/identify", json=document).json()["cost"]
    run = identification_from_request(IdentifyRequest.parse(document))
    assert reported["parameters"] == run.space.dimension


@pytest.mark.parametrize(
    ("operation", "model", "pointer", "words"),
    [
        ("identify", {"links_per_wing": {"wing": 3}}, "/model/links_per_wing", "wing, tail"),
        ("identify", {"links_per_wing": {"wing": 3, "fin": 1}}, "/model/links_per_wing/fin", "wing, tail"),
        (
            "identify",
            {"links_per_wing": {"wing": "auto", "tail": 0}},
            "/model/links_per_wing/tail",
            "at least 1",
        ),
        (
            "study",
            {"links_per_wing": [1, {"wing": 3, "fin": 1}]},
            "/model/links_per_wing/1/fin",
            "wing, tail",
        ),
        ("identify", {"own_lift": ["fin"]}, "/model/own_lift/0", "wing, tail"),
        ("identify", {"own_lift": ["tail"], "aero_coefficients": []}, "/model/own_lift", "lift_factor"),
    ],
)
def test_wrong_names_are_refused_with_those_to_use(
    service: RunningService, operation: str, model: dict[str, Any], pointer: str, words: str
) -> None:
    """At once, with the field."""
    document = identify_document() | {"model": model}
    document["aircraft"]["surfaces"] += [surface("right tail"), surface("left tail")]
    answer = service.client.post(f"/validate/{operation}", json=document)
    faults = answer.json()["errors"]
    assert [fault["pointer"] for fault in faults] == [pointer]
    assert words in faults[0]["hint"]
