"""Threads: how many the kernels use, and one only for the linear algebra beside them."""

from __future__ import annotations

from contextlib import AbstractContextManager
from functools import cache

import numba
from threadpoolctl import ThreadpoolController


def use_threads(count: int) -> None:
    """Let the calling thread's kernels run on so many threads, at most those that numba was started with."""
    most = int(numba.config.NUMBA_NUM_THREADS)  # type: ignore[attr-defined]
    numba.set_num_threads(max(1, min(count, most)))


def one_blas_thread() -> AbstractContextManager[object]:
    """Keep BLAS to one thread inside the block.

    Its matrices here are small, its threads would fight with the kernels', and its sums would depend on their
    number in the last bits: the same seed must give the same answer everywhere.
    """
    limit: AbstractContextManager[object] = _controller().limit(limits=1, user_api="blas")
    return limit


@cache
def _controller() -> ThreadpoolController:
    return ThreadpoolController()
