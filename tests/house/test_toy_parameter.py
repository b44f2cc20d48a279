"""A parameter is one entry in a list: it is searched, bounded, reported, warm-started and documented."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from morphcore.identify import Identification, IdentifyResult, SearchSettings
from morphcore.models.equivalent import chain_model, physical_guess
from morphcore.models.parameters import CHAIN_PARAMETERS, Parameter
from morphcore.models.surface_rows import SurfaceRows
from morphcore.models.transforms import Linear
from morphcore.multibody.kernels.articulated import L_MASS
from morphcore.simulate.trajectory import Trajectory
from morphdata.identify import EquivalentModel
from morphid.model_table import named_parameters
from tests.identify.flights import reference_aircraft, reference_flight, shortened, synthetic

ROOT = Path(__file__).resolve().parents[2]
KILOGRAMS = Linear(unit=10.0)
TRUTH_KG = 14.0


def put_on(rows: SurfaceRows, ballast_kg: np.ndarray[Any, Any]) -> None:
    """A point mass at the origin of the innermost link."""
    rows.links[:, 0, L_MASS] += ballast_kg


BALLAST = Parameter(
    name="ballast_kg",
    unit="kg",
    transform=lambda _: KILOGRAMS,
    bounds=lambda _: KILOGRAMS.box(-30.0, 30.0, 1),
    guess=lambda cut: np.zeros(cut.division.shape[0]),
    apply=put_on,
    default=0.0,
)

# in a process of its own, for documents read their list when they are imported
HOUSE_WITH_A_TOY = """
import json
from typing import Annotated
from pydantic import Field
from morphdata.identifiable import IDENTIFIABLE, Identifiable

value = Annotated[float, Field(ge=-1000.0, le=1000.0)]
IDENTIFIABLE.append(Identifiable("ballast_kg", -100.0, 100.0, value=value, default=0.0))

from app.openapi import document_text
from morphcore.errors import InvalidInput
from morphcore.identify import identification_from_request
from morphcore.models.parameters import CHAIN_PARAMETERS
from morphcore.models.parameters_document import parameters_from_document
from morphdata.identify import IdentifyRequest
from morphdata.operations.identify import cost
from tests.house.test_toy_parameter import BALLAST, loaded
from tests.identify.flights import EXAMPLES

CHAIN_PARAMETERS.append(BALLAST)
flown = loaded()
columns = {"time_s": flown.time_s, "sweep_left_rad": flown.sweep_left, "sweep_right_rad": flown.sweep_right,
           "phi_rad": flown.phi, "theta_rad": flown.theta, "psi_rad": flown.psi}
sample = {"name": "loaded", **{name: column.tolist() for name, column in columns.items()}}
model = {"links_per_wing": 1, "aero_coefficients": ["lift_factor", "ballast_kg"], "step_s": 0.01}

def request(bounds, **search):
    documents = {name: json.loads((EXAMPLES / f"{name}.json").read_text()) for name in ("aircraft", "flight")}
    search = {"method": "least_squares", "generations": 6, **search}
    return IdentifyRequest.parse(
        {**documents, "samples": [sample], "model": {**model, "bounds": bounds}, "search": search})

def identified(request):
    run = identification_from_request(request)
    *_, last = run.steps()
    return run.result(last.checkpoint).to_document()

bounded = request({"ballast_kg": [-5.0, 5.0]})
free = identified(request({}))
warm = identification_from_request(request({}, warm_start={"parameters": free}))
known = warm.space.decode(warm.known[0])["ballast_kg"][0]
old = json.loads(json.dumps(free))
del old["model"]["aero"]["ballast_kg"]
try:
    request({"ballast_kg": [5.0, -5.0]})
except InvalidInput as error:
    refused = error.pointer
print("FOUND" + json.dumps({
    "schemas": json.loads(document_text())["components"]["schemas"], "free": free,
    "bounded": identified(bounded), "unknowns": cost(bounded).parameters, "known": known,
    "old": parameters_from_document(old)["ballast_kg"][0], "refused": refused}))
