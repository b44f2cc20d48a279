"""Which searches a goal takes, without a flight: bisection, front, warm starts, what is missing."""

from __future__ import annotations

import numpy as np
import pytest

from morphcore.errors import InvalidInput
from morphcore.optimise.goals import (
    Found,
    chosen,
    durations,
    next_task,
    planned,
    warm_starts,
)
from morphcore.optimise.limits import MorphSpace
from morphdata.optimize import Limits, Morph, goal_faults

SHORTEST_S = 1.193


def found(model, duration_s, variation=np.inf):
    """What a search found, made up."""
    return Found(model, duration_s, np.full(4, 0.5), variation, variation, 0.0)


def searched(morph, law):
    """All searches that a goal makes where the least variation is a given function of the duration."""
    choice, done = durations(morph, SHORTEST_S), ()
    while (task := next_task(morph, choice, done)) is not None:
        done = (*done, found(task.model, task.duration_s, law(task.duration_s)))
    return choice, done


def test_least_variation_takes_two_searches():
    """One with the equivalent model, one with the rigid."""
    morph = Morph(final_rad=1.0, duration_s=2.0)
    _, done = searched(morph, lambda t: t)
    assert [(f.model, f.duration_s) for f in done] == [("equivalent", 2.0), ("rigid", 2.0)]
    assert chosen(morph, done) is done[0]


@pytest.mark.parametrize("threshold", [5.0, 6.123, 8.3, 9.99])
def test_minimum_time_is_the_first_that_is_calm_enough(threshold):
    """Of all durations, 10 ms apart, the shortest with no more variation than allowed, in few searches."""
    morph = Morph(final_rad=1.0, duration_s=3.0, goal="minimum_time", max_variation_rad2=threshold)
    choice, done = searched(morph, lambda t: 15.0 / t)
    best = chosen(morph, done)
    assert best.duration_s == pytest.approx(choice[15.0 / choice <= threshold][0])
    assert len(done) <= planned(morph, choice.size)
    assert done[-1].model == "rigid"
    assert done[-1].duration_s == best.duration_s


def test_minimum_time_ends_at_once_where_the_shortest_is_calm():
    """If the quickest morph that the limits allow is calm enough nothing else is searched."""
    morph = Morph(final_rad=1.0, duration_s=3.0, goal="minimum_time", max_variation_rad2=20.0)
    choice, done = searched(morph, lambda t: 15.0 / t)
    assert [f.model for f in done] == ["equivalent", "rigid"]
    assert done[0].duration_s == choice[0] == pytest.approx(1.2)


def test_minimum_time_passes_over_durations_without_a_schedule():
    """Durations in which the torque limit leaves nothing count as not calm."""
    morph = Morph(final_rad=1.0, duration_s=3.0, goal="minimum_time", max_variation_rad2=20.0)
    _, done = searched(morph, lambda t: np.inf if t < 1.777 else 15.0 / t)
    assert chosen(morph, done).duration_s == pytest.approx(1.78)


def test_an_unreachable_variation_is_an_error_that_tells_the_least():
    """Where no duration is calm enough the error names the least variation that was found."""
    morph = Morph(final_rad=1.0, duration_s=3.0, goal="minimum_time", max_variation_rad2=2.0)
    with pytest.raises(InvalidInput) as caught:
        searched(morph, lambda t: 15.0 / t)
    assert caught.value.pointer == "/morph/max_variation_rad2"
    assert "5 rad^2 in 3 s" in caught.value.message


@pytest.mark.parametrize("points", [2, 5, 30])
def test_the_front_spans_from_the_shortest_to_the_given_duration(points):
    """Durations are spread evenly, on whole samples, both ends included."""
    morph = Morph(final_rad=1.0, duration_s=2.0, goal="pareto", front_points=points)
    choice, done = searched(morph, lambda t: t)
    assert choice.size == points
    assert choice[0] == pytest.approx(1.2)
    assert choice[-1] == 2.0
    assert np.ptp(np.diff(choice)) < 0.011
    assert [f.duration_s for f in done[:-1]] == list(choice)
    assert (done[-1].model, done[-1].duration_s) == ("rigid", 2.0)


def test_a_duration_between_samples_is_looked_at_too():
    """The longest duration is the requested one, whether a whole number of samples or not."""
    assert (
        durations(
            Morph(final_rad=1.0, duration_s=1.996, goal="minimum_time", max_variation_rad2=1.0), SHORTEST_S
        )[-1]
        == 1.996
    )
    assert durations(Morph(final_rad=1.0, duration_s=1.196, goal="pareto"), SHORTEST_S).tolist() == [1.196]


def test_warm_starts_are_the_neighbours_shape_and_its_schedule():
    """From the nearest duration: the same shape, and the same times counted from the end."""
    space = MorphSpace(Morph(final_rad=1.0, duration_s=2.0), Limits(max_rate_rad_s=1.0), 2.0)
    assert warm_starts(space, ()).shape == (0, 4)
    assert warm_starts(space, (found("equivalent", 1.8), found("rigid", 1.9, 3.0))).shape == (0, 4)
    shape, later = warm_starts(space, (found("equivalent", 1.0, 3.0), found("equivalent", 1.6, 3.0)))
    np.testing.assert_array_equal(shape, 0.5)
    np.testing.assert_allclose(2.0 * (1.0 - later), 1.6 * (1.0 - 0.5))


def test_what_a_goal_lacks_is_named():
    """Minimum time needs a threshold; a shortest duration needs a limit of rate or acceleration."""
    with pytest.raises(InvalidInput) as caught:
        Morph(final_rad=1.0, duration_s=2.0, goal="minimum_time")
    assert caught.value.pointer == "/max_variation_rad2"
    fastest = Morph(final_rad=1.0, duration_s=2.0, goal="minimum_time", max_variation_rad2=1.0)
    front = Morph(final_rad=1.0, duration_s=2.0, goal="pareto")
    for morph in (fastest, front):
        (fault,) = goal_faults(morph, Limits(max_hinge_torque_nm=500.0))
        assert fault.pointer == "/limits"
        assert not list(goal_faults(morph, Limits(max_rate_rad_s=1.0)))
