"""A flight's cost in operations: exact, the same everywhere, and not more than it was."""

from __future__ import annotations

import json
import math
from collections import Counter
from functools import cache, wraps
from typing import Any

import numpy as np
import pytest

from benchmarks import operations
from benchmarks.counted import Counted, CountedMath, counted_array
from benchmarks.operations import flight_operations, structural_growth
from benchmarks.setting import QUICK, bench_of
from morphcore.aero.kernels import loads
from morphcore.multibody.kernels import articulated
from morphcore.simulate.kernels import step
from tests.benchmarks.operations_baseline import BASELINE, RENEW, counts, grown


@cache
def counted() -> dict[str, Any]:
    """Counts of this source."""
    return counts()


@pytest.fixture
def tally(monkeypatch: pytest.MonkeyPatch) -> Counter[str]:
    """A tally of its own."""
    own: Counter[str] = Counter()
    monkeypatch.setattr(Counted, "tally", own)
    return own


def test_no_flight_costs_more_operations_than_it_did() -> None:
    """No kind of operation of any flight has grown by more than 10 per cent over the committed counts."""
    worse = grown(json.loads(BASELINE.read_text()), counted())
    assert not worse, "\n".join([*worse, f"If that is intended, update the counts: {RENEW}"])


def test_structure_grows_linearly_with_the_links() -> None:
    """Every further link costs the structural part what the second one does, and never more."""
    for sweep, by_links in counted().items():
        totals = [by_links[str(n)]["structure"]["total"] for n in range(1, 9)]
        print(sweep, totals)
        # per simulated second: counts of a short flight, rounded once for each kind of operation
        np.testing.assert_allclose(np.diff(totals), totals[1] - totals[0], rtol=1e-4)
    assert structural_growth(counted()) == pytest.approx(1.0, abs=1e-4)


@pytest.mark.parametrize(
    ("kernel", "part"),
    [
        (articulated.congruence, "structure"),
        (loads.lane_product, "lattice"),
        (step.joint_forces, None),  # three per cent of the structural part: growth that is allowed
    ],
)
def test_the_guard_sees_a_kernel_that_does_its_work_twice(
    monkeypatch: pytest.MonkeyPatch, kernel: Any, part: str | None
) -> None:
    """A kernel doubled on purpose is reported in its own part, and nothing else is."""
    bench = bench_of(QUICK)
    before = {"flight": flight_operations(bench, 2)}
    assert not grown(before, before)
    original = getattr(kernel, "py_func", kernel)

    @wraps(original)
    def twice(*arguments: Any) -> Any:
        original(*arguments)
        return original(*arguments)

    kernels = operations.python_kernels()
    doubled = {key: twice if python is original else python for key, python in kernels.items()}
    monkeypatch.setattr(operations, "python_kernels", lambda: doubled)
    worse = grown(before, {"flight": flight_operations(bench, 2)})
    print("\n".join(worse))
    assert {line.split("/")[1] for line in worse} == ({part} if part else set())


def test_a_guard_without_its_kind_in_the_baseline_tells_it() -> None:
    """A kind of operation that was not there before, such as a first square root, counts as growth."""
    assert grown({"structure": {"add": 100}}, {"structure": {"add": 110, "root": 1}}) == [
        "structure/root: 1 operations a simulated second, 0 before"
    ]
    assert len(grown({"structure": {"add": 100}}, {"structure": {"add": 111}})) == 1


def test_counted_numbers_count_and_calculate(tally: Counter[str]) -> None:
    """Each operation is counted once, whatever stands on the other side, and gives what floats give."""
    a, plain, array = Counted(2.25), 3.0, np.float64(4.0)
    results = [a + plain, plain - a, array * a, a / array, 1 / a, a - 1, CountedMath.sqrt(a)]
    assert [float(x) for x in results] == [5.25, 0.75, 9.0, 0.5625, 1 / 2.25, 1.25, 1.5]
    assert all(type(x) is Counted for x in results)
    assert CountedMath.floor(-a) == math.floor(-2.25)
    assert a > 1.0
    assert dict(tally) == {
        "add": 3, "multiply": 1, "divide": 2, "root": 1, "floor": 1, "compare": 2,
    }  # fmt: skip


def test_counted_arrays_count_what_is_put_in(tally: Counter[str]) -> None:
    """A zero written into a row counts as any number there, in views too."""
    rows = counted_array(np.ones((3, 2)))
    view = rows[1:]
    view[0, 1] = 0.0
    view[0, 1] += 1.0
    rows[0, 0], rows[0, 1] = view[0, 1] * 2.0, 1.0
    assert dict(tally) == {"add": 1, "multiply": 1}
    assert rows.astype(float).tolist() == [[2.0, 1.0], [1.0, 1.0], [1.0, 1.0]]


def test_counts_are_those_of_pencil_and_paper(tally: Counter[str]) -> None:
    """R A R^T of a symmetric 3 x 3: 27 + 18 products and 18 + 12 sums."""
    python = getattr(articulated.congruence, "py_func", articulated.congruence)
    python(*(Counted(x) for x in range(15)))
    assert dict(tally) == {"multiply": 45, "add": 30}
