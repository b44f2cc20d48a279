"""Whole numbers of settings that are given in Python, out of numpy too."""

from __future__ import annotations

import dataclasses
import math
import reprlib
from typing import Any

import numpy as np

from morphcore.errors import InvalidInput


def _bound_broken(value: float, minimum: float, maximum: float) -> str:
    """The bound that a number does not keep; empty when it keeps both."""
    if value < minimum:
        return f"it must be at least {minimum:g}"
    return f"it must be at most {maximum:g}" if value > maximum else ""


def whole_number(
    value: Any, name: str, *, pointer: str = "", minimum: float = -math.inf, maximum: float = math.inf
) -> int:
    """A whole number as Python's own: out of numpy's, and out of a float without a fraction.

    Raises
    ------
    InvalidInput : it is no number, a truth value, not whole, or beyond its bounds.
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
    """Settings whose fields of the type int are Python's own, whoever gave them; anything else is refused."""

    def __post_init__(self) -> None:
        for item in dataclasses.fields(self):  # type: ignore[arg-type]  # of a subclass, which is a dataclass
            if item.type == "int":
                object.__setattr__(self, item.name, whole_number(getattr(self, item.name), item.name))
