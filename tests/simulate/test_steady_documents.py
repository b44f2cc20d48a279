"""Steady flights in documents: what is refused, and flights of requests, samples, morphs and exports."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from morphcore.errors import InvalidInput
from morphcore.export.formats import ExportedModel
from morphcore.identify.aircraft_checks import start_warnings
from morphcore.identify.cost import costs, fly_attitudes, sample_cases, shared_trims
from morphcore.identify.sample_fit import SampleFit
from morphcore.models.equivalent import chain_model, physical_guess
from morphcore.models.parameters_document import parameters_document
from morphcore.optimise.flights import MorphFlights, sample_times
from morphcore.simulate.common_path import common_path
from morphcore.simulate.request import simulation_from_document
from morphcore.simulate.schedule import ConstantRate, Hold
from morphdata.export import ExportRequest
from morphdata.flight import Flight
from morphdata.lattice import Lattice
from morphdata.optimize import OptimizeRequest
from morphdata.simulate import SimulateRequest
from tests.models.chains import aircraft_of, flight_of
from tests.simulate.flights import fly
from tests.simulate.tailed_aircraft import FLIGHT
from tests.simulate.test_steady import finned

COARSE = Lattice(chordwise=2, spanwise=8)
TURN = FLIGHT | {"turn_rate_rad_s": 0.3, "climb_rad": 0.05, "trim_drive": "elevator"}


@pytest.mark.parametrize(
    ("more", "pointer", "said"),
    [
        ({"turn_rate_rad_s": 0.1, "rates_rad_s": [0.0, 0.1, 0.0]}, "/rates_rad_s", "both say"),
        ({"turn_rate_rad_s": 0.1, "gravity_m_s2": 0.0}, "/gravity_m_s2", "bank angle"),
        ({"airspeed_m_s": 150.0, "turn_rate_rad_s": 1.0}, "/turn_rate_rad_s", "15.3 times the weight"),
        ({"airspeed_m_s": 150.0, "turn_rate_rad_s": 1.0}, "/turn_rate_rad_s", "Up to 0.651 rad/s"),
        ({"sideslip_rad": 0.5}, "/sideslip_rad", "0.35"),
        ({"climb_rad": 1.5}, "/climb_rad", "1.2"),
        ({"rates_rad_s": [0.0, 0.1]}, "/rates_rad_s", "3"),
    ],
)
def test_flights_that_cannot_be_are_refused(more: dict[str, Any], pointer: str, said: str) -> None:
    """With the field, and what would do."""
    with pytest.raises(InvalidInput) as caught:
        Flight.parse(FLIGHT | more, "/flight")
    assert f"/flight{pointer}" in str(caught.value)
    assert said in str(caught.value)


def request(flight: dict[str, Any], **more: Any) -> dict[str, Any]:
    """A request of a simulation of the rigid model."""
    model = {"kind": "rigid", "lattice": {"chordwise": 2, "spanwise": 8}}
    return {
        "aircraft": finned(), "flight": flight, "model": model, "schedules": {}, "duration_s": 0.2,
    } | more  # fmt: skip


@pytest.mark.parametrize(
    ("more", "field", "said"),
    [
        ({"yaw_trim_drive": "tiller"}, "yaw_trim_drive", "elevator_right"),
        ({"trim_drive": "rudder", "yaw_trim_drive": "rudder"}, "yaw_trim_drive", "two moments"),
        ({"trim_drive": "elevator", "roll_trim_drive": "elevator_left"}, "roll_trim_drive", "trim_drive"),
    ],
)
def test_drives_that_cannot_trim_are_refused(more: dict[str, Any], field: str, said: str) -> None:
    """By requests, and by the library at the same pointer."""
    with pytest.raises(InvalidInput) as caught:
        SimulateRequest.parse(request(FLIGHT | more))
    assert f"/flight/{field}" in str(caught.value)
    assert said in str(caught.value)
    with pytest.raises(InvalidInput) as caught:
        fly(aircraft_of(finned()), flight_of(FLIGHT | more), {}, duration_s=0.1, lattice=COARSE)
    assert caught.value.pointer == f"/flight/{field}"


def test_a_request_is_flown_and_tells_its_start() -> None:
    """Bank angle and drives are in the result; the summary's departures are from the steady turn."""
    result = simulation_from_document(request(TURN, duration_s=1.0)).result().to_document()
    assert 0.4 < result["trim"]["bank_rad"] < 0.5
    assert {"rudder", "aileron_left", "elevator_right"} <= set(result["trim"]["drives_rad"])
    psi = np.array(result["trajectory"]["psi_rad"])
    assert psi[-1] == pytest.approx(0.3, abs=1e-6)
    assert max(result["summary"]["max_abs_rad"].values()) < 1e-6
    assert result["summary"]["variation_rad2"] < 1e-10
    level = simulation_from_document(request(FLIGHT)).result().to_document()
    assert "bank_rad" not in level["trim"]
    assert level["trim"]["alpha_rad"] < result["trim"]["alpha_rad"]


