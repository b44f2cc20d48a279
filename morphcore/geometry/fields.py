"""Reading typed fields out of parsed JSON, with errors that point at the field."""

from __future__ import annotations

import dataclasses
import difflib
import math
import reprlib
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from morphcore.errors import InvalidInput

Array = NDArray[np.float64]
_MISSING = object()


def _bound_broken(value: float, least: float, most: float, above: float = -math.inf) -> str:
    """The bound that a number does not keep, in the words of the service; empty when it keeps all."""
    if value <= above:
        return f"it must be more than {above:g}"
    if value < least:
        return f"it must be at least {least:g}"
    return f"it must be at most {most:g}" if value > most else ""


def whole_number(
    value: Any, name: str, *, pointer: str = "", least: float = -math.inf, most: float = math.inf
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
    broken = _bound_broken(value, least, most) if whole else "give a whole number"
    if broken:
        raise InvalidInput(f"{name} is {reprlib.repr(value)}", pointer=pointer or f"/{name}", hint=broken)
    return int(value)


class WholeNumbers:
    """Settings whose fields of the type int are Python's own, whoever gave them; anything else is refused."""

    def __post_init__(self) -> None:
        for item in dataclasses.fields(self):  # type: ignore[arg-type]  # of a subclass, which is a dataclass
            if item.type == "int":
                object.__setattr__(self, item.name, whole_number(getattr(self, item.name), item.name))


class Fields:
    """One JSON object being read; ``done`` refuses fields that nobody asked for."""

    def __init__(self, document: Any, pointer: str) -> None:
        if not isinstance(document, dict):
            raise InvalidInput("an object is needed here", pointer=pointer, hint="see the examples")
        self._document = document
        self.pointer = pointer
        self._known: set[str] = set()

    def _error(self, name: str, message: str, hint: str) -> InvalidInput:
        return InvalidInput(message, pointer=f"{self.pointer}/{name}", hint=hint)

    def has(self, name: str) -> bool:
        """Whether the field is there and not null."""
        self._known.add(name)
        return self._document.get(name) is not None

    def raw(self, name: str, default: Any = _MISSING) -> Any:
        """The field's value as it is."""
        self._known.add(name)
        value = self._document.get(name)
        if value is None:
            if default is _MISSING:
                raise self._error(name, f"{name} is missing", f"add {name}")
            return default
        return value

    def text(self, name: str, default: Any = _MISSING) -> str:
        """A string of 1 to 200 characters."""
        value = self.raw(name, default)
        if not isinstance(value, str) or not 1 <= len(value) <= 200:
            raise self._error(name, f"{name} is not a string of 1 to 200 characters", "give a short name")
        return value

    def choice(self, name: str, allowed: Sequence[str], default: Any = _MISSING) -> str:
        """One of the allowed strings."""
        value = self.raw(name, default)
        if value not in allowed:
            raise self._error(name, f"{name} is {reprlib.repr(value)}", f"use one of {', '.join(allowed)}")
        return str(value)

    def flag(self, name: str, *, default: bool) -> bool:
        """A boolean."""
        value = self.raw(name, default)
        if not isinstance(value, bool):
            raise self._error(name, f"{name} is not true or false", "write true or false")
        return value

    def number(
        self,
        name: str,
        *,
        default: Any = _MISSING,
        least: float = -math.inf,
        most: float = math.inf,
        above: float = -math.inf,
    ) -> float:
        """A finite number with least <= value <= most and value > above."""
        value = self.raw(name, default)
        return self._checked(name, value, least, most, above)

    def optional_number(
        self, name: str, *, least: float = -math.inf, most: float = math.inf, above: float = -math.inf
    ) -> float | None:
        """As ``number``, or None where the field is missing or null."""
        if not self.has(name):
            return None
        return self._checked(name, self._document[name], least, most, above)

    def _checked(self, name: str, value: Any, least: float, most: float, above: float) -> float:
        if not _is_number(value) or not _finite(value):
            raise self._error(
                name, f"{name} is {reprlib.repr(value)}, not a finite number", "give a number in SI units"
            )
        broken = _bound_broken(value, least, most, above)
        if broken:
            raise self._error(name, f"{name} is {value:g}", broken)
        return float(value)

    def whole(self, name: str, *, default: int, least: int, most: int) -> int:
        """An integer with least <= value <= most; 3.0 is one, as in JSON Schema."""
        return whole_number(
            self.raw(name, default), name, pointer=f"{self.pointer}/{name}", least=least, most=most
        )

    def series(self, name: str) -> Array:
        """A list of finite numbers as a read-only vector."""
        array = _floats(self.raw(name))
        if array.ndim != 1 or array.size == 0:
            raise self._error(name, f"{name} is not a list of numbers", "give a list of finite numbers")
        bad = np.flatnonzero(~np.isfinite(array))
        if bad.size:
            raise self._error(
                f"{name}/{bad[0]}", f"{name} holds {array[bad[0]]} at row {bad[0]}", "remove or repair it"
            )
        array.setflags(write=False)
        return array

    def vector(self, name: str, default: Any = _MISSING) -> Array:
        """Three finite numbers."""
        value = self.raw(name, default)
        return self._shaped(name, value, (3,), "give three finite numbers")

    def matrix3(self, name: str) -> Array:
        """A symmetric 3 x 3 matrix, or its diagonal."""
        value = self.raw(name)
        if isinstance(value, list) and len(value) == 3 and not isinstance(value[0], list):
            return np.diag(self._shaped(name, value, (3,), "give three numbers or a 3 x 3 matrix"))
        matrix = self._shaped(name, value, (3, 3), "give three numbers or a symmetric 3 x 3 matrix")
        if not np.allclose(matrix, matrix.T):
            raise self._error(name, f"{name} is not symmetric", "give a symmetric 3 x 3 matrix")
        return matrix

    def _shaped(self, name: str, value: Any, shape: tuple[int, ...], hint: str) -> Array:
        array = _floats(value)
        if array.shape != shape or not np.all(np.isfinite(array)):
            raise self._error(name, f"{name} does not hold {shape} finite numbers", hint)
        array.setflags(write=False)
        return array

    def child(self, name: str) -> Fields:
        """A nested object."""
        return Fields(self.raw(name), f"{self.pointer}/{name}")

    def optional_child(self, name: str) -> Fields:
        """A nested object, empty where the field is missing."""
        return Fields(self.raw(name, {}), f"{self.pointer}/{name}")

    def children(self, name: str, *, at_least: int = 0) -> Iterator[Fields]:
        """A list of nested objects."""
        value = self.raw(name)
        if not isinstance(value, list) or len(value) < at_least:
            raise self._error(name, f"{name} is not a list of at least {at_least}", "give a list of objects")
        return (Fields(item, f"{self.pointer}/{name}/{i}") for i, item in enumerate(value))

    def done(self) -> None:
        """Refuse fields that were not read: a misspelt option must not be ignored silently."""
        for name in self._document:
            if name not in self._known:
                near = difflib.get_close_matches(name, self._known, n=1)
                hint = (
                    f"did you mean {near[0]}?" if near else f"known fields: {', '.join(sorted(self._known))}"
                )
                escaped = str(name).replace("~", "~0").replace("/", "~1")  # RFC 6901, section 3
                raise self._error(escaped, f"{str(name)[:60]} is not a known field", hint)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float | np.integer | np.floating) and not isinstance(value, bool)


def _finite(value: float) -> bool:
    try:
        return math.isfinite(value)
    except OverflowError:  # a whole number of hundreds of digits
        return False


def _floats(value: Any) -> Array:
    """Nested lists of numbers as an array, nulls as NaN; empty where anything else is in them.

    numpy would read numbers out of strings and truth values.
    """
    try:
        if np.array(value).dtype.kind in "bSU":
            return np.array([])
        return np.array(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        return np.array([])
