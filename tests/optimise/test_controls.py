"""Morphs of a control surface: searched within its limits, verified in the flexible model, without torque."""

from __future__ import annotations

import numpy as np
import pytest

from morphcore.errors import InvalidInput
from morphcore.geometry.aircraft import Aircraft, Flight
from morphcore.models.equivalent import chain_model, physical_guess
from morphcore.optimise.feasible import morph_space
from morphcore.optimise.flights import MorphFlights, sample_times
from morphcore.optimise.optimisation import ScheduleOptimisation
from morphcore.optimise.settings import ScheduleSettings
from morphcore.simulate.common_path import common_path
from morphcore.simulate.schedule import ConstantRate
from morphdata.aircraft import Aircraft as AircraftDocument
from morphdata.lattice import Lattice
from morphdata.optimize import Limits, Morph, VerifyingModel
from tests.aero.controlled import flight_document, tailed
from tests.simulate.flights import fly

COARSE = Lattice(chordwise=2, spanwise=4)
AIRCRAFT = Aircraft.of(AircraftDocument.parse(tailed(flexible=True, hinged=True)))
FLIGHT = Flight.of(flight_document())
MODEL = chain_model(AIRCRAFT, FLIGHT, 2, COARSE)


def morph(**changes: object) -> Morph:
    """A short pull."""
    given = {"drive": "elevator", "final_rad": -0.04, "duration_s": 0.4, "knots": 4, "settle_s": 0.2}
    return Morph.parse({**given, **changes})


@pytest.mark.parametrize("drives", [("elevator_right", "elevator_left"), ("aileron_right",)])
def test_flights_move_the_control(drives: tuple[str, ...]) -> None:
    """Departures are the simulator's along the same drives; no hinge has a torque."""
    guess, schedule = physical_guess(MODEL), ConstantRate(0.0, 0.04, 0.3, ramp_s=0.1)
    path = common_path(MODEL, 0.0, 0.04, drives=drives, may_halve=True)
    times = sample_times(0.4, 0.2)
    bench = MorphFlights(MODEL, guess, path, times, initial_rad=0.0, start="trim", step_s=0.005)
    found = bench.fly([schedule], torque=True)
    flown = fly(
        AIRCRAFT, FLIGHT, dict.fromkeys(drives, schedule), model=guess, duration_s=float(times[-1]),
        output_step_s=0.01, step_s=0.005, lattice=COARSE,
    ).trajectory.euler  # fmt: skip
    departure = flown - flown[0]
    np.testing.assert_allclose(found.departure[0], departure, atol=1e-9)
    assert np.abs(departure).max() > 1e-2
    assert found.torque.size == 0


def test_a_pull_is_optimised_within_its_limits() -> None:
    """The found schedule keeps rate and acceleration, ends at the angle, and beats the constant rate."""
    limits = Limits.parse({"max_rate_rad_s": 0.3, "max_accel_rad_s2": 6.0})
    run = ScheduleOptimisation(
        AIRCRAFT, FLIGHT, physical_guess(MODEL), morph=morph(), limits=limits,
        search=ScheduleSettings(screen=8, starts=1, iterations=6), lattice=COARSE, step_s=0.005,
        verify="flexible", flexible=VerifyingModel.parse({"elements": 2}),
    )  # fmt: skip
    checkpoint = [step.checkpoint for step in run.steps()][-1]
    result = run.result(checkpoint).to_document()
    assert result["drives"] == ["elevator_right", "elevator_left"]
    assert result["schedule"]["drive"] == "elevator"
    times, angles = (np.array(result["schedule"][key]) for key in ("knot_time_s", "knot_angle_rad"))
    assert angles[-1] == pytest.approx(-0.04)
    assert np.abs(np.diff(angles) / np.diff(times)).max() <= 0.3
    variation = result["variation"]
    assert variation["optimum"]["equivalent"] < variation["constant"]["equivalent"]
    assert variation["optimum"]["flexible"] is not None
    assert {torque for each in result["torque"].values() for torque in each.values()} == {None}


def test_what_cannot_be_is_refused() -> None:
    """An angle beyond the control's limits, and a limit of a torque that is not computed."""
    with pytest.raises(InvalidInput, match=r"-0\.5\.\.0\.5 rad") as caught:
        morph_space(AIRCRAFT, morph(final_rad=-0.6), Limits(), 0.4)
    assert caught.value.pointer == "/morph/final_rad"
    with pytest.raises(InvalidInput, match="hinge moment of the control elevator_right") as caught:
        morph_space(AIRCRAFT, morph(), Limits.parse({"max_hinge_torque_nm": 1.0}), 0.4)
    assert caught.value.pointer == "/limits/max_hinge_torque_nm"
