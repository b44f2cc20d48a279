"""The wake of every model leaves along the free stream at the trim angle."""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest

from morphcore.aero.kernels.loads import OUTPUTS
from morphcore.aero.operator import lattice_operator
from morphcore.geometry.aircraft import Aircraft
from morphcore.models.equivalent import ChainModel, chain_model, physical_guess
from morphcore.models.flexible import flexible_model
from morphcore.simulate.common_path import common_path
from morphcore.simulate.flexible import FlexibleFlight, hinge_path
from morphcore.simulate.flexible_trim import FlexibleTrim, trim_flexible
from morphcore.simulate.plan import flight_plan, start_at
from morphcore.simulate.schedule import ConstantRate, Hold
from morphcore.simulate.time_grid import TimeGrid
from morphcore.simulate.trim import Trim, trim
from morphcore.simulate.wake import wake_direction
from morphdata.lattice import Lattice, VortexCore
from tests.models.chains import aircraft_of, airless, example_aircraft, example_flight, flight_of
from tests.simulate.flights import fly_trimmed, steps
from tests.simulate.tailed_aircraft import FLIGHT, document, rigid
from tests.simulate.test_halves import tailed

GRID = TimeGrid(0.0, 0.01, 1, None)
# speeds, m/s, at which each aircraft flies at about 2, 8, 14 and 20 degrees
STRAIGHT, TAILED = (217.0, 109.0, 82.5, 69.5), (87.0, 43.5, 33.4, 28.3)
DEGREES = (2.0, 8.0, 14.0, 20.0)


def model_at(aircraft: Aircraft, speed: float, law: str = "line") -> ChainModel:
    """The rigid model at an airspeed, m/s."""
    flight = replace(example_flight(), airspeed_m_s=speed, start=None)
    return chain_model(aircraft, flight, 1, Lattice(chordwise=4, spanwise=10, core=VortexCore(law=law)))


def chain_trim(model: ChainModel, wake_alpha: float | None = None) -> Trim:
    """Trim with all hinges at rest at zero."""
    held = [Hold() for _ in model.aircraft.hinges]
    return trim(model, physical_guess(model), flight_plan(model, held, GRID, wake_alpha=wake_alpha)).require()


def beam_trim(model: ChainModel) -> FlexibleTrim:
    """Trim of the flexible model of the same aircraft."""
    beams = flexible_model(model.aircraft, model.flight, elements=1, lattice=model.lattice.settings)
    flight = FlexibleFlight(beams)
    held = [Hold() for _ in model.aircraft.hinges]
    return trim_flexible(flight, hinge_path(beams, held, GRID), np.zeros(3))


def edge_circulations(model: ChainModel, alpha: float) -> np.ndarray:
    """Circulations (strips,) at the trailing edge at an angle of attack, by the reduced operator."""
    matrix = lattice_operator(
        model.lattice, [0.0] * len(model.aircraft.hinges), wake_direction_B=wake_direction(alpha)
    ).matrix
    inputs = np.zeros(matrix.shape[1])
    inputs[: 2 * model.lattice.strips : 2] = model.flight.airspeed_m_s * np.sin(alpha)  # flat in B
    width = np.concatenate([np.diff(part.strip_edges_m) for part in model.lattice.lattices])
    rows = model.lattice.strips * OUTPUTS
    return (matrix @ inputs)[:rows:OUTPUTS] / width


@pytest.mark.parametrize("law", ["line", "smoothed"])
@pytest.mark.parametrize(
    ("aircraft", "speed", "degrees"),
    [
        *((rigid(example_aircraft()), *pair) for pair in zip(STRAIGHT, DEGREES, strict=True)),
        *((rigid(tailed()), *pair) for pair in zip(TAILED, DEGREES, strict=True)),
    ],
)
def test_rigid_and_flexible_models_have_one_circulation(aircraft, speed, degrees, law):
    """At the flexible model's trim the reduced operator gives the circulations of its moving lattice.

    Two codes for one boundary value problem with one wake: they agree to round-off from 2 to 20 degrees.
    """
    model = model_at(aircraft, speed, law)
    found = beam_trim(model)
    assert np.degrees(found.alpha) == pytest.approx(degrees, rel=0.1)
    rings = np.cumsum([part.rings for part in model.lattice.lattices])[:-1]
    own = [
        part.reshape(lattice.chordwise, lattice.spanwise)[-1]
        for part, lattice in zip(
            np.split(found.state.circulation, rings), model.lattice.lattices, strict=True
        )
    ]
    np.testing.assert_allclose(
        edge_circulations(model, found.alpha), np.concatenate(own), rtol=1e-11, atol=1e-11
    )


@pytest.mark.parametrize(
    ("aircraft", "speeds"),
    [(rigid(example_aircraft()), STRAIGHT), (rigid(tailed()), TAILED)],
    ids=["straight", "tailed"],
)
def test_rigid_and_flexible_models_have_one_trim(aircraft, speeds):
    """Angle of attack, thrust and moment of an all-rigid aircraft agree in both models, from 2 to 20 degrees.

    Within 2e-4. They are equal to 1e-8 where the reduced operator accounts for the velocity along the
    surfaces: with a tail, and without one from a lift coefficient of 0.45.
    """
    for speed in speeds:
        model = model_at(aircraft, speed)
        close = 2e-4 if model.lattice.operator_shape[0] < 6 * model.lattice.strips else 1e-7
        one, other = chain_trim(model), beam_trim(model)
        assert one.alpha[0] == pytest.approx(other.alpha, rel=close)
        thrust = np.hypot(*other.force_B[[0, 2]])
        assert np.hypot(*one.force_B[0, [0, 2]]) == pytest.approx(thrust, rel=close)
        assert one.moment_B[0, 1] == pytest.approx(other.moment_B[1], rel=10.0 * close)


