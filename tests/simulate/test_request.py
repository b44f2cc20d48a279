"""Flights from request documents: flown as requested, and reported with the names of the API."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from morphcore.errors import InvalidInput, TrimNotFound
from morphcore.models.equivalent import physical_guess
from morphcore.models.parameters_document import parameters_document
from morphcore.simulate.request import attitude_variation, simulation_from_document
from morphcore.simulate.schedule import ConstantRate
from morphcore.simulate.time_grid import STEP_S
from morphcore.simulate.trajectory import Trajectory
from morphcore.stopping import Interrupted
from morphdata.environment import Environment
from morphdata.lattice import Lattice
from morphdata.parameters import FlownWith, flown_with
from morphdata.simulate import SimulateRequest
from tests.models.chains import EXAMPLES, example_aircraft, example_flight
from tests.simulate.flights import example_model, fly

MORPH = {"kind": "constant_rate", "final_rad": 0.5, "duration_s": 0.4, "start_s": 0.05}
COARSE = {"chordwise": 1, "spanwise": 4}


def request(**change: Any) -> dict[str, Any]:
    """A short morph of the example aircraft, as a rigid model on a coarse lattice."""
    return {
        "aircraft": json.loads((EXAMPLES / "aircraft.json").read_text()),
        "flight": json.loads((EXAMPLES / "flight.json").read_text()),
        "model": {"kind": "rigid", "lattice": COARSE},
        "schedules": {"both": MORPH},
        "duration_s": 0.5,
    } | change


def parameters(links: int = 2) -> dict[str, Any]:
    """Parameters as an identification's result states them, with what they were identified with."""
    document = parameters_document(physical_guess(example_model(links)))
    return document | {"lattice": COARSE, "step_s": 0.01, "start": "trim"}


@pytest.mark.parametrize("kind", ["rigid", "equivalent", "flexible"])
def test_a_request_flies_what_the_library_flies(kind: str) -> None:
    """Each model flown by request gives the trajectory of `simulate` with the same arguments, to the bit."""
    lattice = Lattice(chordwise=1, spanwise=4)
    model = {"kind": kind, "lattice": COARSE}
    choice: Any = kind
    options: dict[str, Any] = {}
    if kind == "equivalent":
        model["parameters"] = parameters()
        choice, options = physical_guess(example_model(2)), {"step_s": 0.01}
    if kind == "flexible":
        model["elements"] = 3
        options = {"elements": 3}
    run = simulation_from_document(request(model=model))
    flown = run.result().trajectory
    schedule = ConstantRate(0.0, 0.5, 0.4, start_s=0.05)
    direct = fly(
        example_aircraft(), example_flight(), {"left": schedule, "right": schedule}, model=choice,
        duration_s=0.5, lattice=lattice, **options,
    ).trajectory  # fmt: skip
    for name in ("time_s", "sweep_left", "phi", "theta", "psi"):
        np.testing.assert_array_equal(getattr(flown, name), getattr(direct, name))
    np.testing.assert_array_equal(flown.extra["tip_left_z"], direct.extra["tip_left_z"])


def test_the_document_has_the_names_of_the_api() -> None:
    """Trim, trajectory, summary and cost, in plain JSON; the summary follows from the trajectory."""
    run = simulation_from_document(request())
    result = run.result()
    document = result.to_document()
    assert json.loads(json.dumps(document, allow_nan=False)) == document
    assert set(document) == {"model", "trim", "trajectory", "drives", "summary", "cost", "warnings"}
    columns = document["trajectory"]
    for name in ("p_rad_s", "q_rad_s", "r_rad_s", "vx_m_s", "z_m", "tip_left_z_m", "tip_right_z_m"):
        assert len(columns[name]) == len(columns["time_s"]) == 51
    assert document["trim"]["alpha_rad"] == pytest.approx(columns["theta_rad"][0], abs=1e-12)
    assert document["trim"]["tip_z_m"]["left"] == columns["tip_left_z_m"][0]
    assert len(document["trim"]["force_b_n"]) == len(document["trim"]["moment_b_n_m"]) == 3
    theta = np.array(columns["theta_rad"])
    largest = document["summary"]["max_abs_rad"]["theta"]
    assert largest == pytest.approx(np.abs(theta - theta[0]).max(), rel=1e-12)
    departures = [
        np.array(columns[f"{name}_rad"]) - columns[f"{name}_rad"][0] for name in ("phi", "theta", "psi")
    ]
    assert document["summary"]["variation_rad2"] == pytest.approx(np.sum(np.square(departures)), rel=1e-12)
    cost = document["cost"]
    assert cost["real_time_factor"] == pytest.approx(0.5 / cost["wall_s"])
    assert document["model"]["lattice"]["chordwise"] == 1
    assert document["model"]["step_s"] == STEP_S


