"""Integer settings given in Python, including numpy numbers."""

from __future__ import annotations

import dataclasses
import math
import reprlib
from typing import Any

import numpy as np

from morphcore.errors import InvalidInput


def _bound_broken(value: float, minimum: float, maximum: float) -> str:
    """The bound that a number violates; empty if it is within both."""
    if value < minimum:
        return f"it must be at least {minimum:g}"
    return f"it must be at most {maximum:g}" if value > maximum else ""


def whole_number(
    value: Any, name: str, *, pointer: str = "", minimum: float = -math.inf, maximum: float = math.inf
) -> int:
    """Convert a whole number, possibly a numpy integer or a float without a fraction, to a Python int.

    Raises
    ------
    InvalidInput : it is not a number, is a bool, is not whole, or is out of bounds.
    """
    whole = not isinstance(value, bool | np.bool_) and (
        isinstance(value, int | np.integer)
        or (isinstance(value, float | np.floating) and float(value).is_integer())
    )
    broken = _bound_broken(value, minimum, maximum) if whole else "give a whole number"
    if broken:
        raise InvalidInput(f"{name} is {reprlib.repr(value)}", pointer=pointer or f"/{name}", hint=broken)
    return int(value)


class WholeNumbers:
    """Settings whose int fields are converted to Python ints; anything else is refused."""

    def __post_init__(self) -> None:
        for item in dataclasses.fields(self):  # type: ignore[arg-type]  # of a subclass, which is a dataclass
            if item.type == "int":
                object.__setattr__(self, item.name, whole_number(getattr(self, item.name), item.name))