def test_an_old_document_means_level_flight() -> None:
    """What it leaves out is level, and both ways to say so are one flight."""
    level = {"climb_rad": 0.0, "turn_rate_rad_s": 0.0, "sideslip_rad": 0.0, "rates_rad_s": None}
    answers = [
        simulation_from_document(request(flight)).result().to_document()["trajectory"]
        for flight in (FLIGHT, FLIGHT | level)
    ]
    assert answers[0] == answers[1]


def test_samples_of_a_turn_are_met_by_their_own_model() -> None:
    """Errors are nothing, the turn is no motion of the sample, and its start is no fault.

    As samples of level flight they are a fault.
    """
    aircraft, flight = aircraft_of(finned()), flight_of(TURN)
    model = chain_model(aircraft, flight, 2, COARSE)
    guess = physical_guess(model)
    schedule = {"elevator": ConstantRate(0.0, -0.03, 0.1, 0.3, 0.04)}
    options = {"duration_s": 1.0, "output_step_s": 0.02, "step_s": 0.005, "lattice": COARSE}
    flown = fly(aircraft, flight, schedule, model=guess, **options).trajectory
    # the flight's drives count from their trim, so that the elevator's own history is as good
    drives = {"elevator": flown.drives["elevator_left"]}
    sample = replace(flown, name="turn", drives=drives, extra={}, channels={})
    cases = sample_cases(model, [sample], 0.005)
    found = next(trim for _, trim in shared_trims(model, guess, cases, "trim"))
    attitudes = fly_attitudes(model, guess, cases[0], found)[0]
    assert np.abs(attitudes - flown.euler).max() < 2e-5  # the history between its rows
    assert np.abs(cases[0].motion[:10]).max() < 1e-6
    assert costs(model, guess, cases, "trim")[0] < 1e-7
    fit = SampleFit(cases[0], attitudes, attitudes, attitudes)
    assert not [*start_warnings(fit, "/samples/0")]
    lost = SampleFit(replace(cases[0], turn_rate_rad_s=0.0), attitudes, attitudes, attitudes)
    assert any("psi" in warning.message for warning in start_warnings(lost, "/samples/0"))


def test_morphs_begin_in_a_turn() -> None:
    """Nothing departs from a turn in which nothing moves; a morph does, as the simulator says."""
    aircraft, flight = aircraft_of(finned()), flight_of(TURN)
    model = chain_model(aircraft, flight, 1, COARSE)
    path = common_path(model, 0.0, 0.2, drives=("sweep_right", "sweep_left"), may_halve=True)
    assert not path.halved
    times = sample_times(0.4, 0.2)
    bench = MorphFlights(
        model, physical_guess(model), path, times, initial_rad=0.0, start="trim", step_s=0.005
    )
    morph = ConstantRate(0.0, 0.2, 0.6)
    still, moved = bench.fly([Hold(0.0), morph], torque=False).departure
    assert np.abs(still).max() < 1e-5
    options = {"duration_s": float(times[-1]), "output_step_s": 0.01, "step_s": 0.005, "lattice": COARSE}
    flown = fly(aircraft, flight, {"sweep": morph}, **options).trajectory.euler
    away = flown - flown[0] - np.outer(times, [0.0, 0.0, 0.3])
    np.testing.assert_allclose(moved, away, rtol=0.0, atol=2e-5)
    assert np.abs(moved).max() > 1e-2


def test_a_morph_of_a_trim_drive_is_refused() -> None:
    """Also of one that the aircraft would trim with by itself; not where a constant moment balances."""
    model = chain_model(aircraft_of(finned()), flight_of(TURN), 2, COARSE)
    document = {
        "aircraft": finned(), "flight": TURN,
        "model": {"parameters": parameters_document(physical_guess(model))},
        "morph": {"drive": "aileron", "final_rad": 0.1, "duration_s": 0.5},
    }  # fmt: skip
    with pytest.raises(InvalidInput) as caught:
        OptimizeRequest.parse(document)
    assert "/flight/roll_trim_drive" in str(caught.value)
    assert '"none"' in str(caught.value)
    with pytest.raises(InvalidInput) as caught:
        common_path(model, 0.0, 0.1, drives=("aileron_right", "aileron_left"))
    assert caught.value.pointer == "/flight/roll_trim_drive"
    OptimizeRequest.parse(document | {"flight": TURN | {"roll_trim_drive": "none"}})


def test_an_export_has_the_attitude_and_rates_of_its_trim() -> None:
    """Only of a flight that is not level; the rates are those of the turn about the vertical."""
    for flight, rates in ((TURN, 0.3), (FLIGHT, None)):
        model = chain_model(aircraft_of(finned()), flight_of(flight), 2, COARSE)
        known = parameters_document(physical_guess(model)) | {"lattice": COARSE.to_document()}
        table = ExportedModel.of(
            ExportRequest.parse(
                {"aircraft": finned(), "flight": flight, "model": {"parameters": known}, "format": "json"}
            )
        ).tables["trim"]
        assert ("phi_rad" in table) is (rates is not None)
        if rates is not None:
            assert np.linalg.norm(table["omega_b_rad_s"]) == pytest.approx(rates)
            assert np.linalg.norm(table["air_velocity_b_m_s"]) == pytest.approx(FLIGHT["airspeed_m_s"])
