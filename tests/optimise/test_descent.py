"""The descent on problems whose answer is known, and how a torque limit is kept, without flights."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize

from morphcore.optimise.descent import NARROWING, ScheduleDescent, probes_of
from morphcore.optimise.easing import TorqueEasing
from morphcore.optimise.limits import HELD, MorphSpace
from morphcore.optimise.torque_limit import Anchored, TorqueLimit, Trials
from morphdata.optimize import Limits, Morph

SPACE = MorphSpace(
    Morph(final_rad=1.0, duration_s=2.0), Limits(max_rate_rad_s=1.0, max_accel_rad_s2=6.0), 2.0
)
LATE = np.array([0.75, 0.85, 0.92, 0.97])  # beyond the limits of SPACE
NO_LIMIT = TorqueLimit(None)


class Bench:
    """Flights replaced by formulas: errors curve gently about a wanted point, torques are linear in it.

    Every requested point is recorded.
    """

    def __init__(self, wanted=LATE, max_nm=None, space=SPACE):
        self.wanted, self.limit, self.space, self.requested = wanted, TorqueLimit(max_nm), space, []

    def __call__(self, points):  # noqa: D102 - see the class
        self.requested.append(points)
        x = points - self.wanted
        errors = np.concatenate([x + 0.3 * x**2, 0.5 * (x[:, 1:] - x[:, :-1])], axis=1)
        torque = np.stack([200.0 * points.sum(axis=1), -50.0 + 0.0 * points[:, 0]], axis=1)
        peak = np.abs(torque).max(axis=1)
        return Trials(points, np.einsum("pm,pm->p", errors, errors), errors, len(points), torque, peak)

    def evaluate(self, batch):
        """Fly a batch as the problem of an optimisation does."""
        if isinstance(batch, Anchored):
            return self.limit.kept(self.space, batch, self)
        return self(batch.points)

    @property
    def flown(self):
        """All requested points, (n, d)."""
        return np.concatenate(self.requested)


def iterated(solver, bench, state):
    """The state after one iteration: probes, and trial steps if any."""
    state = solver.tell(state, bench.evaluate(solver.ask(state)))
    while not solver.between_steps(state):
        state = solver.tell(state, bench.evaluate(solver.ask(state)))
    return state


def descended(bench, space=SPACE, iterations=12):
    """The end of a descent from the centre."""
    solver = ScheduleDescent(space, bench.limit, iterations)
    state = solver.init(bench(space.centre[None, :]))
    while not solver.done(state):
        state = iterated(solver, bench, state)
    return state


def independent(space, bench, torque=np.inf):
    """The constrained minimum by another route: SLSQP on the cost itself, from several starts."""
    best = np.inf
    for start in space.drawn_back(np.random.default_rng(0).uniform(size=(6, space.dimension))):
        constraints = [
            {"type": "ineq", "fun": lambda x: space.slack(x[None, :])[0]},
            {"type": "ineq", "fun": lambda x: min(torque, 1e9) - 200.0 * x.sum()},
        ]
        found = minimize(lambda x: bench(x[None, :]).cost[0], start, constraints=constraints, method="SLSQP")
        if found.success and space.min_slack(found.x[None, :])[0] > -1e-6:
            best = min(best, found.fun)
    return best


def test_finds_the_minimum_at_the_limits():
    """The least cost under rate and acceleration limits is found to 1e-5, at a corner of the limits."""
    bench = Bench()
    state = descended(bench)
    assert state.cost[0] == pytest.approx(independent(SPACE, Bench()), rel=1e-5)
    assert SPACE.min_slack(state.point)[0] < 1e-6
    assert not state.active.any()


def test_finds_a_minimum_inside():
    """Where the wanted schedule keeps the limits it is found itself."""
    inside = SPACE.drawn_back(SPACE.centre[None, :] + 0.02)[0]
    state = descended(Bench(inside))
    np.testing.assert_allclose(state.point[0], inside, atol=1e-5)


def test_nothing_to_gain_is_no_error():
    """Where no angle with a weight departs at all, the descent rests where it is."""

    class Silent(Bench):
        def __call__(self, points):
            count = len(points)
            nothing = np.zeros((count, 0))
            return Trials(points, np.zeros(count), np.zeros((count, 5)), count, nothing, np.zeros(count))

    state = descended(Silent())
    np.testing.assert_array_equal(state.point, SPACE.centre[None, :])
    assert not state.active.any()


def test_nothing_is_flown_that_breaks_a_limit():
    """Probes and trials alike keep the limits, whatever the search does."""
    bench = Bench()
    descended(bench)
    assert SPACE.keeps(bench.flown).all()
    assert bench.flown.shape[0] > 20


def test_a_torque_limit_is_met_and_kept():
    """The minimum under a torque limit is found to a per mille, and no better point was taken above it."""
    limit = 430.0
    bench = Bench(max_nm=limit)
    assert bench(SPACE.centre[None, :]).peak[0] < limit
    state = descended(bench, iterations=20)
    assert state.torque[0] <= limit
    assert state.torque[0] == 200.0 * state.point[0].sum()
    assert state.cost[0] == pytest.approx(independent(SPACE, Bench(), limit), rel=5e-3)
    assert SPACE.keeps(bench.flown).all()


def test_starts_rest_when_they_stall_or_fall_behind():
    """Late in a descent only the best start is flown on; one that has converged is left as it is."""
    bench = Bench()
    solver = ScheduleDescent(SPACE, NO_LIMIT, 99)
    known = bench(SPACE.drawn_back(np.random.default_rng(3).uniform(size=(3, 4))))
    # begun again that late
    late = replace(solver.init(known), iteration=NARROWING[-1][0] - 1)
    state = iterated(solver, bench, late)
    moved = iterated(solver, bench, state)
    order = np.argsort(state.cost)
    np.testing.assert_array_equal(moved.point[order[1:]], state.point[order[1:]])
    assert moved.cost[order[0]] < state.cost[order[0]]
    calm = Bench(SPACE.centre)
    rested = descended(calm, iterations=99)
    assert solver.done(rested)
    assert rested.iteration < 99


@pytest.mark.parametrize("knots", [4, 6, 12, 20])
def test_probes_keep_the_limits_at_every_corner(knots):
    """Near schedules at their limits there are feasible probes along every unknown."""
    space = MorphSpace(
        Morph(final_rad=1.0, duration_s=2.0, knots=knots),
        Limits(max_rate_rad_s=1.0, max_accel_rad_s2=8.0),
        2.0,
    )
    for point in space.drawn_back(np.random.default_rng(1).uniform(size=(6, space.dimension))):
        found = probes_of(space, point)
        assert found is not None
        probes, steps = found
        assert space.keeps(probes).all()
        np.testing.assert_allclose(probes[1:] - probes[0], np.diag(steps), atol=1e-15)
        assert np.abs(probes[0] - point).max() < 0.02


def test_trials_above_the_torque_limit_are_drawn_back_to_just_below():
    """Of schedules above the limit each ends on its ray below it, close to it."""
    bench = Bench(max_nm=440.0)
    anchor = SPACE.centre
    anchors = np.tile(anchor, (5, 1))
    points = SPACE.drawn_back(LATE + np.random.default_rng(0).normal(0.0, 0.02, (5, 4)))
    assert np.all(bench(points).peak > 440.0)
    trials = bench.evaluate(Anchored(points, anchors=bench(anchors)))
    kept = trials.points
    assert np.all(trials.peak <= 440.0)
    np.testing.assert_allclose(trials.peak, 200.0 * kept.sum(axis=1))
    np.testing.assert_allclose(trials.cost, bench(kept).cost)
    assert np.all(trials.peak > 0.9 * 440.0)
    assert SPACE.keeps(kept).all()


def test_a_schedule_that_cannot_be_drawn_back_ends_at_its_anchor():
    """Where the torque jumps at once off the anchor, the anchor is what remains, with its own numbers."""

    def cliff(points):
        near = np.abs(points - SPACE.centre).max(axis=1) < 1e-12
        peak = np.where(near, 10.0, np.nan)  # as of a diverged flight
        return Trials.known(points, np.zeros(len(points)), peak, len(points))

    anchors = SPACE.centre[None, :]
    held = Trials.known(anchors, np.array([7.0]), np.array([10.0]))
    trials = TorqueLimit(20.0).kept(SPACE, Anchored(SPACE.drawn_back(LATE[None, :]), anchors=held), cliff)
    np.testing.assert_array_equal(trials.points, anchors)
    assert trials.evaluations > 1
    assert (trials.cost[0], trials.peak[0]) == (7.0, 10.0)


def test_torque_is_lowered_to_its_least():
    """Easing the largest torque ends within 2 per cent of its minimum under the limits.

    That is found by an independent solver. The torque here is 200 times the sum of the times: the earliest
    morph that the limits allow has least.
    """
    bench = Bench()
    start = SPACE.drawn_back(LATE[None, :])
    solver = TorqueEasing(SPACE)
    state = solver.init(bench(start))
    while not solver.done(state):
        before = state.peak
        state = iterated(solver, bench, state)
        assert state.peak <= before
        assert state.peak == bench(state.point[None, :]).peak[0]
    assert SPACE.keeps(bench.flown).all()
    minimum = np.inf
    for first in (SPACE.centre, start[0]):
        found = minimize(
            lambda x: x.sum(),
            first,
            constraints={"type": "ineq", "fun": lambda x: SPACE.slack(x[None, :])[0] - HELD},
            method="SLSQP",
        )
        minimum = min(minimum, 200.0 * found.fun)
    assert state.peak == pytest.approx(minimum, rel=0.02)
