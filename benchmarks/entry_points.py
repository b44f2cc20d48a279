"""Entry points of compiled kernels used by simulate/batch.py, where they can be timed or counted."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import ModuleType
from typing import Any

from benchmarks.setting import Clock
from morphcore.simulate import batch

Function = Callable[..., Any]


@contextmanager
def replaced(changes: list[tuple[ModuleType, str, object]]) -> Iterator[None]:
    """Within, some names of some modules mean something else."""
    before = [(module, name, getattr(module, name)) for module, name, _ in changes]
    try:
        for module, name, new in changes:
            setattr(module, name, new)
        yield
    finally:
        for module, name, old in before:
            setattr(module, name, old)


def python_kernels() -> dict[int, Function]:
    """Python function of every kernel, by the kernel's identity (itself where nothing is compiled)."""
    found: dict[int, Function] = {}
    for module in kernel_modules():
        for value in list(vars(module).values()):
            python = getattr(value, "py_func", value)
            if callable(python) and getattr(python, "__module__", None) == module.__name__:
                found[id(value)] = python
    return found


def kernel_modules() -> list[ModuleType]:
    """All loaded modules of kernels."""
    return [
        module
        for name, module in list(sys.modules.items())
        if name == "morphcore.lanes" or (name.startswith("morphcore.") and ".kernels." in name)
    ]


def flight_kernels() -> dict[str, Function]:
    """The kernels that simulate/batch.py calls, by their names there."""
    kernels = python_kernels()
    return {name: value for name, value in vars(batch).items() if id(value) in kernels}


class KernelClock:
    """Seconds spent inside the kernels that simulate/batch.py calls, on one thread."""

    def __init__(self, clock: Clock) -> None:
        self.seconds = 0.0
        self._clock = clock

    @contextmanager
    def running(self) -> Iterator[None]:
        """Within, they are timed."""
        with replaced([(batch, name, self._timed(kernel)) for name, kernel in flight_kernels().items()]):
            yield

    def _timed(self, kernel: Function) -> Function:
        def call(*arguments: Any) -> Any:
            begin = self._clock()
            found = kernel(*arguments)
            self.seconds += self._clock() - begin
            return found

        return call
