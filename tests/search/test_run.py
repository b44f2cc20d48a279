"""The loop of all searches: time limits, stops, and what is evaluated in any case."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from morphcore.search.run import Search, SearchState
from morphcore.search.solver import Batch
from morphcore.search.swarm import ParticleSwarm, SwarmSettings
from morphcore.stopping import Interrupted, Stop
from tests.search.problems import Formula, bowl, content, unit_cube

SETTINGS = SwarmSettings(particles=8, generations=5)


def search(problem: Formula, tick_s: float = 0.0) -> Search:
    """A swarm on a problem, by a clock that rises by a tick whenever it is read."""
    ticks = itertools.count()
    return Search(problem, ParticleSwarm(problem, SETTINGS, 1), lambda: tick_s * next(ticks))


def test_what_is_known_is_evaluated_without_any_time() -> None:
    """With a budget of nothing the first step is the last, and it has a best."""
    run = search(unit_cube(bowl, np.full(3, 0.5)))
    state = run.advance(SearchState(budget_s=0.0))
    assert state.over
    np.testing.assert_array_equal(state.best, np.full(3, 0.5))


def test_the_step_that_uses_the_time_up_is_the_last() -> None:
    """Each step takes one tick of the clock: after three the budget of three is used up."""
    run = search(unit_cube(bowl, np.full(3, 0.5)), tick_s=1.0)
    state, steps = SearchState(budget_s=3.0), 0
    while not state.over:
        state, steps = run.advance(state), steps + 1
    assert (steps, state.wall_s) == (3, 3.0)


class Slow(Formula):
    """Takes longer than there is time, from the second batch on."""

    def evaluate(self, batch: Batch, stop: Stop | None) -> object:  # type: ignore[override]
        """Wait for the stop."""
        if self.evaluated:
            assert stop is not None
            while not stop():
                pass
        return super().evaluate(batch, stop)


def test_a_step_ends_when_the_time_is_up() -> None:
    """A batch that does not end in time leaves the state before it, over."""
    problem = Slow(bowl, np.zeros(3), np.ones(3), np.full(3, 0.5))
    run = search(problem)
    first = run.advance(SearchState(budget_s=0.05))
    assert not first.over
    last = run.advance(first)
    assert last.over
    assert (last.generation, last.history) == (first.generation, first.history)


def test_a_stop_is_no_time_limit() -> None:
    """Who stops a search gets the exception, and the state before stays valid."""
    run = search(unit_cube(bowl, np.full(3, 0.5)))
    first = run.advance(SearchState(budget_s=100.0))
    before = content(first)
    for state in (SearchState(), first):
        with pytest.raises(Interrupted):
            run.advance(state, lambda: True)
    assert content(first) == before
