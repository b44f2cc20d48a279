"""The step chosen for given flights meets its tolerance, and is no shorter than needed."""

from __future__ import annotations

import numpy as np
import pytest

from morphcore.frames import wrap_angle
from morphcore.models.equivalent import chain_model, physical_guess
from morphcore.simulate.schedule import ConstantRate, Hold
from morphcore.simulate.step_choice import CANDIDATES_S, TOLERANCE_RAD, busiest_part, choose_step
from morphcore.simulate.time_grid import time_grid
from morphdata.environment import Environment, Gust, Turbulence
from tests.models.chains import example_aircraft, example_flight
from tests.simulate.flights import example_model, fly, fly_trimmed, plan_of, sample, sample_schedules

SLOW = [ConstantRate(0.0, 0.3, 0.5, ramp_s=0.2)] * 2
# one wing jerks through 0.5 rad: its ramps last two steps of 10 ms
HARD = [ConstantRate(0.0, 0.5, 0.4, start_s=0.1, ramp_s=0.02), Hold()]
TIMES_S = np.linspace(0.0, 0.6, 61)


def error(model, schedules, step_s):
    """Attitude error of a step against an eighth of the shortest candidate, rad: a flight of its own."""
    fine_s = CANDIDATES_S[-1] / 8
    coarse, fine = (
        fly_trimmed(model, plan_of(model, schedules, 0.6, step)).euler for step in (step_s, fine_s)
    )
    every = round(step_s / fine_s)
    return float(np.abs(wrap_angle(coarse - fine[::every])).max())


@pytest.mark.parametrize(("schedules", "expected_s"), [(SLOW, 0.01), (HARD, 0.005)])
def test_the_longest_step_within_the_tolerance(schedules, expected_s):
    """What is chosen is within the tolerance; of what is refused the error is indeed greater.

    The estimate is that of the asymptotic error: right to a quarter here.
    """
    model = example_model(2)
    found = choose_step(model, [(schedules, TIMES_S)])
    assert found.holds
    assert found.step_s == expected_s
    assert found.error_rad <= TOLERANCE_RAD
    assert error(model, schedules, found.step_s) == pytest.approx(found.error_rad, rel=0.25)
    for refused_s in (step for step in CANDIDATES_S if step > found.step_s):
        assert error(model, schedules, refused_s) > TOLERANCE_RAD


def test_the_worst_flight_decides():
    """Of several flights the one that needs the shortest step sets it, in any order."""
    model = example_model(2)
    flights = [(SLOW, TIMES_S), (HARD, TIMES_S)]
    alone = choose_step(model, flights[1:])
    assert choose_step(model, flights) == choose_step(model, flights[::-1]) == alone


def test_a_tolerance_beyond_reach():
    """Where no candidate holds the tolerance, the shortest is taken and says so."""
    found = choose_step(example_model(2), [(HARD, TIMES_S)], tolerance_rad=1e-9)
    assert not found.holds
    assert found.step_s == CANDIDATES_S[-1]
    assert found.error_rad > 1e-9


@pytest.mark.parametrize("name", ["train_rate_0.8", "train_asymmetric"])
def test_the_sample_flights_take_the_longest_step(name):
    """10 ms hold on the examples, whose rows they hit."""
    model = chain_model(example_aircraft(), example_flight(), 3)
    flown = sample(name)
    found = choose_step(model, [(sample_schedules(name), flown.time_s)], physical_guess(model))
    assert found.holds
    assert found.step_s == CANDIDATES_S[0]
    assert time_grid(flown.time_s, found.step_s).at is not None


@pytest.mark.parametrize("spacing_s", [0.013, 0.007, 0.1 / 3.0])
def test_rows_of_any_spacing(spacing_s):
    """Grids of two candidates need not be each other's halves; the estimate stays that of the step itself."""
    model = example_model(2)
    times_s = spacing_s * np.arange(round(0.6 / spacing_s))
    found = choose_step(model, [(HARD, times_s)], candidates_s=CANDIDATES_S)
    assert found.holds
    grid = time_grid(times_s, found.step_s)
    fine_s = grid.step_s / 8
    coarse, fine = (
        fly_trimmed(model, plan_of(model, HARD, times_s[-1], step)).euler for step in (grid.step_s, fine_s)
    )
    actual = float(np.abs(wrap_angle(coarse - fine[::8])).max())
    assert actual == pytest.approx(found.error_rad, rel=0.3)


def test_half_the_aircraft_chooses_what_the_whole_does():
    """A symmetric flight of half the aircraft has the same error, so the same step."""
    model = example_model(2)
    whole, half = (choose_step(model, [(SLOW, TIMES_S)], may_halve=halve) for halve in (False, True))
    assert half.step_s == whole.step_s
    assert half.error_rad == pytest.approx(whole.error_rad, rel=1e-4)


def test_a_flight_chooses_its_step():
    """A flight of which nobody gives the step holds 1e-4 rad where 10 ms do not; a given step stands."""

    def flown(**options):
        return fly(example_aircraft(), example_flight(), HARD, duration_s=0.6, **options)

    fine = flown(step_s=CANDIDATES_S[-1] / 8).trajectory.euler
    chosen, given = flown(), flown(step_s=CANDIDATES_S[0])
    assert (chosen.step_s, given.step_s) == (CANDIDATES_S[-1], CANDIDATES_S[0])
    assert np.abs(given.trajectory.euler - fine).max() > 1e-4 > np.abs(chosen.trajectory.euler - fine).max()


def test_turbulence_does_not_choose():
    """The step is that of the smooth air: the same seed of turbulence gives the same air as a given step."""
    air = Environment(
        gust=Gust(amplitude_m_s=3.0, gradient_m=20.0, start_s=0.1),
        turbulence=Turbulence(wind_20ft_m_s=5.0, sigma_high_m_s=1.0),
    )
    both = [
        fly(
            example_aircraft(),
            example_flight(),
            SLOW,
            duration_s=0.6,
            environment=air,
            rng=np.random.default_rng(3),
            step_s=step_s,
        )
        for step_s in (None, CANDIDATES_S[0])
    ]
    assert both[0].step_s == both[1].step_s
    np.testing.assert_array_equal(both[0].trajectory.euler, both[1].trajectory.euler)


@pytest.mark.parametrize("start_s", [0.0, 40.0, 99.0])
def test_of_a_long_flight_the_fastest_morph_is_looked_at(start_s):
    """The requested length, around the fastest morph, from the flight's own rows."""
    times_s = np.linspace(0.0, 100.0, 1001)
    slow, fast = ConstantRate(0.0, 0.1, 20.0, start_s=20.0), ConstantRate(0.0, 0.5, 0.5, start_s=start_s)
    part = busiest_part([slow, fast], times_s, 10.0)
    assert part[-1] - part[0] == pytest.approx(10.0)
    assert part[0] <= start_s
    assert part[-1] >= start_s + 0.5
    assert np.isin(part, times_s).all()


def test_short_flights_and_held_hinges_are_looked_at_from_their_start():
    """A flight within the limit is looked at whole; without any hinge, the first part."""
    np.testing.assert_array_equal(busiest_part(SLOW, TIMES_S), TIMES_S)
    np.testing.assert_array_equal(busiest_part([], TIMES_S, 0.1), TIMES_S[:11])
