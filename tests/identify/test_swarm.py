"""The swarm: resumable to the bit, silent, and a particle swarm."""

from __future__ import annotations

import logging
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from morphcore.identify.state import SearchState, decode, encode
from morphcore.search.swarm import SwarmSettings, SwarmState, first_swarm, next_swarm

Array = NDArray[np.float64]
SETTINGS = SwarmSettings(particles=30, generations=40)


def bowl(position: Array) -> Array:
    """A quadratic bowl with its bottom at 0.3."""
    return np.asarray(np.sum((position - 0.3) ** 2, axis=1))


def walk(state: SwarmState, generations: int) -> SwarmState:
    """Some generations on the bowl."""
    for _ in range(generations):
        state = next_swarm(state, SETTINGS, bowl(state.position))
    return state


def test_finds_the_bottom_of_a_bowl() -> None:
    """Forty generations of thirty particles come within 1 per cent of the box of a quadratic's minimum."""
    found = walk(first_swarm(SETTINGS, np.full(4, 0.5), seed=2), 40)
    np.testing.assert_allclose(found.leader, 0.3, atol=0.01)


def test_resumes_to_the_bit_through_bytes() -> None:
    """A swarm that was written to a checkpoint and read back goes on exactly like one that was not."""
    begun = walk(first_swarm(SETTINGS, np.full(4, 0.5), seed=2), 7)
    state = SearchState("swarm", begun.leader, 1.0, swarm=begun)
    again = decode(encode(state)).swarm
    assert again is not None
    one, other = walk(begun, 9), walk(again, 9)
    np.testing.assert_array_equal(one.position, other.position)
    np.testing.assert_array_equal(one.velocity, other.velocity)


def test_leaves_the_global_generator_alone() -> None:
    """pyswarms draws from numpy's global generator; who else uses it sees nothing of that."""
    np.random.seed(11)  # noqa: NPY002 - the generator in question
    expected = np.random.random(3)  # noqa: NPY002
    np.random.seed(11)  # noqa: NPY002
    walk(first_swarm(SETTINGS, np.full(4, 0.5), seed=2), 3)
    np.testing.assert_array_equal(np.random.random(3), expected)  # noqa: NPY002


def test_stays_in_the_unit_cube_and_starts_at_the_guess() -> None:
    """Positions never leave the bounds, and the first particle is the physical guess."""
    guess = np.array([0.1, 0.9, 0.5, 0.5])
    state = first_swarm(SETTINGS, guess, seed=4)
    np.testing.assert_array_equal(state.position[0], guess)
    for _ in range(20):
        state = next_swarm(state, SETTINGS, bowl(state.position))
        assert np.all((state.position >= 0.0) & (state.position <= 1.0))


def test_is_silent(tmp_path: Path) -> None:
    """Importing and moving the swarm touches no logger and writes no file (pyswarms alone does)."""
    code = (
        "import logging, numpy as np; from morphcore.search.swarm import *; s = SwarmSettings(4, 2);"
        "state = first_swarm(s, np.full(3, 0.5), 1); next_swarm(state, s, np.ones(4));"
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
