"""Python wrappers of kernels that only kernels call."""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType, SimpleNamespace
from typing import Any

import numba
from numba.core.dispatcher import Dispatcher


def from_python(kernel: Callable[..., Any]) -> Callable[..., Any]:
    """A kernel as Python can call it."""

    def enter(*arguments: Any) -> Any:
        return kernel(*arguments)

    return numba.njit(enter)


def module_from_python(module: ModuleType) -> SimpleNamespace:
    """A module of kernels with a Python wrapper of each."""
    return SimpleNamespace(
        **{
            name: from_python(value) if isinstance(value, Dispatcher) else value
            for name, value in vars(module).items()
            if not name.startswith("__")
        }
    )
