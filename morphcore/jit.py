"""The numba decorators of the project, with their flags explained once.

- ``error_model="numpy"``: division by zero gives inf instead of raising; the check would keep the compiler
  from turning lane loops into vector instructions.
- ``fastmath`` holds nothing that changes a rounding. With contraction to fused multiply-add, results depended
  in their last bits on what had been inlined into what, hence on whether code came from the compiler or its
  cache; and it gained nothing measurable. ``nnan`` and ``ninf`` are left out too: a diverged flight must stay
  recognisable as such.
- ``nogil``: kernels run side by side in plain threads, and heartbeats and cancellation go on beside them.
- ``cache``, of entries: compiled code is kept in ``NUMBA_CACHE_DIR``, beside the source, or in a home folder.
- ``boundscheck=False``: shapes are checked once, in the typed shells.

With ``NUMBA_DISABLE_JIT=1`` every kernel runs as plain Python and passes the same tests.
"""

from __future__ import annotations

import functools
import logging
from collections.abc import Callable
from typing import Any

import numba
from numba.core.registry import CPUDispatcher

log = logging.getLogger(__name__)

NO_CACHE = "no locator available"  # numba's words where it finds no folder for compiled code
FAST_MATH = {"nsz"}
WITHOUT_DOORS = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}


def compiled(function: Callable[..., Any], **options: Any) -> Callable[..., Any]:
    """Compile with the flags above and some more."""
    decorate: Callable[[Callable[..., Any]], Callable[..., Any]] = numba.njit(
        error_model="numpy", fastmath=FAST_MATH, nogil=True, **options
    )
    return decorate(function)


class WithoutDoor(CPUDispatcher):
    """A compiled function that compiled functions call. Python has no way in and is told so."""

    def __call__(self, *_: Any, **__: Any) -> Any:
        """Refuse."""
        raise TypeError(f"{self.py_func.__name__} is called by kernels only (see tests/kernels.py)")


def kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a kernel that other kernels call: arrays in, ``out`` last, no allocation, no exceptions.

    It is cached as part of the entries that call it, and has no door for Python: doors would take a seventh
    of the time to compile them all. Tests make their own (tests/kernels.py).
    """
    found = compiled(function, **WITHOUT_DOORS)
    if isinstance(found, CPUDispatcher):  # else compilation is switched off
        found.__class__ = WithoutDoor
    return found


def entry_kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a kernel that Python calls; cached where there is a folder to keep it in."""
    try:
        return compiled(function, cache=True)
    except RuntimeError as error:
        if NO_CACHE not in str(error):
            raise
        _warn_of_no_cache()
        return compiled(function)


@functools.cache
def _warn_of_no_cache() -> None:
    log.warning(
        "compiled kernels cannot be kept: they fit neither beside morphcore nor in a home folder. Each "
        "process compiles anew, for minutes; set NUMBA_CACHE_DIR to a folder that this user may write"
    )


def inlined(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a function that is pasted into the kernels that call it: short scalar ones, parts of a step."""
    return compiled(function, inline="always")
