"""Morphs of one drive among several: what moves, what holds, whose torque counts."""

from __future__ import annotations

import numpy as np
import pytest

from morphcore.errors import InvalidInput
from morphcore.models.equivalent import chain_model, physical_guess
from morphcore.optimise.feasible import morph_drives, morph_space, morph_word
from morphcore.optimise.flights import MorphFlights, sample_times
from morphcore.simulate.common_path import common_path
from morphcore.simulate.schedule import ConstantRate, Hold
from morphdata.lattice import Lattice
from morphdata.optimize import Limits, Morph
from tests.models.chains import example_aircraft, example_flight
from tests.models.many_hinges import FOLD, SWEEP, hinged_wings
from tests.simulate.flights import fly

COARSE = Lattice(chordwise=2, spanwise=6)
HELD_SWEEP = {**SWEEP, "angle_rad": 0.2}


def morph(**changes: object) -> Morph:
    """A short morph."""
    return Morph.parse({"final_rad": 0.4, "duration_s": 0.5, **changes})


def test_the_only_word_needs_no_name() -> None:
    """Both sides of the example's sweep; a drive's own name moves one."""
    aircraft = example_aircraft()
    assert morph_drives(aircraft, morph()) == ("sweep_right", "sweep_left")
    assert morph_word(aircraft, morph()) == "sweep"
    assert morph_drives(aircraft, morph(drive="sweep_left")) == ("sweep_left",)
    assert morph_word(aircraft, morph(drive="sweep_left")) == "sweep_left"


def test_several_words_need_a_name() -> None:
    """The error lists what could be meant; a name that is none of them is refused too."""
    aircraft = hinged_wings(SWEEP, FOLD)
    for given in ({}, {"drive": "droop"}, {"drive": "both"}):
        with pytest.raises(InvalidInput) as caught:
            morph_drives(aircraft, morph(**given))
        assert caught.value.pointer == "/morph/drive"
        for name in ("sweep_left", "fold_left", "fold"):
            assert name in caught.value.hint
    assert set(morph_drives(aircraft, morph(drive="fold"))) == {"fold_left", "fold_right"}


def test_the_range_is_that_of_what_moves() -> None:
    """A hinge that holds does not limit the morph."""
    narrow = {**SWEEP, "min_rad": -0.1, "max_rad": 0.1}
    aircraft = hinged_wings(narrow, FOLD)
    morph_space(aircraft, morph(drive="fold"), Limits(), 0.5)
    with pytest.raises(InvalidInput) as caught:
        morph_space(aircraft, morph(drive="sweep"), Limits(), 0.5)
    assert caught.value.pointer == "/morph/final_rad"


@pytest.mark.parametrize("drives", [("fold_right", "fold_left"), ("fold_left",)])
def test_flights_move_the_drive_and_hold_the_others(drives: tuple[str, ...]) -> None:
    """Departures are the simulator's along the same drive, the sweep held at its angle, on one side or both.

    Both tables of the lattice interpolate between other nodes: 1e-4 of the largest departure. Torques are
    those of the moved hinges alone.
    """
    aircraft, flight = hinged_wings(HELD_SWEEP, FOLD), example_flight()
    model = chain_model(aircraft, flight, 2, COARSE)
    guess, schedule = physical_guess(model), ConstantRate(0.0, 0.4, 0.3, ramp_s=0.1)
    path = common_path(model, 0.0, 0.4, drives=drives, may_halve=True)
    assert path.halved is (len(drives) == 2)
    flights = MorphFlights(
        model, guess, path, sample_times(0.4, 0.2), initial_rad=0.0, start="trim", step_s=0.005
    )
    flown = flights.fly([schedule, Hold(0.0)], torque=True)
    alone = fly(
        aircraft, flight, dict.fromkeys(drives, schedule), model=guess, duration_s=0.6, step_s=0.005,
        lattice=COARSE,
    ).trajectory  # fmt: skip
    np.testing.assert_array_equal(alone.drives["sweep_left"], 0.2)
    largest = np.abs(flown.departure[0]).max()
    assert largest > 1e-3
    np.testing.assert_allclose(flown.departure[0], alone.euler - alone.euler[0], rtol=0, atol=1e-4 * largest)
    # half an aircraft has one hinge of the pair
    assert flown.torque.shape[1] == flights.grid.steps + 1
    assert (flown.peak_torque > 0.0).all()
