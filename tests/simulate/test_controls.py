"""Flights with control surfaces: symmetry, agreement of the models, and plans that carry deflections."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from morphcore import load_aircraft, load_flight, simulate
from morphcore.errors import InvalidInput
from morphcore.geometry.aircraft import Aircraft, Flight
from morphcore.models.equivalent import chain_model, physical_guess
from morphcore.simulate.common_path import common_path
from morphcore.simulate.control_motion import lagged_deflections
from morphcore.simulate.hinge_schedules import followed_schedules, hinge_schedules
from morphcore.simulate.plan import flight_plan
from morphcore.simulate.schedule import ConstantRate, Hold, Quadratic, Spline
from morphcore.simulate.time_grid import time_grid
from morphdata.aircraft import Aircraft as AircraftDocument
from morphdata.lattice import Lattice, VortexCore
from morphdata.schedules import load_schedules
from tests.aero.controlled import WING, flight_document, tailed

LATTICE = Lattice(chordwise=2, spanwise=6)
EXAMPLE = Path(__file__).parents[2] / "examples" / "controls"
PULL = ConstantRate(0.0, -0.04, 0.1, 0.05, 0.02)
ROLL = ConstantRate(0.0, 0.03, 0.15, 0.1, 0.02)
SWEEP = Quadratic(0.0, 0.2, 0.3)


def document(*, flexible=True, hinged=True):
    """The tailed aircraft."""
    return AircraftDocument.parse(tailed(flexible=flexible, hinged=hinged))


def flown(schedules, *, model="rigid", aircraft=None, **more):
    """A short flight; ``model`` may be a number of links."""
    aircraft = document() if aircraft is None else aircraft
    lattice = more.pop("lattice", LATTICE)
    if isinstance(model, int):
        chain = chain_model(Aircraft.of(aircraft), Flight.of(flight_document()), model, lattice)
        model = physical_guess(chain)
    settings = {"duration_s": 0.4, "step_s": 0.005, "output_step_s": 0.02, "elements": 3, **more}
    return simulate(aircraft, flight_document(), schedules, model=model, lattice=lattice, **settings)


@pytest.mark.parametrize("law", ["line", "smoothed"])
@pytest.mark.parametrize("model", ["rigid", 3, "flexible"])
def test_mirror_images(model, law):
    """A flight with left and right exchanged rolls and yaws the other way, to 1e-9 rad.

    The image of ailerons moved by v is that of -v; of a symmetric drive of one side, that of the other.
    """
    lattice = Lattice(chordwise=2, spanwise=4, core=VortexCore(law=law))
    less = ConstantRate(0.0, -0.03, 0.15, 0.1, 0.02)
    settings = {"model": model, "lattice": lattice, "duration_s": 0.3}
    one = flown({"aileron": ROLL, "elevator_right": PULL, "sweep_left": SWEEP}, **settings).trajectory
    other = flown({"aileron": less, "elevator_left": PULL, "sweep_right": SWEEP}, **settings).trajectory
    np.testing.assert_allclose(other.euler, one.euler * [-1.0, 1.0, -1.0], rtol=0.0, atol=1e-9)
    assert min(np.ptp(angle) for angle in one.euler.T) > 1e-4


@pytest.mark.parametrize("model", ["rigid", 3, "flexible"])
def test_symmetric_controls_fly_straight(model):
    """An elevator moves the attitude in pitch alone; the trajectory has the columns of both its drives."""
    result = flown({"elevator": PULL}, model=model)
    trajectory = result.trajectory
    assert np.abs(trajectory.euler[:, ::2]).max() < 1e-9
    assert np.ptp(trajectory.theta) > 5e-3
    assert trajectory.theta[-1] > trajectory.theta[0]  # trailing edge up, nose up
    np.testing.assert_allclose(trajectory.drives["elevator_left"], PULL.motion(trajectory.time_s).angle)
    np.testing.assert_array_equal(trajectory.drives["elevator_left"], trajectory.drives["elevator_right"])
    assert not trajectory.drives["aileron_left"].any()


@pytest.mark.parametrize("model", ["rigid", 3])
def test_half_the_aircraft_stands_for_a_symmetric_deflection(model):
    """Half the aircraft flies an elevator like the whole, which a thickness off by 1e-13 is taken for."""
    pulled = flown({"elevator": PULL}, model=model).trajectory
    given = tailed(flexible=True, hinged=True)
    given["surfaces"][3]["thickness_m"] *= 1.0 + 1e-13  # no mirror image: nothing is halved
    uneven = flown({"elevator": PULL}, model=model, aircraft=AircraftDocument.parse(given))
    np.testing.assert_allclose(uneven.trajectory.euler, pulled.euler, rtol=0.0, atol=1e-10)


def test_what_may_halve():
    """Symmetric deflections and resting ailerons may; ailerons may not, unless both go down."""
    aircraft = Aircraft.of(document())
    model = chain_model(aircraft, Flight.of(flight_document()), 2, LATTICE)
    grid = time_grid(0.01 * np.arange(31))

    def halved(**schedules):
        each = hinge_schedules(aircraft, followed_schedules(aircraft, schedules))
        return flight_plan(model, each, grid, may_halve=True).halved

    assert halved(elevator=PULL) and halved()  # noqa: PT018
    assert not halved(elevator_left=PULL)
    assert not halved(aileron=ROLL)
    down = ConstantRate(0.0, -0.03, 0.15, 0.1, 0.02)
    assert halved(aileron_right=ROLL, aileron_left=down)  # both trailing edges go down: flaps
    assert not halved(aileron=Hold(0.01))


@pytest.mark.parametrize("sweep_rad", [0.0, 0.4])
@pytest.mark.parametrize("drives", [{"elevator": -0.04}, {"aileron": 0.02}, {"aileron_left": 0.02}])
def test_rigid_and_flexible_models_of_a_stiff_aircraft_agree(drives, sweep_rad):
    """A step of a control turns both models alike, swept or not: within 1 per cent of the response."""
    schedules = {name: ConstantRate(0.0, to, 0.05, 0.05, 0.02) for name, to in drives.items()}
    schedules["sweep"] = Hold(sweep_rad)
    aircraft = document(flexible=False)
    lattice = Lattice(chordwise=4, spanwise=6)
    settings = {"aircraft": aircraft, "lattice": lattice, "duration_s": 0.5, "step_s": 0.002}
    one = flown(schedules, **settings).trajectory.euler
    other = flown(schedules, model="flexible", **settings).trajectory.euler
    one, other = one - one[0], other - other[0]
    response = np.abs(other).max()
    assert response > 0.02
    np.testing.assert_allclose(one, other, rtol=0.0, atol=0.01 * response)


def test_the_trim_holds_the_first_deflection():
    """A deflected elevator at rest changes the trim's moment and nothing else moves; both models agree."""
    moments = {}
    for model in ("rigid", "flexible"):
        each = []
        for angle in (0.0, 0.05):
            aircraft = document(flexible=False, hinged=False)
            result = flown({"elevator": Hold(angle)}, model=model, aircraft=aircraft, duration_s=0.2)
            assert np.ptp(result.trajectory.euler, axis=0).max() < 1e-8
            each.append(result.trim.moment_B[0, 1])
        moments[model] = np.array(each)
    assert moments["rigid"][1] - moments["rigid"][0] > 1.0  # the tail is pushed up: nose up is needed
    change = np.diff(moments["rigid"])
    np.testing.assert_allclose(np.diff(moments["flexible"]), change, rtol=0.02)


