"""Compilation before the first flight: afterwards the kernels of both widths are in the cache."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from morphcore.threads import usable_cores

ROOT = Path(__file__).resolve().parents[2]
COMPILE = """
import json
from morphcore.simulate.compilation import compile_flights
from morphcore.simulate.kernels.batch import fly, rates_of_blocks
from morphcore.warming import warm_up

def compiled():
    return [sum(each.stats.cache_misses.values()) for each in (fly, rates_of_blocks)]

compile_flights()
before = compiled()
warm_up(1)
print(json.dumps([before, compiled()]))
"""


@pytest.mark.slow
@pytest.mark.timeout(600)
@pytest.mark.skipif(os.environ.get("NUMBA_DISABLE_JIT") == "1", reason="nothing is compiled")
@pytest.mark.skipif(usable_cores() < 2, reason="one core compiles one kernel after the other")
def test_a_second_process_compiles_the_kernels_of_one_flight(tmp_path: Path) -> None:
    """From an empty cache this process compiles each kernel once, for batches, and loads the other width."""
    ended = subprocess.run(
        [sys.executable, "-P", "-c", COMPILE],
        env=os.environ | {"NUMBA_CACHE_DIR": str(tmp_path), "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=True,
    )
    before, after = json.loads(ended.stdout.splitlines()[-1])
    assert before == after == [1, 1]
