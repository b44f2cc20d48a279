"""Every method on problems whose answer is known: it arrives, stays in the box, and resumes to the bit."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from morphcore.errors import InvalidInput
from morphcore.search.evolution import EvolutionSettings, EvolutionStrategy
from morphcore.search.hybrid import SCREENING, Hybrid
from morphcore.search.least_squares import LeastSquares
from morphcore.search.methods import METHODS, method
from morphcore.search.prior import FixedPrior
from morphcore.search.run import UNFINISHED, Search, SearchState
from morphcore.search.solver import Outcome, Solver
from morphcore.search.swarm import ParticleSwarm, SwarmSettings
from tests.search.problems import Formula, bowl, content, ellipsoid, searched, through_bytes, unit_cube

GUESS = np.full(4, 0.5)
Make = Callable[[Formula], Solver[Any, Any]]


def hybrid(problem: Formula, good_cost: float = 1e-9) -> Hybrid:
    """A small hybrid."""
    return Hybrid(
        LeastSquares(problem, 6), candidates=8, starts=3, spread=0.2, good_cost=lambda: good_cost, seed=2
    )


MAKERS: dict[str, Make] = {
    "pso": lambda problem: ParticleSwarm(problem, SwarmSettings(30, 40), 2),
    "cma": lambda problem: EvolutionStrategy(problem, EvolutionSettings(12, 60), 2),
    "least_squares": lambda problem: LeastSquares(problem, 20),
    "hybrid": hybrid,
}


def wavy(points: np.ndarray) -> np.ndarray:
    """Residuals that a descent from the guess cannot bring to zero: it ends in a valley of its own."""
    return np.concatenate([points - 0.3, 0.3 + 0.3 * np.sin(25.0 * points)], axis=1)


@pytest.mark.parametrize("make", MAKERS.values(), ids=MAKERS.keys())
def test_finds_the_bottom_of_a_bowl(make: Make) -> None:
    """Each comes within 1 per cent of the box of a quadratic's minimum, and says what that costs."""
    problem = unit_cube(bowl, GUESS)
    end = searched(problem, make(problem))[-1]
    np.testing.assert_allclose(end.best, 0.3, atol=0.01)
    assert end.best_cost == pytest.approx(np.sum((end.best - 0.3) ** 2), abs=1e-15)
    assert end.flights == problem.seen.shape[0]
    assert end.flights == 1 + sum(row["particles"] for row in end.history)


@pytest.mark.parametrize("make", MAKERS.values(), ids=MAKERS.keys())
def test_stays_in_the_box(make: Make) -> None:
    """Every point of a search whose minimum lies beyond a face of the box is inside of it."""
    problem = unit_cube(ellipsoid, GUESS)
    best = searched(problem, make(problem))[-1].best
    assert problem.seen.min() >= 0.0
    assert problem.seen.max() <= 1.0
    assert best[-1] > 0.9


@pytest.mark.parametrize("make", MAKERS.values(), ids=MAKERS.keys())
def test_resumes_from_every_state_to_the_bit(make: Make) -> None:
    """Cut off after any step, written to bytes and read by another solver, it ends in the same state."""
    problem = unit_cube(wavy, GUESS)
    states = searched(problem, make(problem))
    whole = content(states[-1])
    for state in states[:: max(1, len(states) // 6)][:-1]:
        assert content(searched(problem, make(problem), through_bytes(state))[-1]) == whole


@pytest.mark.parametrize("make", MAKERS.values(), ids=MAKERS.keys())
def test_the_best_only_gets_better_and_progress_rises(make: Make) -> None:
    """Costs fall, the fraction rises to one, and every step has its row."""
    problem = unit_cube(wavy, GUESS)
    states = searched(problem, make(problem))
    costs = [state.best_cost for state in states]
    assert costs == sorted(costs, reverse=True)
    search = Search(problem, make(problem))
    fractions = [search.fraction(state) for state in states]
    assert fractions == sorted(fractions)
    assert (fractions[-1], max(fractions[:-1])) == (1.0, pytest.approx(UNFINISHED, abs=1.0))
    assert [row["generation"] for row in states[-1].history] == list(range(len(states)))


@pytest.mark.parametrize("make", MAKERS.values(), ids=MAKERS.keys())
def test_tasks_evaluated_elsewhere_are_the_search_itself(make: Make) -> None:
    """If a step needs costs only, receiving them leads to the same state as the loop."""
    problem = unit_cube(wavy, GUESS)
    states = searched(problem, make(problem))
    requested = 0
    for before, after in itertools.pairwise(states):
        search = Search(problem, make(problem))
        task = search.task(through_bytes(before))
        if task is None:
            assert before.history[-1] != after.history[-1]
            continue
        requested += 1
        cost = np.concatenate([problem.evaluate(replace(task, points=p), None).cost for p in task.parts(2)])
        reported = search.tell(through_bytes(before), Outcome(task.points, cost, None, cost.size), 1.0)
        assert content(reported) == content(after)
        assert reported.wall_s == before.wall_s + 1.0
    assert Search(problem, make(problem)).task(states[-1]) is None
    assert (requested > 0) == (make is not MAKERS["least_squares"])


def test_the_second_descent_comes_only_where_the_first_leaves_much() -> None:
    """Candidates are screened once, and only if the fit is poor; what was found before is kept."""
    problem = unit_cube(wavy, GUESS)
    alone = searched(problem, LeastSquares(problem, 6))[-1]
    poor, good = (searched(problem, hybrid(problem, cost))[-1] for cost in (1e-9, 10.0))
    phases = [[row["phase"] for row in state.history] for state in (poor, good)]
    assert [listed.count(SCREENING) for listed in phases] == [1, 0]
    assert poor.best_cost <= good.best_cost == alone.best_cost


def test_a_prior_settles_what_the_residuals_do_not_see() -> None:
    """A coordinate without influence goes to the prior's point; the cost that is reported is without it."""
    problem = Formula(lambda x: x[:, :1] - 0.3, np.full(2, -5.0), np.full(2, 5.0), np.array([2.0, 3.0]))
    end = searched(problem, LeastSquares(problem, 20, FixedPrior(np.array([0.3, 1.0]), np.full(2, 0.01))))[-1]
    np.testing.assert_allclose(end.best, [0.3, 1.0], atol=1e-3)
    assert end.best_cost == pytest.approx((end.best[0] - 0.3) ** 2, abs=1e-12)


def test_nothing_to_search_for_is_over_at_once() -> None:
    """A problem without coordinates is evaluated once."""
    problem = Formula(lambda x: np.ones((x.shape[0], 3)), np.zeros(0), np.zeros(0), np.zeros((1, 0)))
    for make in MAKERS.values():
        (only,) = searched(problem, make(problem))
        assert only.best_cost == 3.0


def test_an_unknown_method_is_refused() -> None:
    """With the names of those that there are, a room's own included."""
    with pytest.raises(InvalidInput) as caught:
        method("magic", unit_cube(bowl, GUESS), None, {"own": METHODS["pso"]})
    assert caught.value.pointer == "/search/method"
    assert set(caught.value.hint.removeprefix("choose one of ").split(", ")) >= {"cma", "own", "pso"}


def test_a_state_before_the_first_evaluation_can_be_stored() -> None:
    """A search that was only begun resumes as well."""
    problem = unit_cube(bowl, GUESS)
    states = [
        searched(problem, hybrid(problem), state) for state in (SearchState(), through_bytes(SearchState()))
    ]
    assert content(states[0][-1]) == content(states[1][-1])
    assert states[0][-1].prepared == "prepared"
