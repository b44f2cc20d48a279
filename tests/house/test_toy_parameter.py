"""A parameter is one entry in a list: it is searched, bounded, reported, warm-started and documented."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from morphcore.identify import Identification, IdentifyResult, ModelSettings, SearchSettings
from morphcore.identify.settings import model_settings, search_settings
from morphcore.models.equivalent import chain_model, physical_guess
from morphcore.models.parameters import CHAIN_PARAMETERS, Parameter, SurfaceRows
from morphcore.models.parameters_document import parameters_from_document
from morphcore.models.transforms import Linear
from morphcore.multibody.kernels.articulated import L_MASS
from morphcore.simulate.trajectory import Trajectory
from morphid.model_table import named_parameters
from tests.identify.flights import reference_aircraft, reference_flight, shortened, synthetic

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
    minimum=-1000.0,
    maximum=1000.0,
    default=0.0,
)


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


def identified(search: SearchSettings | None = None, **bounds: tuple[float, float]) -> IdentifyResult:
    """Ballast and lift factor of rigid wings from that flight."""
    model = ModelSettings(
        links_per_wing=1, aero_coefficients=("lift_factor", "ballast_kg"), bounds=bounds, step_s=0.01
    )
    run = Identification(
        reference_aircraft(), reference_flight(), [loaded()], model,
        search or SearchSettings(method="least_squares", iterations=6),
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
        reference_aircraft(), reference_flight(), [loaded()], ModelSettings(links_per_wing=2)
    )
    assert run.space.names[-1] == "ballast_kg"


def test_it_is_bounded() -> None:
    """By bounds of a request, in its unit; at one of them the result says so and points at it."""
    settings = model_settings({"bounds": {"ballast_kg": [-5.0, 5.0]}})
    found = identified(**settings.bounds)
    assert found.parameters["ballast_kg"][0] == pytest.approx(5.0)
    assert "ballast_kg" in found.at_bound
    assert found.to_document()["uncertainty"]["interval_95"]["ballast_kg"][1] is None
    (warning,) = (each for each in found.warnings if "ballast_kg" in each.message)
    assert (warning.code, warning.pointer) == ("at_bound", "/model/bounds/ballast_kg")


def test_it_is_warm_started() -> None:
    """A search begins from its value in an earlier result; a document from before it was known is none."""
    document = identified().to_document()
    search = search_settings(
        {"method": "least_squares", "generations": 1, "warm_start": {"parameters": document}}
    )
    model = ModelSettings(links_per_wing=1, step_s=0.01)
    run = Identification(reference_aircraft(), reference_flight(), [loaded()], model, search)
    assert run.space.decode(run.known[0])["ballast_kg"][0] == pytest.approx(
        document["model"]["aero"].pop("ballast_kg")
    )
    assert parameters_from_document(document)["ballast_kg"][0] == 0.0


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