def test_held_angles_of_the_document_are_flown():
    """A control that nobody moves holds its ``angle_rad``, like one that a schedule holds there."""
    given = tailed(flexible=True, hinged=True)
    for surface in given["surfaces"]:
        surface["controls"][0]["angle_rad"] = 0.03
    held = flown({}, aircraft=AircraftDocument.parse(given), duration_s=0.1)
    moved = flown({"elevator": Hold(0.03), "aileron": Hold(0.03)}, duration_s=0.1)
    np.testing.assert_allclose(held.trim.moment_B, moved.trim.moment_B, rtol=1e-12)
    assert held.trim.moment_B[0, 0] != 0.0


def test_a_coarser_plan_is_the_same_flight():
    """Of a plan, its restriction to a coarser grid has the deflections of one made on that grid."""
    aircraft = Aircraft.of(document())
    model = chain_model(aircraft, Flight.of(flight_document()), 2, LATTICE)
    schedules = {"elevator": PULL, "sweep": SWEEP, "aileron": ROLL}
    each = hinge_schedules(aircraft, followed_schedules(aircraft, schedules))
    grid = time_grid(0.01 * np.arange(41))
    fine = flight_plan(model, each, grid.halved(2))
    coarse, anew = fine.coarser(grid), flight_plan(model, each, grid)
    for one, other in ((coarse.table, anew.table), (coarse.middle.table, anew.middle.table)):
        np.testing.assert_allclose(one.controls.deflection, other.controls.deflection, atol=2e-5)
        scale = np.abs(other.matrices).max()
        for a, b in zip(one.between(3, 8), other.between(3, 8), strict=True):
            np.testing.assert_allclose(a, b, atol=1e-4 * scale)
    rows = np.array([0, 7, 20])
    np.testing.assert_array_equal(
        anew.instants(rows).table.controls.deflection, anew.table.controls.deflection[rows]
    )
    np.testing.assert_array_equal(anew.at_rest().first_deflections, anew.first_deflections)


def test_the_lag_is_jones():
    """The loads of a step of a control build up by Jones' function of the semichords travelled."""
    aircraft = Aircraft.of(AircraftDocument.parse(tailed()))
    spacing, speed = 1e-4, 20.0
    step = np.zeros((2000, 4))
    step[1:] = 0.1
    found = lagged_deflections(aircraft, speed, step, spacing)
    column = [control.drive for control in aircraft.controls].index("aileron_right")
    semichords = (spacing * np.arange(2000) - 0.5 * spacing) * speed / (0.5 * WING[1])
    wagner = 1.0 - 0.165 * np.exp(-0.0455 * semichords) - 0.335 * np.exp(-0.3 * semichords)
    np.testing.assert_allclose(found[1:, column], 0.1 * wagner[1:], rtol=1e-4)
    still = np.full((50, 4), 0.07)
    np.testing.assert_allclose(lagged_deflections(aircraft, speed, still, spacing), still, rtol=1e-15)


