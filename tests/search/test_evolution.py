"""CMA-ES: it converges, resumes from the costs it received, and has no side effects."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from morphcore.search.evolution import EvolutionSettings, EvolutionStrategy
from morphcore.search.solver import Outcome
from tests.search.problems import ellipsoid, searched, unit_cube

SMALL = EvolutionSettings(particles=16, generations=4)


@pytest.mark.parametrize("d", [1, 2, 10])
def test_reaches_the_least_point_of_the_box(d: int) -> None:
    """On a bowl stretched a thousandfold it ends at the constrained minimum."""
    problem = unit_cube(ellipsoid, np.full(d, 0.3))
    end = searched(problem, EvolutionStrategy(problem, EvolutionSettings(16, 150), 7))[-1]
    minimum = np.full(d, 0.8)
    minimum[-1] = 1.0
    np.testing.assert_allclose(end.best, minimum, atol=1e-3)


def test_goes_on_from_what_it_was_reported() -> None:
    """Another strategy given the same costs requests the same points, even after other costs in between."""
    settings, problem = EvolutionSettings(particles=12, generations=9), unit_cube(ellipsoid, np.full(6, 0.4))
    first, other = (EvolutionStrategy(problem, settings, 3) for _ in range(2))
    state = searched(problem, first)[-2].solver
    expected = first.ask(state).points
    np.testing.assert_array_equal(other.ask(state).points, expected)
    moved = other.tell(state, Outcome(expected, np.zeros(12)))
    other.ask(moved)
    np.testing.assert_array_equal(other.ask(state).points, expected)
    np.testing.assert_array_equal(other.ask(replace(state, mean=state.mean)).points, expected)
    assert not np.array_equal(EvolutionStrategy(problem, settings, 4).ask(state).points, expected)


def test_leaves_no_trace(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """It does not depend on numpy's global generator nor move it, writes no file and prints nothing."""
    monkeypatch.chdir(tmp_path)
    found = []
    for seed in (1, 2):
        np.random.seed(seed)  # noqa: NPY002
        before = str(np.random.get_state(legacy=True))  # noqa: NPY002
        problem = unit_cube(ellipsoid, np.full(5, 0.4))
        state = searched(problem, EvolutionStrategy(problem, SMALL, 3))[-1]
        assert str(np.random.get_state(legacy=True)) == before  # noqa: NPY002
        found.append(state.solver.costs)
    np.testing.assert_array_equal(*found)
    assert not list(tmp_path.iterdir())
    assert capfd.readouterr() == ("", "")
