"""Which morphs are possible, in which time; the constant rate; extremes of finished schedules."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from morphcore.errors import InvalidInput
from morphcore.optimise.feasible import constant_rate, morph_space, reached, require_schedules
from morphcore.optimise.limits import MorphSpace
from morphcore.simulate.schedule import Spline
from morphdata.optimize import Limits, Morph
from tests.identify.flights import reference_aircraft
from tests.optimise.morphs import sampled


@pytest.mark.parametrize(
    ("morph", "limits", "pointer"),
    [
        (Morph(final_rad=1.0, duration_s=0.5), Limits(max_rate_rad_s=1.0), "/limits/max_rate_rad_s"),
        (Morph(final_rad=-1.0, duration_s=0.5), Limits(max_rate_rad_s=1.0), "/limits/max_rate_rad_s"),
        (
            Morph(final_rad=1.0, duration_s=1.0, free_values=True),
            Limits(max_rate_rad_s=1.0, max_accel_rad_s2=8.0),
            "/limits/max_rate_rad_s",
        ),
        (
            Morph(final_rad=1.0, duration_s=1.5),
            Limits(max_rate_rad_s=1.5, max_accel_rad_s2=1.5),
            "/limits/max_accel_rad_s2",
        ),
        (Morph(final_rad=1.0, duration_s=1.5), Limits(max_accel_rad_s2=1.0), "/limits/max_accel_rad_s2"),
        (
            Morph(final_rad=1.0, duration_s=1.0, knots=10),
            Limits(max_rate_rad_s=1.0, max_accel_rad_s2=50.0, monotonic=False),
            "/limits/max_rate_rad_s",
        ),
    ],
)
def test_an_impossible_morph_names_the_limit_and_the_time_that_it_takes(morph, limits, pointer):
    """The error points at the limit; with the duration that it tells there are schedules, with less none."""
    space = morph_space(reference_aircraft(), morph, limits, morph.duration_s)
    with pytest.raises(InvalidInput) as caught:
        require_schedules(space)
    assert caught.value.pointer == pointer
    reported = float(caught.value.hint.split("raise duration_s to ")[1].split()[0])
    assert f"{reported:g}" in caught.value.message
    require_schedules(replace(space, duration_s=reported))
    with pytest.raises(InvalidInput):
        require_schedules(replace(space, duration_s=0.97 * reported))


def test_the_looser_limit_that_the_error_tells_is_enough():
    """With the rate that the hint names the morph is possible."""
    space = MorphSpace(Morph(final_rad=1.0, duration_s=0.5), Limits(max_rate_rad_s=1.0), 0.5)
    with pytest.raises(InvalidInput) as caught:
        require_schedules(space)
    rate = float(caught.value.hint.split("max_rate_rad_s to ")[1].split()[0])
    require_schedules(replace(space, limits=Limits(max_rate_rad_s=rate)))


@pytest.mark.parametrize(
    ("morph", "pointer"),
    [
        (Morph(final_rad=1.4, duration_s=2.0), "/morph/final_rad"),
        (Morph(final_rad=0.0, duration_s=2.0, initial_rad=-1.5), "/morph/initial_rad"),
    ],
)
def test_angles_that_no_hinge_reaches_are_refused(morph, pointer):
    """Start and end lie within the hinges' range and differ."""
    with pytest.raises(InvalidInput) as caught:
        morph_space(reference_aircraft(), morph, Limits(), 2.0)
    assert caught.value.pointer == pointer


def test_a_morph_changes_the_angle():
    """A morph to where it begins is refused."""
    with pytest.raises(InvalidInput) as caught:
        Morph(final_rad=0.3, duration_s=2.0, initial_rad=0.3)
    assert caught.value.pointer == "/final_rad"


def test_an_aircraft_without_hinges_cannot_morph():
    """Somebody has to move."""
    aircraft = reference_aircraft()
    fixed = replace(aircraft, surfaces=tuple(replace(s, hinges=()) for s in aircraft.surfaces))
    with pytest.raises(InvalidInput) as caught:
        morph_space(fixed, Morph(final_rad=1.0, duration_s=2.0), Limits(), 2.0)
    assert caught.value.pointer == "/aircraft/surfaces"


def test_a_stop_at_the_final_angle_is_no_obstacle():
    """Morphing to the very end of a hinge's range leaves room, turning back or not."""
    for monotonic in (True, False):
        space = morph_space(
            reference_aircraft(),
            Morph(final_rad=1.3, duration_s=2.5),
            Limits(max_rate_rad_s=1.0, monotonic=monotonic),
            2.5,
        )
        assert space.room > 0.05
        assert space.high == 1.0 or monotonic


@pytest.mark.parametrize(
    "limits",
    [
        Limits(),
        Limits(max_rate_rad_s=1.0),
        Limits(max_rate_rad_s=1.0, max_accel_rad_s2=6.0),
        Limits(max_accel_rad_s2=4.5),
        Limits(max_rate_rad_s=0.6, max_accel_rad_s2=4.0),
    ],
)
@pytest.mark.parametrize("duration_s", [1.3, 2.0, 3.7])
def test_the_constant_rate_keeps_the_limits_wherever_a_spline_does(limits, duration_s):
    """Ramps as the sample flights have, or the nearest that keep the limits; the duration is the spline's."""
    # at the shortest, where there is hardly any choice of ramps, too
    duration_s = max(duration_s, MorphSpace(Morph(final_rad=1.0, duration_s=9.0), limits, 9.0).quickest[0])
    morph = Morph(final_rad=1.0, duration_s=duration_s)
    ramped = constant_rate(morph, limits, duration_s)
    times = np.linspace(0.0, duration_s, 4001)
    motion = ramped.motion(times)
    assert motion.angle[0] == 0.0
    assert motion.angle[-1] == pytest.approx(1.0, abs=1e-12)
    assert np.abs(motion.rate).max() <= (limits.max_rate_rad_s or np.inf)
    assert np.abs(motion.acceleration).max() <= (limits.max_accel_rad_s2 or np.inf)
    extremes = reached(ramped)
    assert extremes.max_rate_rad_s == pytest.approx(np.abs(motion.rate).max(), rel=1e-12)
    assert extremes.max_accel_rad_s2 == pytest.approx(np.abs(motion.acceleration).max(), rel=1e-12)
    if limits == Limits():
        assert ramped.ramp_s == 0.1


def test_reached_extremes_are_those_of_the_flown_spline():
    """Closed forms of a finished schedule against 20,000 samples of it; one that reverses is detected."""
    rng = np.random.default_rng(0)
    for _ in range(20):
        time = np.concatenate([[0.0], np.sort(rng.uniform(0.2, 1.8, 4)), [2.0]])
        schedule = Spline(time, np.concatenate([[0.0], rng.uniform(0.0, 1.0, 4), [1.0]]))
        _, rate, acceleration = sampled(schedule)
        found = reached(schedule)
        assert np.abs(rate).max() <= found.max_rate_rad_s * (1.0 + 1e-12)
        assert found.max_rate_rad_s == pytest.approx(np.abs(rate).max(), rel=1e-4)
        assert np.abs(acceleration).max() <= found.max_accel_rad_s2 * (1.0 + 1e-12)
        assert found.monotonic == (rate.min() >= -1e-9)
    calm = MorphSpace(Morph(final_rad=1.0, duration_s=2.0), Limits(max_rate_rad_s=1.0), 2.0)
    assert reached(calm.schedule(calm.centre)).monotonic
