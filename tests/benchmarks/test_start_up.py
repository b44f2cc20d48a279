"""A process's first seconds."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numba.core import event

from benchmarks.fresh_process import in_fresh_process
from benchmarks.setting import EXAMPLES, QUICK, bench_of
from benchmarks.start_up import COMPILING, CompileTimes, first_generation, import_times, request_of
from morphcore.identify import identification_from_request
from morphcore.jit import compiled, kernel
from morphdata.identify import IdentifyRequest

ALLOWED_S = 0.5
ALLOWED_RATIO = 1.5


def test_a_request_of_the_benchmark_is_one_that_the_library_takes() -> None:
    """Three flights to train on, and a first step that leaves a best so far."""
    run = identification_from_request(IdentifyRequest.parse(request_of(bench_of(QUICK))))
    assert [sample.role for sample in run.samples] == ["train"] * 3
    assert next(run.steps()).best_cost > 0.0


def test_compilations_are_written_down_once_each() -> None:
    """A kernel's time holds that of what it calls; a second call compiles nothing."""

    @kernel
    def inner(x: Any) -> Any:
        return 2.0 * x

    @compiled
    def outer(x: Any) -> Any:
        return inner(x) + inner(x + 1.0)

    times = CompileTimes()
    with event.install_listener(COMPILING, times):
        assert outer(1.0) == 6.0
        assert outer(2.0) == 10.0
    (outermost,) = times.by_entry
    assert outermost.endswith("outer")
    own = times.own
    assert len(own) == 2
    assert min(own.values()) > 0.0
    np.testing.assert_allclose(sum(own.values()), times.by_entry[outermost], rtol=1e-6)


def test_a_process_that_fails_says_why() -> None:
    """The end of its error is in the exception."""
    with pytest.raises(RuntimeError, match="no_such_function"):
        in_fresh_process("benchmarks.start_up:no_such_function")


@pytest.mark.slow
@pytest.mark.timed
def test_importing_the_library_takes_little_more_than_what_it_computes_with() -> None:
    """Under one and a half times numpy, scipy.optimize and numba, in medians of fresh processes."""
    found = import_times()
    print(found)
    assert found["ratio"] < ALLOWED_RATIO


@pytest.mark.slow
@pytest.mark.timed
def test_a_warm_process_begins_its_first_generation_in_half_a_second() -> None:
    """From the document of a request, three flights, to the first reported step: seconds of computing."""
    first_generation(EXAMPLES)  # compiles, should that be needed
    found = first_generation(EXAMPLES)
    print(found)
    assert found["job"]["computing_s"] < ALLOWED_S
