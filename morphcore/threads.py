"""Threads: a pool for the kernels, and a single thread for linear algebra.

Kernels release the interpreter's lock, so plain Python threads run them in parallel. Numba's own parallel
loops would need a threading layer that survives forks and tolerates callers in several threads; plain threads
do both.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager
from functools import cache

from threadpoolctl import ThreadpoolController


class _Setting:
    """The number of threads that the kernels of this process use."""

    threads = 0


class _Here(threading.local):
    """Whether this thread belongs to the pool."""

    pooled = False


_here = _Here()


def thread_count() -> int:
    """Threads for kernels: as set by ``use_threads``, else NUMBA_NUM_THREADS, else the usable cores.

    One inside work that already runs in the pool: threads that wait for their own pool would deadlock.
    """
    if _here.pooled:
        return 1
    if _Setting.threads == 0:
        _Setting.threads = int(os.environ.get("NUMBA_NUM_THREADS", "0")) or usable_cores()
    return _Setting.threads


def usable_cores() -> int:
    """Cores that this process may run on."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # not available on every system
        return os.cpu_count() or 1


def use_threads(count: int) -> None:
    """Set the number of threads for the kernels of this process."""
    _Setting.threads = max(1, count)


def in_threads(work: Callable[[int], None], parts: int) -> None:
    """Run ``work(0)`` .. ``work(parts - 1)``, in parallel if there are threads; raise the first error."""
    threads = min(thread_count(), parts)
    if threads <= 1:
        for part in range(parts):
            work(part)
        return
    list(_pool(os.getpid(), thread_count()).map(work, range(parts)))


def one_blas_thread() -> AbstractContextManager[object]:
    """Keep BLAS to one thread inside the block.

    The matrices here are small, BLAS threads would compete with the kernels', and sums would depend on the
    number of threads in the last bits: the same seed must give the same answer everywhere.
    """
    limit: AbstractContextManager[object] = _controller().limit(limits=1, user_api="blas")
    return limit


@cache
def _pool(process: int, threads: int) -> ThreadPoolExecutor:  # noqa: ARG001 - a forked child needs a pool of its own
    return ThreadPoolExecutor(threads, thread_name_prefix="morphcore", initializer=_enter_pool)


def _enter_pool() -> None:
    _here.pooled = True


@cache
def _controller() -> ThreadpoolController:
    return ThreadpoolController()
