"""The speed that the project promises, on the machine at hand (figures: `morphid bench`)."""

from __future__ import annotations

import pytest

from benchmarks.run import run_benchmarks
from benchmarks.setting import Effort

PROMISED = 3000.0  # times real time per core
SWARM = Effort(particles=2500, rounds=1, singles=3, links=(3,), refinement=50)
TRIES = 3  # a machine shared with others is slow at times; what it can do shows in its best


@pytest.mark.slow
@pytest.mark.timed
def test_a_swarm_flies_three_thousand_times_faster_than_real_time() -> None:
    """2,500 models of three links a wing through the three flights of constant rate, lattice included.

    On one core, at the shipped step, whose error on the four example flights is below 1e-4 rad.
    """
    best = 0.0
    for _ in range(TRIES):
        figures = run_benchmarks(effort=SWARM, sections=("batch", "step_error"))
        best = max(best, figures["batch"]["real_time_factor_per_core"])
        assert figures["batch"]["untrimmed"] == 0
        assert figures["step_error"]["worst_rad"] < 1e-4
        if best >= PROMISED:
            break
    print(f"{best:,.0f} times real time per core")
    assert best >= PROMISED
