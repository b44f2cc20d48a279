"""Benchmarks of this machine: speed, operations, memory, start, all beside what they must hold.

Everything in one run (run.py), each figure in its own module, interleaved where figures are compared.
"""

from __future__ import annotations

from morphcore.bench.machine import processor_name
from morphcore.bench.run import SECTIONS, run_benchmarks
from morphcore.bench.setting import Effort, example_samples_dir
from morphcore.bench.swarm import benchmark_swarm
from morphcore.bench.table import benchmark_table

__all__ = [
    "SECTIONS",
    "Effort",
    "benchmark_swarm",
    "benchmark_table",
    "example_samples_dir",
    "processor_name",
    "run_benchmarks",
]
