"""Spread jobs on very many workers, in virtual time."""

from __future__ import annotations

import pytest

from tests.benchmarks.thousand_workers import Plan, simulate


def test_lost_leases_cost_time_but_no_result() -> None:
    """Twenty workers, one chunk in five lost: only what was lost is flown again, to the result of one worker.

    A second run gives the same figures: they come from the plan alone.
    """
    plan = Plan(workers=20, jobs=2, owners=2, chunks=8, generations=2, lost=0.2)
    figures = simulate(plan)
    assert figures.same
    assert figures.failed == 0
    assert figures.lost > 0
    assert figures.claims == plan.jobs * plan.chunks * plan.generations + figures.lost
    assert simulate(plan) == figures


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_a_thousand_workers() -> None:
    """A thousand workers, one chunk in ten lost: no job fails, one flight in eight is wasted at most.

    Each chunk flies 1 / (1 - 0.1) times on average, so one flight in ten is wasted; the rest is chance.
    """
    plan = Plan(lost=0.1, generations=3)
    figures = simulate(plan)
    print(figures.line())
    assert figures.same
    assert figures.failed == 0
    assert figures.claims == plan.jobs * plan.chunks * plan.generations + figures.lost
    assert figures.wasted < 1 / 8
