"""Numbers that count the operations done with them, for kernels that run as plain Python."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from typing import Any

import numpy as np

Tally = Counter[str]

# what is counted, and the operators that do it: `x op y` and its reflected form
KINDS = {"add": ("add", "sub"), "multiply": ("mul",), "divide": ("truediv",)}
COMPARISONS = ("lt", "le", "gt", "ge", "eq", "ne")


class Counted(float):
    """A float whose arithmetic is counted into the tally that is current, and gives such floats again.

    Negation is not counted: on the machine it only changes a sign, mostly as part of another operation.
    """

    __slots__ = ()
    # numpy's scalars would swallow the number; so they leave the operation to it
    __array_ufunc__ = None
    __hash__ = float.__hash__
    tally: Tally = Counter()  # noqa: RUF012 - the current one, replaced by `Meter`

    def __neg__(self) -> Counted:
        return Counted(float.__neg__(self))

    def __floor__(self) -> Counted:  # type: ignore[override]
        Counted.tally["floor"] += 1
        return Counted(math.floor(float(self)))

    def sqrt(self) -> Counted:
        """Square root."""
        Counted.tally["root"] += 1
        return Counted(math.sqrt(float(self)))


def _arithmetic(kind: str, name: str) -> Callable[[Counted, Any], Counted]:
    operation = getattr(float, name)

    def counted(self: Counted, other: Any) -> Counted:
        Counted.tally[kind] += 1
        return Counted(operation(self, float(other)))

    return counted


def _comparison(name: str) -> Callable[[Counted, Any], bool]:
    operation = getattr(float, name)

    def counted(self: Counted, other: Any) -> bool:
        Counted.tally["compare"] += 1
        return bool(operation(self, float(other)))

    return counted


for _kind, _operators in KINDS.items():
    for _operator in _operators:
        for _name in (f"__{_operator}__", f"__r{_operator}__"):
            setattr(Counted, _name, _arithmetic(_kind, _name))
for _operator in COMPARISONS:
    setattr(Counted, f"__{_operator}__", _comparison(f"__{_operator}__"))


class CountedArray(np.ndarray[Any, np.dtype[Any]]):
    """An array of counted numbers: what is put in counts from then on, whatever it was."""

    def __setitem__(self, index: Any, value: Any) -> None:
        super().__setitem__(index, Counted(value) if isinstance(value, float) else value)


def counted_array(values: np.ndarray[Any, Any]) -> CountedArray:
    """The same numbers, counted."""
    out = np.empty(values.shape, dtype=object).view(CountedArray)
    flat = np.ndarray.reshape(out, -1)
    for i, value in enumerate(values.ravel().tolist()):
        flat[i] = Counted(value)
    return out


class CountedMath:
    """Stands for the module ``math`` in kernels."""

    def __getattr__(self, name: str) -> Any:
        return getattr(math, name)

    @staticmethod
    def sqrt(value: float) -> float:
        """Square root."""
        return value.sqrt() if isinstance(value, Counted) else math.sqrt(value)

    @staticmethod
    def floor(value: float) -> float:
        """Largest whole number not above; a float, as compiled code has it."""
        return value.__floor__() if isinstance(value, Counted) else math.floor(value)