def test_a_wake_along_the_body_misses_the_moment_of_a_tail():
    """The law has content: with the wake along x of B the tailed aircraft's moment is 10 per cent off."""
    model = model_at(rigid(tailed()), TAILED[1])
    wanted = beam_trim(model).moment_B[1]
    assert abs(chain_trim(model, 0.0).moment_B[0, 1] / wanted - 1.0) > 0.09


def test_just_below_the_lift_from_which_the_flow_along_wings_counts():
    """At a lift coefficient of 0.44 a straight wing's trim is within 0.2 per cent without that flow."""
    model = model_at(rigid(example_aircraft()), 139.8)
    assert not model.lattice.steep
    assert model_at(rigid(example_aircraft()), 135.0).lattice.steep
    one, other = chain_trim(model), beam_trim(model)
    assert one.alpha[0] == pytest.approx(other.alpha, rel=2e-3)
    assert np.hypot(*one.force_B[0, [0, 2]]) == pytest.approx(np.hypot(*other.force_B[[0, 2]]), rel=2e-3)
    assert one.moment_B[0, 1] == pytest.approx(other.moment_B[1], rel=2e-3)


def test_the_wake_is_that_of_the_trim():
    """Trim with the plan's wake gives back the wake's angle of attack, swept and heavy."""
    model = model_at(rigid(example_aircraft()), STRAIGHT[3])
    angles = np.array([0.6, 0.4])
    plan = flight_plan(model, [Hold(angle) for angle in angles], GRID)
    found = trim(model, physical_guess(model), plan).require()
    assert start_at(model, angles, "trim").alpha == pytest.approx(found.alpha[0], abs=1e-9)
    assert found.alpha[0] > 0.35


def test_the_order_of_surfaces_does_not_matter():
    """Any order of the surfaces has the same wake, and so the same trim, to round-off."""
    found = []
    for order in permutations(range(4)):
        model = chain_model(aircraft_of(document(order)), flight_of(FLIGHT | {"airspeed_m_s": 9.0}), 2)
        begin = start_at(model, np.zeros(len(model.aircraft.hinges)), "trim")
        if not found or order[0] == 3:  # one in four is enough for the trims
            result = chain_trim(model)
            found.append((begin.alpha, result.alpha[0], *result.force_B[0], result.moment_B[0, 1]))
        assert begin.alpha == pytest.approx(found[0][0], abs=1e-12)
    np.testing.assert_allclose(found, np.broadcast_to(found[0], (len(found), 6)), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("links", [1, 3])
def test_half_an_aircraft_flies_like_the_whole_at_a_large_angle(links):
    """At 14 degrees with a tail and a morph: attitudes within 1e-9 rad."""
    aircraft = tailed()
    flight = replace(example_flight(), airspeed_m_s=TAILED[2], start=None)
    model = chain_model(aircraft, flight, links)
    schedules = [ConstantRate(0.0, 0.2, 0.4) for _ in aircraft.hinges]
    batch, flown = physical_guess(model), []
    for may_halve in (False, True):
        plan = flight_plan(model, schedules, steps(0.5, 0.005), may_halve=may_halve)
        assert plan.halved is may_halve
        flown.append(fly_trimmed(plan.flown(model), plan, batch).euler)
    assert np.abs(flown[0] - flown[1]).max() < 1e-9
    assert np.degrees(flown[0][0, 0, 1]) > 12.0


def test_a_given_start_gives_the_wake():
    """With a given start the wake has the flight's angle of attack, and nothing is trimmed."""
    model = chain_model(example_aircraft(), example_flight(), 2)
    held = [Hold(), Hold()]
    plans = [
        flight_plan(model, held, GRID, start="given"),
        flight_plan(model, held, GRID, wake_alpha=example_flight().start.alpha_rad),
    ]
    np.testing.assert_array_equal(plans[0].table.matrices, plans[1].table.matrices)
    assert not model.starts


def test_models_of_one_aircraft_have_one_wake():
    """Any number of links flies in the lattice of the rigid model, and a path shares that of its flights."""
    angles = np.array([0.3, 0.3])
    models = [chain_model(example_aircraft(), example_flight(), links) for links in (1, 2, 5)]
    first, *others = [start_at(model, angles, "trim").alpha for model in models]
    np.testing.assert_allclose(others, first, rtol=0.0, atol=1e-14)
    assert common_path(models[1], 0.0, 1.0, may_halve=True, initial_rad=0.3).begin.alpha == pytest.approx(
        first, abs=1e-12
    )
    assert common_path(models[1], 0.3, 1.0).begin.alpha == pytest.approx(first, abs=1e-12)


def test_without_air_there_is_no_wake_to_trim():
    """An airless flight has no trim, and its plan asks for none."""
    model = chain_model(example_aircraft(), airless(example_flight()), 2)
    assert start_at(model, np.zeros(2), "trim").alpha == 0.0
