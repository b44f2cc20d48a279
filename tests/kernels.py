"""Doors for Python to kernels that only kernels call."""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType, SimpleNamespace
from typing import Any

import numba
from numba.core.dispatcher import Dispatcher


def door(kernel: Callable[..., Any]) -> Callable[..., Any]:
    """A kernel as Python can call it."""

    def enter(*arguments: Any) -> Any:
        return kernel(*arguments)

    return numba.njit(enter)


def doors(module: ModuleType) -> SimpleNamespace:
    """A module of kernels with a door to each of them."""
    return SimpleNamespace(
        **{
            name: door(value) if isinstance(value, Dispatcher) else value
            for name, value in vars(module).items()
            if not name.startswith("__")
        }
    )