def test_the_variation_does_not_hang_on_the_rows() -> None:
    """Half as many rows give the same variation; a heading through south counts as one turn.

    Tolerance: both are sums over rows of a smooth function; they differ by half a row's share at the end.
    """
    values = []
    for step in (0.01, 0.005):
        time_s = np.arange(0.0, 2.0 + step / 2, step)
        psi = 3.0 + 0.2 * np.sin(0.5 * np.pi * time_s)  # passes pi, and ends where it began
        wrapped = (psi + np.pi) % (2.0 * np.pi) - np.pi
        zero = np.zeros_like(time_s)
        values.append(attitude_variation(Trajectory("t", time_s, {}, zero, zero, wrapped)))
    assert values[0] == pytest.approx(values[1], rel=1e-4)
    assert values[0] == pytest.approx(
        100 * 0.2**2 * 0.5 * 2.0, rel=1e-3
    )  # integral of sin^2 over two seconds


def test_identified_parameters_fly_with_what_they_were_identified_with() -> None:
    """Lattice, step and start come with an identification's parameters; the request may override them."""

    def flown(**model: Any) -> FlownWith:
        return flown_with(SimulateRequest.parse(request(model={"kind": "equivalent", **model})).model)

    given = parameters()
    coarse = Lattice(chordwise=1, spanwise=4)
    assert flown(parameters=given) == FlownWith(coarse, 0.01, "trim")
    assert flown(parameters={"model": given, "fit": []}) == FlownWith(coarse, 0.01, "trim")
    over = flown(parameters=given, lattice={"chordwise": 2}, step_s=0.002)
    assert over == FlownWith(Lattice(chordwise=2), 0.002, "trim")
    bare = {name: value for name, value in given.items() if name not in ("lattice", "step_s", "start")}
    assert flown(parameters=bare) == FlownWith(Lattice(), None, "trim")


def test_the_air_is_read() -> None:
    """Gust, turbulence and seed arrive in the environment; turbulence of one seed is one flight."""
    air = {
        "gust": {"amplitude_m_s": 5.0, "gradient_m": 30.0, "start_s": 0.1, "direction_n": [0.0, 1.0, 0.0]},
        "turbulence": {"wind_20ft_m_s": 7.7, "sigma_high_m_s": 1.5},
        "seed": 4,
    }
    run = simulation_from_document(request(environment=air))
    assert run.request.environment == Environment.parse(air)
    phi = run.result().trajectory.phi
    assert np.abs(phi).max() > 1e-4, "a gust from the side rolls the aircraft"
    np.testing.assert_array_equal(
        simulation_from_document(request(environment=air)).result().trajectory.phi, phi
    )
    other = simulation_from_document(request(environment=air | {"seed": 5})).result().trajectory.phi
    assert np.abs(other - phi).max() > 1e-6
    still = simulation_from_document(request(environment={})).result().trajectory
    np.testing.assert_array_equal(still.theta, simulation_from_document(request()).result().trajectory.theta)