"""


@pytest.fixture(autouse=True)
def ballast() -> Iterator[None]:
    """The parameter is there for one test."""
    CHAIN_PARAMETERS.append(BALLAST)
    yield
    CHAIN_PARAMETERS.remove(BALLAST)


def loaded(ballast_kg: float = TRUTH_KG) -> Trajectory:
    """One second of a flight with so much at each wing's root."""
    model = chain_model(reference_aircraft(), reference_flight(), 1)
    batch = physical_guess(model).changed(ballast_kg=np.array([ballast_kg]))
    return shortened(synthetic(batch, right_rad=0.4, noise_rad=1e-6), 90)


def identified() -> IdentifyResult:
    """Ballast and lift factor of rigid wings from that flight."""
    # not validated: the documents of this process have read their list before the parameter was in it
    model = EquivalentModel(links_per_wing=1, step_s=0.01).model_copy(
        update={"aero_coefficients": ["lift_factor", "ballast_kg"]}
    )
    run = Identification(
        reference_aircraft(), reference_flight(), [loaded()], model,
        SearchSettings(method="least_squares", iterations=6),
    )  # fmt: skip
    checkpoint = b""
    for step in run.steps():
        checkpoint = step.checkpoint
    return run.result(checkpoint)


def test_it_is_identified_and_reported() -> None:
    """Its value, interval and unit; it is searched unless a request leaves it out."""
    found = identified()
    assert found.uncertainty is not None
    assert found.parameters["ballast_kg"][0] == pytest.approx(TRUTH_KG, rel=1e-3)
    low, high = found.uncertainty.intervals["ballast_kg"]
    assert low is not None
    assert high is not None
    assert low < TRUTH_KG < high
    assert "ballast_kg, kg" in repr(found)
    document = found.to_document()
    assert document["search"]["aero_coefficients"] == ["lift_factor", "ballast_kg"]
    assert document["uncertainty"]["coordinates"] == ["lift_factor", "ballast_kg"]
    assert document["uncertainty"]["standard_error"]["ballast_kg"] > 0.0
    assert dict(named_parameters(document["model"]))["ballast_kg"] == found.parameters["ballast_kg"][0]
    run = Identification(
        reference_aircraft(), reference_flight(), [loaded()], EquivalentModel(links_per_wing=2)
    )
    assert run.space.names[-1] == "ballast_kg"


def test_documents_know_it() -> None:
    """One more entry, in the list of the documents: OpenAPI, request, cost, result and warm start have it."""
    ended = subprocess.run(
        [sys.executable, "-c", HOUSE_WITH_A_TOY], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert ended.returncode == 0, ended.stderr
    found = json.loads(ended.stdout.partition("FOUND")[2])
    for schema in ("Bounds", "Corrections"):
        assert "ballast_kg" in found["schemas"][schema]["properties"]
    assert found["unknowns"] == 2
    assert found["free"]["model"]["aero"]["ballast_kg"] == pytest.approx(TRUTH_KG, rel=1e-3)
    assert found["bounded"]["uncertainty"]["at_bound"] == ["ballast_kg"]
    assert found["bounded"]["uncertainty"]["interval_95"]["ballast_kg"][1] is None
    assert found["bounded"]["model"]["aero"]["ballast_kg"] == pytest.approx(5.0)
    (warning,) = (each for each in found["bounded"]["warnings"] if "ballast_kg" in each["message"])
    assert (warning["code"], warning["pointer"]) == ("at_bound", "/model/bounds/ballast_kg")
    assert found["known"] == pytest.approx(found["free"]["model"]["aero"]["ballast_kg"])
    assert found["old"] == 0.0  # a model from before it was known
    assert found["refused"] == "/model/bounds/ballast_kg/0"


def test_it_flies() -> None:
    """It is in the trim: the heavier the aircraft, the more nose-up it flies."""
    light, heavy = (loaded(mass).theta[0] for mass in (0.0, TRUTH_KG))
    assert heavy > light + 1e-3


def test_a_surface_may_have_its_own() -> None:
    """With another scope each mirror pair has its own, and both sides of separate wings."""
    CHAIN_PARAMETERS[-1] = replace(BALLAST, scope="surface")
    try:
        model = chain_model(reference_aircraft(), reference_flight(), 1)
        batch = physical_guess(model, separate_wings=True)
        assert batch["ballast_kg"].shape == (1, 2)
    finally:
        CHAIN_PARAMETERS[-1] = BALLAST
