"""The swarm: silent, begun at what is known, and alone with its random numbers."""

from __future__ import annotations

import logging
import os
import subprocess
import sys
from pathlib import Path

import numpy as np

from morphcore.search.run import Search, SearchState
from morphcore.search.solver import Outcome
from morphcore.search.swarm import ParticleSwarm, SwarmSettings
from tests.search.problems import Formula, bowl, searched, unit_cube

SETTINGS = SwarmSettings(particles=30, generations=40)


def test_leaves_the_global_generator_alone() -> None:
    """pyswarms draws from numpy's global generator; who else uses it sees nothing of that."""
    problem = unit_cube(bowl, np.full(4, 0.5))
    search = Search(problem, ParticleSwarm(problem, SETTINGS, 2))
    np.random.seed(11)  # noqa: NPY002 - the generator in question
    expected = np.random.random(3)  # noqa: NPY002
    np.random.seed(11)  # noqa: NPY002
    search.advance(search.advance(SearchState()))
    np.testing.assert_array_equal(np.random.random(3), expected)  # noqa: NPY002


def test_starts_at_what_is_known() -> None:
    """The first particles are the known points; the others are in the order that the problem wants."""

    class Ordered(Formula):
        def arranged(self, points: np.ndarray) -> np.ndarray:
            return np.sort(points, axis=1)

    known = np.array([[0.9, 0.1, 0.5], [0.4, 0.3, 0.2]])
    problem = Ordered(bowl, np.full(3, -1.0), np.full(3, 1.0), known)
    swarm = ParticleSwarm(problem, SETTINGS, 4)
    points = swarm.ask(swarm.init(Outcome(known, np.ones(2)))).points
    np.testing.assert_allclose(points[:2], known, atol=1e-15)
    assert np.all(np.diff(points[2:], axis=1) >= 0.0)
    assert np.ptp(points) > 1.5, "spread over the box"


def test_every_seed_is_a_swarm_of_its_own() -> None:
    """The same seed gives the same search to the bit, another seed another one."""
    problem = unit_cube(bowl, np.full(4, 0.5))
    ends = [searched(problem, ParticleSwarm(problem, SETTINGS, seed))[-1].best for seed in (1, 1, 2)]
    assert ends[0].tobytes() == ends[1].tobytes()
    assert ends[0].tobytes() != ends[2].tobytes()


def test_is_silent(tmp_path: Path) -> None:
    """Importing and moving the swarm touches no logger and writes no file (pyswarms alone does)."""
    code = (
        "import logging, numpy as np;"
        "from morphcore.search.swarm import *; from tests.search.problems import *;"
        "problem = unit_cube(bowl, np.full(3, 0.5));"
        "searched(problem, ParticleSwarm(problem, SwarmSettings(4, 2), 1));"
        "print(logging.getLogger().handlers, logging.getLogger().level)"
    )
    root = Path(__file__).resolve().parents[2]
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(root)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.strip() == f"[] {logging.WARNING}"
    assert list(tmp_path.iterdir()) == []
