"""Number of floating-point operations of one step of one flight: the same on every machine.

The kernels run as plain Python on numbers that count (counted.py). Seconds depend on the machine and on who
else uses it; these figures depend on the source alone, so a change that costs ten per cent shows as just
that. What the compiler makes of the operations shows in kernel_alone.py.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import wraps
from types import ModuleType
from typing import Any

import numpy as np

from benchmarks.counted import Counted, CountedMath, Tally, counted_array
from benchmarks.entry_points import flight_kernels, kernel_modules, python_kernels, replaced
from benchmarks.setting import Bench, Figures
from morphcore.identify.cost import fly_attitudes, sample_cases, shared_trims
from morphcore.models.equivalent import chain_model, physical_guess
from morphcore.simulate import batch
from morphcore.simulate.trajectory import Trajectory

LATTICE_ROOM = "morphcore.aero."  # whatever kernels lie elsewhere belong to the structural part
ARITHMETIC = ("add", "multiply", "divide", "root")  # a comparison or a floor is none
ALL_LINKS = tuple(range(1, 9))
# two flights: both wings alike, and one wing alone; at the sweep rate of an example flight
RATE_RAD_S = 0.5
SWEEPS = {"symmetric": (RATE_RAD_S, RATE_RAD_S), "asymmetric": (RATE_RAD_S, 0.0)}
ROWS_S = (0.0, 0.01, 0.02)  # of the sample that is flown, spaced as those of the examples


@dataclass
class Meter:
    """Operations by the kernel that did them, itself and not what it called.

    by_kernel : "module.function" -> kind -> count.
    """

    by_kernel: dict[str, Tally] = field(default_factory=dict)

    def measured(self, name: str, function: Callable[..., Any]) -> Callable[..., Any]:
        """The function, its operations counted under a name."""

        @wraps(function)
        def call(*arguments: Any, **named: Any) -> Any:
            caller, Counted.tally = Counted.tally, self.by_kernel.setdefault(name, Counter())
            try:
                return function(*arguments, **named)
            finally:
                Counted.tally = caller

        return call

    def parts(self) -> dict[str, Tally]:
        """Sums over the lattice's kernels and over all others."""
        sums: dict[str, Tally] = {"lattice": Counter(), "structure": Counter()}
        for name, tally in self.by_kernel.items():
            sums["lattice" if name.startswith(LATTICE_ROOM) else "structure"].update(tally)
        return sums


def operations(bench: Bench, links: tuple[int, ...] = ALL_LINKS) -> Figures:
    """Operations of one flight, per simulated second: sweep -> links -> part -> kind, and their total.

    Per second and not per step, so that a longer step is worth what it saves.
    """
    return {sweep: {str(n): flight_operations(bench, n, sweep) for n in links} for sweep in SWEEPS}


def structural_growth(found: Figures) -> float:
    """Cost of the most expensive further link over that of the second one, structural part only.

    1 where cost grows linearly: a first link, which has no gimbal, is cheaper than the others.
    """
    largest = 0.0
    for by_links in found.values():
        totals = [by_links[n]["structure"]["total"] for n in sorted(by_links, key=int)]
        further = np.diff(totals) / np.diff(sorted(map(int, by_links)))
        largest = max(largest, float(further.max() / further[0]))
    return largest


def flight_operations(bench: Bench, links: int, sweep: str = "symmetric") -> dict[str, dict[str, int]]:
    """Operations of one flight per simulated second: "structure" and "lattice" -> kind -> count."""
    seconds = ROWS_S[-1] - ROWS_S[0]
    return {
        part: summed({kind: round(count / seconds) for kind, count in tally.items()})
        for part, tally in flight_meter(bench, links, sweep).parts().items()
    }


def summed(tally: Mapping[str, int]) -> dict[str, int]:
    """A tally with the total of its arithmetic."""
    total = sum(tally.get(kind, 0) for kind in ARITHMETIC)
    return {**{kind: tally[kind] for kind in sorted(tally) if tally[kind]}, "total": total}


def flight_meter(bench: Bench, links: int, sweep: str) -> Meter:
    """Fly a short sample with one model of counting numbers, as an identification flies it."""
    model = chain_model(bench.aircraft, bench.flight, links)
    time_s, (left, right) = np.array(ROWS_S), SWEEPS[sweep]
    level = np.zeros_like(time_s)
    drives = {"sweep_left": left * time_s, "sweep_right": right * time_s}
    sample = Trajectory("counted", time_s, drives, level, level, level)
    guess, cases = physical_guess(model), sample_cases(model, [sample])
    case, found = next(iter(shared_trims(model, guess, cases, "trim")))
    fly_attitudes(model, guess, case, found)  # compiles, which must not meet the Python kernels
    meter = Meter()
    with counting(meter):
        fly_attitudes(model, guess, case, found)
    if not meter.by_kernel:
        raise RuntimeError("the flight passed no kernel of simulate/batch.py: count at its new entry point")
    return meter


@contextmanager
def counting(meter: Meter) -> Iterator[None]:
    """Within, flights of simulate/batch.py are also flown by plain Python kernels on counting numbers.

    Every kernel's name in every module of kernels is given its Python function instead of the compiled one;
    compiled flights still run as well, so that callers get real numbers.
    """
    kernels = python_kernels()
    changes: list[tuple[ModuleType, str, object]] = []
    for module in kernel_modules():
        for name, value in vars(module).items():
            if id(value) in kernels:
                python = kernels[id(value)]
                changes.append((module, name, meter.measured(_full_name(python), python)))
            elif value is math:
                changes.append((module, name, CountedMath()))
    for name, value in flight_kernels().items():
        changes.append((batch, name, _also_counted(meter, kernels[id(value)], value)))
    with replaced(changes):
        yield


def _also_counted(
    meter: Meter, python: Callable[..., Any], compiled: Callable[..., Any]
) -> Callable[..., Any]:
    counted = meter.measured(_full_name(python), python)

    def call(*arguments: Any) -> Any:
        counted(*(_counted(argument) for argument in arguments))
        return compiled(*arguments)

    return call


def _counted(argument: Any) -> Any:
    if isinstance(argument, np.ndarray) and argument.dtype == np.float64:
        return counted_array(argument)
    return Counted(argument) if isinstance(argument, float) else argument


def _full_name(function: Callable[..., Any]) -> str:
    return f"{function.__module__}.{function.__name__}"