def test_a_common_path_of_controls_is_a_flight_plan():
    """Schedules of a control share one lattice; its flights are those of plans made by themselves."""
    aircraft = Aircraft.of(document())
    model = chain_model(aircraft, Flight.of(flight_document()), 1, LATTICE)
    grid = time_grid(0.01 * np.arange(21))
    drives = ("elevator_left", "elevator_right")
    path = common_path(model, -0.05, 0.0, drives=drives, may_halve=True, initial_rad=0.0)
    assert path.halved
    assert path.matrices.shape[0] == 1
    own = path.plan(model, PULL, grid)
    each = hinge_schedules(aircraft, followed_schedules(aircraft, {"elevator": PULL}))
    alone = flight_plan(model, each, grid, may_halve=True)
    for a, b in zip(own.table.between(0, 21), alone.table.between(0, 21), strict=True):
        np.testing.assert_allclose(a, b, atol=1e-13)
    assert not common_path(model, 0.0, 0.1, drives=("aileron_left", "aileron_right"), may_halve=True).halved
    swept = common_path(model, 0.0, 0.1, may_halve=True)  # all hinges; controls hold
    assert swept.halved
    assert not swept.plan(model, ConstantRate(0.0, 0.1, 0.15, 0.0, 0.02), grid).first_deflections.any()


def test_mistakes():
    """Unknown drives are named with those there are, and a spline that leaves the range with its limits."""
    with pytest.raises(InvalidInput, match="no drive 'elevators'") as found:
        flown({"elevators": PULL})
    assert "elevator" in str(found.value.hint)
    with pytest.raises(InvalidInput, match="both move the drive 'elevator_left'"):
        flown({"elevator_left": PULL, "elevator": PULL})
    beyond = Spline(np.array([0.0, 0.2]), np.array([0.0, 0.7]))
    with pytest.raises(InvalidInput, match=r"control elevator_right .* -0\.5\.\.0\.5 rad"):
        flown({"elevator": beyond})


@pytest.mark.parametrize("model", ["rigid", 2])
def test_the_step_stays_of_second_order(model):
    """Halving the step of a flight with a moving elevator and ailerons divides its error by about four."""
    pull = ConstantRate(0.0, -0.04, 0.3, 0.05, 0.15)  # without corners in the deflection's rate
    schedules = {"elevator": pull, "aileron": ConstantRate(0.0, 0.02, 0.3, 0.05, 0.15)}
    found = [
        flown(schedules, model=model, step_s=step_s).trajectory.euler
        for step_s in (0.01, 0.005, 0.0025, 0.000625)
    ]
    errors = [np.abs(euler - found[-1]).max() for euler in found[:-1]]
    assert errors[0] < 1e-3
    assert errors[0] / errors[1] > 3.0
    assert errors[1] / errors[2] > 3.0


def test_the_example_flies():
    """The documents in examples/controls fly along their schedule, and stay in range."""
    aircraft, flight = load_aircraft(EXAMPLE / "aircraft.json"), load_flight(EXAMPLE / "flight.json")
    result = simulate(
        aircraft, flight, load_schedules(EXAMPLE / "schedule.csv"), duration_s=1.0, lattice=LATTICE
    )
    assert min(np.ptp(angle) for angle in result.trajectory.euler.T) > 1e-3
    assert not result.warnings
    untrimmed = flight.model_copy(update={"trim_drive": None})
    far = simulate(aircraft, untrimmed, {"elevator": Hold(0.4)}, duration_s=0.05, lattice=LATTICE)
    assert "large_deflection" in [warning.code for warning in far.warnings]


def test_a_control_of_one_side_is_never_halved():
    """A tab on one wing alone, held or moved, makes the aircraft asymmetric: it rolls in every model."""
    given = tailed(flexible=True, hinged=True)
    tab = {"name": "tab", "from": 0.1, "to": 0.3, "chord_fraction": 0.2, "angle_rad": 0.02}
    given["surfaces"][0]["controls"].append(tab)
    aircraft = AircraftDocument.parse(given)
    assert "tab" in aircraft.drives
    moments = [
        flown({}, model=model, aircraft=aircraft, duration_s=0.1).trim.moment_B[0, 0]
        for model in ("rigid", 2, "flexible")
    ]
    assert min(np.abs(moments)) > 0.1
    np.testing.assert_allclose(moments, moments[-1], rtol=0.1)
    moved = flown({"tab": ConstantRate(0.02, 0.1, 0.1, 0.05, 0.02)}, aircraft=aircraft).trajectory
    assert np.ptp(moved.phi) > 1e-3
