"""Threads of the compiled kernels."""

from __future__ import annotations

import numba


def use_threads(count: int) -> None:
    """Let the calling thread's kernels run on so many threads, at most those that numba was started with."""
    most = int(numba.config.NUMBA_NUM_THREADS)  # type: ignore[attr-defined]
    numba.set_num_threads(max(1, min(count, most)))
