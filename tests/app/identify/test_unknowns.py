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
