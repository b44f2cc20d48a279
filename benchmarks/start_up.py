"""The first minutes of a process: compiling every kernel, and a warm worker's way to its first generation."""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from numba.core import event

from benchmarks.fresh_process import in_fresh_process
from benchmarks.setting import LINKS, QUICK, RATE_SAMPLES, Bench, Figures, bench_of
from morphcore.identify import identification_from_request
from morphcore.simulate.trajectory import Trajectory
from morphcore.warming import warm_up, warm_up_further
from morphdata.identify import IdentifyRequest

COMPILING = "numba:compile"


IMPORTED_FIRST = "numpy, scipy.optimize, numba"  # what the library computes with
IMPORTS = 11  # of each, in turn


def import_times() -> Figures:
    """Computing time of importing the library, and of importing what it computes with, s; and their ratio.

    Medians of fresh processes, in turn: what else the machine does slows both.
    """
    taken: dict[str, list[float]] = {IMPORTED_FIRST: [], "morphcore": []}
    for _ in range(IMPORTS):
        for names, times in taken.items():
            program = f"import time; t = time.process_time(); import {names}; print(time.process_time() - t)"
            done = subprocess.run(
                [sys.executable, "-P", "-c", program], capture_output=True, text=True, check=True
            )
            times.append(float(done.stdout))
    packages_s, library_s = (statistics.median(times) for times in taken.values())
    return {"packages_s": packages_s, "library_s": library_s, "ratio": library_s / packages_s}


def first_generation(samples_dir: str | Path) -> Figures:
    """Times of a fresh process whose kernels are compiled, s, by the wall and of computing.

    warm_up : loads the kernels. job : from the document of a request (three flights, n = 3) to the first
    step of its search: lattice, plans, trims, flights of what is known; the first generation begins there.
    generation : that generation, the screen of an identification with default settings.
    """
    return in_fresh_process("benchmarks.start_up:job_in_this_process", str(samples_dir))


def cold_compilation() -> Figures:
    """Compile all kernels of a job on an empty cache: computing time, s, in all and by entry kernel."""
    with tempfile.TemporaryDirectory() as folder:
        return in_fresh_process(
            "benchmarks.start_up:compile_in_this_process", environment={"NUMBA_CACHE_DIR": folder}
        )


def job_in_this_process(samples_dir: str) -> Figures:
    """See `first_generation`."""
    bench = bench_of(QUICK, samples_dir)
    stages: Figures = {}

    def clocks() -> tuple[float, float]:
        return time.perf_counter(), time.process_time()

    def keep(stage: str, begin: tuple[float, float]) -> None:
        wall, computing = (now - then for now, then in zip(clocks(), begin, strict=True))
        stages[stage] = {"wall_s": wall, "computing_s": computing}

    begin = clocks()
    warm_up()
    keep("warm_up", begin)
    begin = clocks()
    steps = identification_from_request(IdentifyRequest.parse(request_of(bench))).steps()
    next(steps)
    keep("job", begin)
    begin = clocks()
    next(steps)
    keep("generation", begin)
    return stages


def request_of(bench: Bench) -> dict[str, Any]:
    """The document that a service is sent for the three flights of constant rate."""
    folder = bench.folder
    return {
        "aircraft": json.loads((folder / "aircraft.json").read_text(encoding="utf-8")),
        "flight": json.loads((folder / "flight.json").read_text(encoding="utf-8")),
        "samples": [_sample_document(bench.samples[name]) for name in RATE_SAMPLES],
        "model": {"links_per_wing": LINKS},
        "search": {"seed": 1},
    }


def _sample_document(sample: Trajectory) -> dict[str, Any]:
    columns = ("sweep_left", "sweep_right", "phi", "theta", "psi")
    return {
        "name": sample.name,
        "time_s": sample.time_s.tolist(),
        **{f"{name}_rad": getattr(sample, name).tolist() for name in columns},
    }


class CompileTimes(event.Listener):
    """Computing time of compilations, s.

    by_entry : by the kernel that Python called, with all that it calls. own : by kernel, without what other
    kernels took that it calls.
    """

    def __init__(self) -> None:
        self.by_entry: dict[str, float] = {}
        self.own: dict[str, float] = {}
        self._open: list[list[float]] = []  # begin, and what the kernels inside took

    def on_start(self, event: Any) -> None:  # noqa: ARG002
        """A compilation begins."""
        self._open.append([time.process_time(), 0.0])

    def on_end(self, event: Any) -> None:
        """It ends; what no other waits for is an entry's."""
        begin, inside = self._open.pop()
        taken = time.process_time() - begin
        kernel, arguments = event.data["dispatcher"].py_func, event.data["args"]
        lanes = f", {len(arguments[0])} lanes" if arguments and hasattr(arguments[0], "count") else ""
        name = f"{kernel.__module__}.{kernel.__name__}{lanes}"
        self.own[name] = self.own.get(name, 0.0) + taken - inside
        if self._open:
            self._open[-1][1] += taken
        else:
            self.by_entry[name] = self.by_entry.get(name, 0.0) + taken


def compile_in_this_process() -> Figures:
    """See `cold_compilation`."""
    times = CompileTimes()
    begin, wall = _computed_s(), time.perf_counter()
    with event.install_listener(COMPILING, times):
        warm_up()
        first = {"computing_s": _computed_s() - begin, "wall_s": time.perf_counter() - wall}
        warm_up_further()
    return {
        **first,
        "further_computing_s": _computed_s() - begin - first["computing_s"],
        "by_entry_s": _dearest_first(times.by_entry),
        "own_s": _dearest_first(times.own),
    }


def _computed_s() -> float:
    """Computing time of this process and of those that it started and saw end, s."""
    return sum(os.times()[:4])


def _dearest_first(times: Mapping[str, float]) -> dict[str, float]:
    return dict(sorted(times.items(), key=lambda item: -item[1]))
