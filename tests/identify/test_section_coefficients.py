"""Zero-lift angle and moment coefficient of the sections, identified where flights or requests ask for it."""

from __future__ import annotations

import json
from functools import cache
from typing import Any

import numpy as np
import pytest

from morphcore import Trajectory, simulate
from morphcore.geometry import aircraft as resolved
from morphcore.identify import Identification, IdentifyResult, identify
from morphcore.models.equivalent import chain_model, physical_guess
from morphcore.simulate.trajectory import Role
from morphdata.aircraft import Aircraft
from morphdata.flight import Flight
from morphdata.identify import EquivalentModel, IdentifyRequest
from morphdata.operations.identify import cost
from morphdata.schedules import Schedules
from tests.app.request_documents import identify_document
from tests.identify.flights import (
    EXAMPLES,
    example,
    reference_aircraft,
    reference_documents,
    reference_flight,
    synthetic,
)
from tests.identify.generated import HELD_OUT, TRAINING

TRUTH = {"zero_lift_rad": -0.06, "cm0": -0.08}
BOTH = {"zero_lift_rad": [-0.2, 0.2], "cm0": [-0.2, 0.2]}
FITTED = ("asymmetric", "fast", "slow")


def aircraft(**section: float) -> Aircraft:
    """The example's aircraft with these sections."""
    document = json.loads((EXAMPLES / "aircraft.json").read_text(encoding="utf-8"))
    for surface in document["surfaces"]:
        surface.update(section)
    return Aircraft.parse(document)


@cache
def flight() -> Flight:
    """The example's flight condition without a given start."""
    document = json.loads((EXAMPLES / "flight.json").read_text(encoding="utf-8"))
    del document["start"]
    return Flight.parse(document)


def flown(model: Any, name: str, plane: Aircraft) -> Trajectory:
    """One of the generated flights, by any model."""
    schedules, duration_s = {**TRAINING, **HELD_OUT}[name]
    return simulate(
        plane, flight(), Schedules.parse(schedules), model=model, duration_s=duration_s
    ).trajectory


def measured(name: str, role: Role = "train") -> Trajectory:
    """A flight of beams with cambered sections."""
    found = flown("flexible", name, aircraft(**TRUTH))
    return Trajectory(name, found.time_s, found.drives, found.phi, found.theta, found.psi, role=role)


def identified(corrections: list[str] | None) -> IdentifyResult:
    """Three links from three of those flights and an aircraft that knows nothing of camber."""
    model = EquivalentModel(links_per_wing=3, aero_coefficients=corrections)
    return identify(aircraft(), flight(), [measured(name) for name in FITTED], model=model)


@pytest.mark.timeout(600)
def test_camber_that_the_document_does_not_know_is_found() -> None:
    """Held-out flights to 1 mrad and tips to 5 per cent, unasked; and the coefficients themselves.

    The chain has the beams' wings, so both are near their truth: 2 per cent and 5. Where they must keep the
    values of the document the fit is ten times as far off, and bends the wing instead.
    """
    unasked, without = identified(None), identified(["lift_factor", "ac_offset_m", "profile_drag", "lag_s"])
    document = unasked.to_document()
    assert set(TRUTH) < set(document["search"]["aero_coefficients"])
    aero = document["model"]["aero"]
    assert aero["zero_lift_rad"] == pytest.approx(TRUTH["zero_lift_rad"], rel=0.02)
    assert aero["cm0"] == pytest.approx(TRUTH["cm0"], rel=0.05)
    for name in HELD_OUT:
        truth = flown("flexible", name, aircraft(**TRUTH))
        found, blind = (flown(each.parameters, name, aircraft()) for each in (unasked, without))
        assert np.abs(found.euler - truth.euler).max() < 1e-3
        assert np.abs(blind.euler - truth.euler).max() > 3e-3
        for tip in ("tip_left_z", "tip_right_z"):
            error = np.abs(found.extra[tip] - truth.extra[tip]).max()
            assert error < 0.05 * np.abs(truth.extra[tip]).max()


def cambered_chain(noise_rad: float = 1e-5, **section: float) -> Identification:
    """The search for two links from noisy flights of a chain with these sections."""
    model = chain_model(reference_aircraft(), reference_flight(), 2)
    truth = physical_guess(model).changed(**{name: np.full((1, 1), value) for name, value in section.items()})
    samples = [
        synthetic(truth, name=f"flight_{n}", left_rad=left, right_rad=right, noise_rad=noise_rad, seed=n)
        for n, (left, right) in enumerate(((0.6, 0.6), (0.7, 0.4)))
    ]
    settings = EquivalentModel(links_per_wing=2, step_s=0.01)
    return Identification(reference_aircraft(), reference_flight(), samples, settings)


@pytest.mark.parametrize("noise_rad", [1e-6, 1e-5, 1e-4, 3e-4])
def test_nothing_is_freed_that_flights_do_not_call_for(noise_rad: float) -> None:
    """A chain without camber, within little or much noise."""
    run = cambered_chain(noise_rad)
    *_, last = run.steps()
    run.state(last.checkpoint)
    assert run.further == ()


@pytest.mark.parametrize("section", [{"cm0": -0.05}, TRUTH])
def test_what_flights_call_for_is_freed_and_found(section: dict[str, float]) -> None:
    """Coefficients that the flown chain has, to five per cent of the larger one."""
    run = cambered_chain(**section)
    *_, last = run.steps()
    found = run.space.decode(run.state(last.checkpoint).best)
    assert set(run.further) >= set(section)
    for name in TRUTH:
        assert float(found[name].flat[0]) == pytest.approx(section.get(name, 0.0), abs=4e-3)


