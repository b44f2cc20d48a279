"""The one numba decorator of the project, with its flags explained once.

- ``error_model="numpy"``: division by zero gives inf instead of raising; the check would keep the compiler
  from turning lane loops into vector instructions.
- ``fastmath`` allows contraction to fused multiply-add and reordering of sums. ``nnan``/``ninf`` are left
  out: a diverged flight must stay recognisable as such.
- ``nogil``: heartbeats and cancellation keep running beside a kernel.
- ``cache``: compiled code is kept beside the source, or in ``NUMBA_CACHE_DIR``.
- ``boundscheck=False``: shapes are checked once, in the typed shells.

With ``NUMBA_DISABLE_JIT=1`` every kernel runs as plain Python and passes the same tests.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba

FAST_MATH = {"contract", "reassoc", "arcp", "nsz"}


def kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a numeric kernel: arrays in, ``out`` last, no allocation, no exceptions."""
    return numba.njit(error_model="numpy", fastmath=FAST_MATH, nogil=True, cache=True)(function)


def parallel_kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile the one kind of kernel that spreads blocks of lanes over threads with ``prange``."""
    return numba.njit(error_model="numpy", fastmath=FAST_MATH, nogil=True, cache=True, parallel=True)(
        function
    )


def inlined(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a short scalar function that is pasted into the kernels that call it."""
    return numba.njit(error_model="numpy", fastmath=FAST_MATH, nogil=True, inline="always")(function)