def test_steps_tell_how_far_it_is() -> None:
    """Fractions rise to one; the message says what flies and how far; the clock runs only while it flies."""
    ticks = iter(range(1000))
    run = simulation_from_document(request())
    run.clock = lambda: float(next(ticks))
    steps = list(run.steps())
    fractions = [step.fraction for step in steps]
    assert fractions == sorted(fractions)
    assert fractions[-1] == 1.0
    assert steps[-1].message == "rigid model: 0.50 of 0.5 s flown"
    assert run.result().wall_s == len(steps), "one tick a step, none between"


def test_stop_interrupts() -> None:
    """A stop that is true ends the flight at its next chunk."""
    with pytest.raises(Interrupted):
        list(simulation_from_document(request()).steps(stop=lambda: True))


def test_what_cannot_fly_says_so() -> None:
    """An aircraft too heavy for its airspeed is no invalid request; the flight refuses it by name."""
    flight = request()["flight"] | {"airspeed_m_s": 1.0}
    run = simulation_from_document(request(flight=flight))
    with pytest.raises(TrimNotFound):
        run.result()


@pytest.mark.parametrize(
    ("change", "pointer"),
    [
        ({"aircraft": {}}, "/aircraft/fuselage"),
        ({"model": {}}, "/model"),
        ({"model": {"kind": "stiff"}}, "/model"),
        ({"model": {"kind": "equivalent"}}, "/model/parameters"),
        (
            {"model": {"kind": "equivalent", "parameters": {"links_per_wing": 2}}},
            "/model/parameters/division",
        ),
        ({"model": {"kind": "rigid", "parameters": {}}}, "/model/parameters"),
        ({"model": {"kind": "rigid", "elements": 10}}, "/model/elements"),
        ({"model": {"kind": "flexible", "elements": 0}}, "/model/elements"),
        ({"model": {"kind": "rigid", "lattice": {"chordwise": 99}}}, "/model/lattice/chordwise"),
        ({"model": {"kind": "rigid", "step_s": 1.0}}, "/model/step_s"),
        ({"model": {"kind": "rigid", "start": "anywhere"}}, "/model/start"),
        ({"schedules": {"fold": {"kind": "hold"}}}, "/schedules/fold"),
        ({"schedules": {"both": {"kind": "hold", "angle_rad": 1.5}}}, "/schedules/both/angle_rad"),
        (
            {"schedules": {"left": {"kind": "hold"}, "right": MORPH | {"final_rad": 1.4}}},
            "/schedules/right/final_rad",
        ),
        ({"duration_s": 0.0}, "/duration_s"),
        ({"duration_s": None}, "/duration_s"),
        ({"output_step_s": 0.3}, "/output_step_s"),
        ({"output_step_s": 1e-7}, "/output_step_s"),
        ({"environment": {"gust": {"amplitude_m_s": 5.0}}}, "/environment/gust/gradient_m"),
        (
            {"environment": {"gust": {"amplitude_m_s": 5.0, "gradient_m": 9.0, "direction_n": [0, 0, 0]}}},
            "/environment/gust/direction_n",
        ),
        ({"environment": {"turbulence": {"wind_20ft_m_s": -1.0}}}, "/environment/turbulence/wind_20ft_m_s"),
        ({"environment": {"seed": 1.5}}, "/environment/seed"),
        ({"environment": {"rain": 1}}, "/environment/rain"),
        ({"schedule": {}}, "/schedule"),
    ],
)
def test_bad_requests_name_the_field(change: dict[str, Any], pointer: str) -> None:
    """What is wrong in a request is said with a pointer to it and a hint, before anything flies."""
    with pytest.raises(InvalidInput) as caught:
        simulation_from_document(request(**change))
    assert caught.value.pointer == pointer
    assert caught.value.hint


def test_a_given_start_must_be_there() -> None:
    """``start: given`` without a start in the flight points to where it is missing."""
    flight = {name: value for name, value in request()["flight"].items() if name != "start"}
    with pytest.raises(InvalidInput) as caught:
        simulation_from_document(request(flight=flight, model={"kind": "rigid", "start": "given"}))
    assert caught.value.pointer == "/flight/start"
