"""The numba decorators of the project, with their flags explained once.

- ``error_model="numpy"``: division by zero gives inf instead of raising; the check would keep the compiler
  from turning lane loops into vector instructions.
- ``fastmath`` contains no flag that changes rounding. With contraction to fused multiply-add, the last bits
  of results depended on inlining, hence on whether code came from the compiler or its cache, without
measurable gain. ``nnan`` and ``ninf`` are omitted too: a diverged flight must stay recognisable as such.
- ``nogil``: kernels run in parallel in plain threads, and heartbeats and cancellation continue meanwhile.
- ``cache``, for entries: compiled code is kept in ``NUMBA_CACHE_DIR``, next to the source, or in a home
  folder.
- ``boundscheck=False``: shapes are checked once, in the typed interfaces.

With ``NUMBA_DISABLE_JIT=1`` every kernel runs as plain Python and passes the same tests.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import logging
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numba
from numba.core.caching import FunctionCache
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.registry import CPUDispatcher

try:
    import fcntl
except ImportError:  # not on Windows
    fcntl = None  # type: ignore[assignment]

log = logging.getLogger(__name__)

NO_CACHE = "no locator available"  # numba's message when it finds no folder for compiled code
FAST_MATH = {"nsz"}


class _PartOfEntries(JITCodeLibrary):
    """Linkable code of a kernel that only kernels call; it is optimised together with the entries.

    Numba would optimise it, with everything it calls, and generate machine code that is never run, at every
    level of the calls; that takes a quarter of the compiler's time.
    """

    def _optimize_final_module(self) -> None:
        """Leave the optimisation to the entries."""

    def _finalize_final_module(self) -> None:
        """Generate no machine code."""
        self._finalize_dynamic_globals()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:  # noqa: ARG002 - it contains no callable functions
        """Return no address, as numba does for a function without a Python wrapper."""
        return 0

    @property
    def codegen(self) -> Any:
        """Itself, for `set_env`, the only attribute that numba uses here."""
        return self

    def set_env(self, env_name: str, env: object) -> None:
        """Do nothing: the environment is for exceptions and objects, and kernels have neither."""


class _PartCompiler(Compiler):
    """Numba's compiler, writing into a `_PartOfEntries`."""

    def __init__(self, typingctx: Any, targetctx: Any, library: Any, args: Any, *rest: Any) -> None:
        super().__init__(typingctx, targetctx, library, args, *rest)
        self.state.library = _PartOfEntries(self.state.targetctx.codegen(), "kernel")


class _SharedCache(FunctionCache):
    """Numba's cache with two faults corrected.

    Numba reads the index of an entry, adds a line and writes it back: two processes that do so at once give
    both pieces of code the same file. And it considers the code of an entry current as long as the entry's
    own file is unchanged, even if the kernels compiled into it have changed.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        self._cache_file._source_stamp = (self._cache_file._source_stamp, kernel_digest())  # noqa: SLF001 - as below

    def save_overload(self, sig: Any, data: Any) -> None:
        """Save the code while holding the lock."""
        with _locked(Path(self.cache_path)):
            super().save_overload(sig, data)

    @property
    def filled(self) -> bool:
        """Whether the cache has code for this version of the source."""
        return bool(self._cache_file._load_index())  # noqa: SLF001 - a subclass


@functools.cache
def kernel_digest() -> str:
    """Digest of the source of all kernels, any of which may be compiled into an entry."""
    root = Path(__file__).parent
    sources = [root / "jit.py", root / "lanes.py", *sorted(root.glob("**/kernels/*.py"))]
    return hashlib.sha256(b"\0".join(source.read_bytes() for source in sources)).hexdigest()


@contextlib.contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Hold a folder's lock, if the file system supports locks."""
    with contextlib.ExitStack() as held:
        if fcntl is not None:
            with contextlib.suppress(OSError):
                folder.mkdir(parents=True, exist_ok=True)
                file = held.enter_context((folder / "morphcore.lock").open("w"))
                fcntl.flock(file, fcntl.LOCK_EX)
        yield


class KernelOnly(CPUDispatcher):
    """A compiled function callable only from compiled functions; a call from Python raises an error."""

    def __call__(self, *_: Any, **__: Any) -> Any:
        """Raise TypeError."""
        raise TypeError(f"{self.py_func.__name__} is called by kernels only (see tests/kernels.py)")


class Inlined(CPUDispatcher):
    """A function inlined into the kernels that call it; called from Python, it runs as Python."""

    def __call__(self, *arguments: Any) -> Any:
        """Call the decorated function."""
        return self.py_func(*arguments)


def compiled(function: Callable[..., Any], **options: Any) -> Callable[..., Any]:
    """Compile with the flags above and further ones."""
    decorate: Callable[[Callable[..., Any]], Callable[..., Any]] = numba.njit(
        error_model="numpy", fastmath=FAST_MATH, nogil=True, **options
    )
    return decorate(function)


def _part(function: Callable[..., Any], python: type[CPUDispatcher], **options: Any) -> Callable[..., Any]:
    found = compiled(
        function, no_cpython_wrapper=True, no_cfunc_wrapper=True, pipeline_class=_PartCompiler, **options
    )
    if isinstance(found, CPUDispatcher):  # else compilation is switched off
        found.__class__ = python
    return found


def kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a kernel that other kernels call: arrays in, ``out`` last, no allocation, no exceptions.

    It is cached as part of the entries that call it and has no Python wrapper: wrappers would take a seventh
    of the total compilation time. Tests make their own (tests/kernels.py).
    """
    return _part(function, KernelOnly)


def inlined(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a function to be inlined into the kernels that call it: short scalar ones, parts of a step.

    LLVM does the inlining. Numba's own ``inline="always"`` would repeat type inference in every kernel.
    """
    return _part(function, Inlined, forceinline=True)


def entry_kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a kernel that Python calls; cached if there is a folder for it."""
    found: Any = compiled(function)
    if isinstance(found, CPUDispatcher):
        try:
            vars(found)["_cache"] = _SharedCache(function)  # like cache=True, but with our own cache
        except RuntimeError as error:
            if NO_CACHE not in str(error):
                raise
            _warn_of_no_cache()
    return found


def is_kept(entry: Callable[..., Any]) -> bool | None:
    """Whether the cache holds compiled code of an entry; None if nothing is compiled or cached."""
    cache = getattr(entry, "_cache", None)
    return cache.filled if isinstance(cache, _SharedCache) else None


@functools.cache
def _warn_of_no_cache() -> None:
    log.warning(
        "compiled kernels cannot be cached, neither next to morphcore nor in a home folder. Each "
        "process compiles them again, for minutes; set NUMBA_CACHE_DIR to a folder that this user may write"
    )
