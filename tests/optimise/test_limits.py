"""The limits: exact against dense sampling, and kept by everything that the maps onto them return."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from morphcore.optimise.limits import HELD, SHORTEST_PIECE, MorphSpace
from morphdata.optimize import Limits, Morph
from tests.optimise.morphs import sampled

SPACES = [
    MorphSpace(
        Morph(final_rad=final, duration_s=2.0, initial_rad=0.1, knots=knots, free_values=free),
        limits,
        2.0,
        -0.4,
        1.3,
    )
    for (final, knots), free, limits in product(
        ((1.1, 7), (-0.9, 4)),
        (False, True),
        (
            Limits(max_rate_rad_s=1.0),
            Limits(max_rate_rad_s=1.2, max_accel_rad_s2=6.0),
            Limits(max_accel_rad_s2=3.0),
            Limits(),
            Limits(max_rate_rad_s=1.0, monotonic=False),
            Limits(max_rate_rad_s=1.2, max_accel_rad_s2=5.0, monotonic=False),
        ),
    )
]


def random_points(space, count, seed=0):
    """Points all over the unknowns' ranges, most of them far beyond the limits."""
    rng = np.random.default_rng(seed)
    return rng.uniform(space.lower, space.upper, (count, space.dimension))


def sampled_slack(space, point):
    """What dense sampling of the schedule says is left of each limit, relative."""
    angle, rate, acceleration = sampled(space.schedule(point))
    limits, change = space.limits, space.morph.change
    left = [np.inf]
    if limits.max_rate_rad_s is not None:
        left.append(1.0 - np.abs(rate).max() / limits.max_rate_rad_s)
    if limits.max_accel_rad_s2 is not None:
        left.append(1.0 - np.abs(acceleration).max() / limits.max_accel_rad_s2)
    if limits.monotonic:
        left.append((np.sign(change) * rate).min() / abs(change))
    share = (angle - space.morph.initial_rad) / change
    left += [share.min() - space.low, space.high - share.max()]
    return min(left)


@pytest.mark.parametrize("space", SPACES)
def test_what_is_drawn_back_keeps_every_limit_everywhere(space):
    """Of random schedules drawn back to the limits no sample of 20,000 exceeds one, not by round-off."""
    points = space.drawn_back(random_points(space, 12))
    assert space.keeps(points).all()
    for point in points:
        assert sampled_slack(space, point) >= -1e-13
        knots = space.schedule(point).knot_time_s
        assert np.diff(knots).min() >= SHORTEST_PIECE * space.duration_s


@pytest.mark.parametrize("space", SPACES)
def test_a_schedule_is_refused_only_for_what_sampling_sees(space):
    """Where knots are apart and 20,000 samples break no limit, the closed forms see none broken.

    Sampling misses vertices by 1e-5; between there and exact lies nothing to tell.
    """
    centre, rng = space.centre, np.random.default_rng(1)
    near = centre + rng.normal(0.0, 0.05, (60, space.dimension)) * (space.upper - space.lower)
    near[:, : space.inner].sort(axis=1)
    gaps = np.diff(np.pad(near[:, : space.inner], ((0, 0), (1, 1)), constant_values=(0.0, 1.0)), axis=1)
    near = near[gaps.min(axis=1) > SHORTEST_PIECE]
    seen = np.array([sampled_slack(space, point) for point in near])
    clear = np.abs(seen) > 1e-4
    np.testing.assert_array_equal(space.keeps(near[clear]), seen[clear] > 0.0)


@pytest.mark.parametrize("space", SPACES[::2])
def test_drawing_back_goes_no_further_than_it_must(space):
    """What keeps the limits stays; what does not ends where a limit just holds, on the ray to the centre."""
    points = random_points(space, 30, seed=2)
    back = space.drawn_back(points)
    np.testing.assert_array_equal(space.drawn_back(back), back)
    moved = ~space.keeps(points)
    assert moved.any()
    ray, went = points[moved] - space.centre, back[moved] - space.centre
    share = np.einsum("pd,pd->p", ray, went) / np.einsum("pd,pd->p", ray, ray)
    np.testing.assert_allclose(went, share[:, None] * ray, atol=1e-12)
    beyond = space.centre + (share + 1e-6)[:, None] * ray
    assert not space.keeps(beyond).any()


@pytest.mark.parametrize("space", SPACES)
def test_the_centre_leaves_room_on_all_sides(space):
    """The centre keeps the limits with a margin that is no less than any random schedule's."""
    assert space.room > 0.05
    assert space.room >= space.min_slack(random_points(space, 200)).max()


@pytest.mark.parametrize("space", SPACES[::3])
def test_the_nearest_point_with_a_margin(space):
    """Points at a limit have a neighbour that leaves a margin, hardly away from them."""
    for point in space.drawn_back(random_points(space, 5, seed=4)):
        inside = space.nearest(point, 1e-3)
        assert inside is not None
        assert space.min_slack(inside[None, :])[0] >= 1e-3
        assert np.abs(inside - point).max() < 0.02


@pytest.mark.parametrize("space", [s for s in SPACES if s.limits.max_rate_rad_s or s.limits.max_accel_rad_s2])
def test_the_quickest_morph_is_slower_than_the_trapezoid_and_feasible(space):
    """No schedule beats the trapezoidal rate; the spline comes within 40 per cent, and keeps the limits."""
    change, limits = abs(space.morph.change), space.limits
    rate = limits.max_rate_rad_s or np.inf
    acceleration = limits.max_accel_rad_s2 or np.inf
    reaches_rate = change > rate**2 / acceleration
    bang = change / rate + rate / acceleration if reaches_rate else 2.0 * np.sqrt(change / acceleration)
    shortest, point = space.quickest
    assert bang <= shortest < 1.4 * bang
    quick = MorphSpace(space.morph, limits, shortest * (1.0 + 1e-6), space.low, space.high)
    assert quick.keeps(point[None, :])[0]


def test_waiting_schedules_wait():
    """The first shapes of a search: at constant rate between ramps, after a wait."""
    space = MorphSpace(Morph(final_rad=1.0, duration_s=2.0, knots=8, free_values=True), Limits(), 2.0)
    points = space.waiting((0.4,))
    assert np.all((points >= 0.0) & (points <= 1.0))
    # the quickest ramp: six tenths of the time for one, the knots on a straight line but for the corners
    time, value = points[1, : space.inner], points[1, space.inner :]
    np.testing.assert_allclose(np.diff(value[1:-1]) / np.diff(time[1:-1]), 1.0 / 0.58, rtol=1e-9)


def test_the_last_angle_is_exact():
    """A schedule ends exactly at the requested angle, without round-off."""
    space = MorphSpace(Morph(final_rad=0.7, duration_s=1.1, initial_rad=0.1, knots=7), Limits(), 1.1)
    schedule = space.schedule(space.centre)
    assert schedule.knot_angle_rad[0] == 0.1
    assert schedule.knot_angle_rad[-1] == 0.7
    assert schedule.knot_time_s[-1] == 1.1
    assert HELD < 1e-6
