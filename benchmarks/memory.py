"""Memory of one generation of a swarm over the three flights, beyond a process that has warmed up."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.fresh_process import in_fresh_process
from benchmarks.setting import LINKS, QUICK, RATE_SAMPLES, Figures, bench_of
from morphcore.identify.cost import costs, sample_cases
from morphcore.models.equivalent import chain_model
from morphcore.paper.computation import benchmark_swarm
from morphcore.simulate.trajectory import Trajectory
from morphcore.warming import warm_up

STATUS, FORGET = Path("/proc/self/status"), Path("/proc/self/clear_refs")
WARM = 64  # models of the warm-up's generation: enough that every buffer of the library has been seen
MEGABYTE = 1024.0  # kB
# flights of the examples, and longer ones with as many rows to compare, or with more.
# Eight times: the peak of a process differs by a tenth between runs, twice as long would drown in that
LENGTHS = {
    "as they are": (1, 1),
    "eight times as long": (8, 1),
    "eight times as long, twice the rows": (8, 2),
}


def swarm_memory(samples_dir: str | Path, particles: int) -> Figures:
    """Peak of resident memory in MB beyond the warmed-up process, by length of the flights."""
    if not FORGET.exists():
        return {"skipped": "this system does not report peak memory"}
    peaks = {
        name: in_fresh_process("benchmarks.memory:generation_memory", str(samples_dir), particles, *how)
        for name, how in LENGTHS.items()
    }
    return {
        "particles": particles,
        "interpreter_mb": peaks["as they are"]["before_mb"],
        "beyond_mb": {name: found["beyond_mb"] for name, found in peaks.items()},
    }


def generation_memory(samples_dir: str, particles: int, longer: int, more_rows: int) -> Figures:
    """Fly one generation in this process and see its peak: MB before, and beyond that."""
    bench = bench_of(QUICK, samples_dir)
    model = chain_model(bench.aircraft, bench.flight, LINKS)
    warm_up()
    samples = [stretched(bench.samples[name], longer, more_rows) for name in RATE_SAMPLES]
    costs(model, benchmark_swarm(model, WARM), sample_cases(model, samples[:1]), "trim")
    FORGET.write_text("5", "ascii")  # resets the recorded peak
    before = _status("VmRSS")
    costs(model, benchmark_swarm(model, particles), sample_cases(model, samples), "trim")
    return {"before_mb": before, "beyond_mb": _status("VmHWM") - before}


def stretched(sample: Trajectory, longer: int, more_rows: int) -> Trajectory:
    """The same motion, slowed down and with more rows by the given factors."""
    rows = more_rows * (sample.time_s.size - 1) + 1
    at = np.linspace(sample.time_s[0], sample.time_s[-1], rows)
    begin = sample.time_s[0]
    columns = {name: np.interp(at, sample.time_s, getattr(sample, name)) for name in ("phi", "theta", "psi")}
    drives = {name: np.interp(at, sample.time_s, values) for name, values in sample.drives.items()}
    return replace(sample, time_s=begin + longer * (at - begin), drives=drives, extra={}, **columns)


def _status(name: str) -> float:
    lines = STATUS.read_text(encoding="utf-8").splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith(f"{name}:")) / MEGABYTE