def test_a_search_that_has_freed_corrections_resumes() -> None:
    """From any checkpoint, before and after the review that frees them: the same steps to the bit."""
    steps = list(cambered_chain(**TRUTH).steps())
    reviewed = [n for n, step in enumerate(steps) if step.phase == "measurement"]
    assert reviewed
    for begun in (reviewed[0] - 1, reviewed[0], len(steps) - 2):
        *_, last = cambered_chain(**TRUTH).steps(steps[begun].checkpoint)
        assert last.best_cost == steps[-1].best_cost
        assert last.generation == steps[-1].generation


def on_rigid_wings(final_rad: float) -> dict[str, Any]:
    """What a flight of known coefficients says of three corrections."""
    model = chain_model(reference_aircraft(), reference_flight(), 1)
    truth = physical_guess(model).changed(zero_lift_rad=np.array([[-0.02]]), cm0=np.array([[-0.05]]))
    sample = synthetic(truth, left_rad=final_rad, right_rad=final_rad, noise_rad=1e-5)
    plane, condition = reference_documents()
    settings = EquivalentModel(
        links_per_wing=1, step_s=0.01, aero_coefficients=["lift_factor", "zero_lift_rad", "cm0"]
    )
    found = identify(plane, condition.model_copy(update={"start": None}), [sample], model=settings)
    document: dict[str, Any] = found.to_document()
    return document


def test_what_a_flight_without_morph_cannot_tell_is_said() -> None:
    """Trimmed flight shows one lift of two unknowns, and nothing of cm0, which the trim moment takes."""
    found = on_rigid_wings(0.0)["uncertainty"]
    assert set(found["undetermined"]) == {"lift_factor", "zero_lift_rad", "cm0"}
    assert found["interval_95"]["cm0"] == [None, None]
    together, alone = sorted((each["direction"] for each in found["unidentifiable"]), key=len, reverse=True)
    assert set(together) == {"lift_factor", "zero_lift_rad"}
    assert set(alone) == {"cm0"}


def test_a_morph_tells_them_apart() -> None:
    """Sweeping wings turn the moment vector and change the lift: all three are within their intervals."""
    document = on_rigid_wings(0.5)
    truth = {"lift_factor": 1.0, "zero_lift_rad": -0.02, "cm0": -0.05}
    for name, value in truth.items():
        low, high = document["uncertainty"]["interval_95"][name]
        assert low < value < high
        assert document["model"]["aero"][name] == pytest.approx(value, rel=0.01)
    assert document["uncertainty"]["unidentifiable"] == []


@pytest.mark.parametrize(
    ("settings", "expected"),
    [
        ({}, set()),
        ({"bounds": {"cm0": [-0.1, 0.1]}}, {"cm0"}),
        ({"bounds": BOTH}, {"cm0", "zero_lift_rad"}),
        ({"aero_coefficients": ["zero_lift_rad"]}, {"zero_lift_rad"}),
        ({"aero_coefficients": ["lag_s"], "bounds": {"cm0": [-0.1, 0.1]}}, set()),
    ],
)
def test_they_are_searched_on_request(settings: dict[str, Any], expected: set[str]) -> None:
    """By their bounds or in the list of corrections, which has the last word; the cost counts them."""
    model = EquivalentModel.parse({"links_per_wing": 1, **settings})
    run = Identification(reference_aircraft(), reference_flight(), [example("rate_0.8")], model)
    assert set(run.space.free_aero) & set(TRUTH) == expected
    request = identify_document()
    request["samples"] = [each for each in request["samples"] if each["name"] == "train_rate_0.8"]
    request["model"] = {"links_per_wing": 1, **settings}
    assert cost(IdentifyRequest.parse(request)).parameters == run.space.dimension


def test_the_aircraft_says_where_a_search_begins() -> None:
    """Coefficients of the document are the guess, and the values of what is not searched."""
    model = EquivalentModel.parse({"links_per_wing": 1, "bounds": {"cm0": [-0.2, 0.2]}})
    plane = resolved.Aircraft.of(aircraft(**TRUTH))
    run = Identification(plane, reference_flight(), [example("rate_0.8")], model)
    guess = run.space.decode(run.space.guess)
    assert {name: float(guess[name].flat[0]) for name in TRUTH} == pytest.approx(TRUTH)


def test_every_pair_has_its_own() -> None:
    """Wings and a tail that bends: two of each, named after their right surfaces; the cost counts them."""
    request = identify_document()
    request["samples"] = [each for each in request["samples"] if each["name"] == "train_rate_0.8"]
    tails = [
        {**wing, "name": f"tail {wing['side']}", "span_m": 1.0, "position_m": [-2.0, y, -0.4]}
        for wing, y in zip(request["aircraft"]["surfaces"], (0.3, -0.3), strict=True)
    ]
    for tail in tails:
        del tail["hinge"]
    request["aircraft"]["surfaces"] += tails
    request["model"] = {"links_per_wing": 1, "bounds": BOTH}
    parsed = IdentifyRequest.parse(request)
    plane = resolved.Aircraft.of(parsed.aircraft)
    run = Identification(plane, reference_flight(), [example("rate_0.8")], parsed.model)
    own = {f"{surface}.{name}" for surface in ("right wing", "tail right") for name in TRUTH}
    assert own <= set(run.space.names)
    assert cost(parsed).parameters == run.space.dimension
