"""Search coordinates of a parameter: of order one, so that one difference step and one spread suit all.

A transform maps the values of a parameter, in SI units, to its search coordinates and back. It also defines
the shape of an interval around a value, such as a symmetric difference or a factor.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from morphcore.errors import InvalidInput

Array = NDArray[np.float64]

RATIO_RANGE = 1.5  # of the log-ratios: a share over the last one may be 4.5 times smaller or larger
HALVINGS = 50  # of the range of the log-ratios, down to rounding


class Transform(Protocol):
    """Map from m values, the last axis of an array, to d search coordinates and back."""

    def forward(self, values: Array) -> Array:
        """Search coordinates (..., d) of values (..., m)."""
        ...

    def inverse(self, x: Array) -> Array:
        """Values (..., m) at search coordinates (..., d)."""
        ...

    def box(self, low: float, high: float, count: int) -> tuple[Array, Array]:
        """Bounds (d,) of the coordinates that keep all ``count`` values between ``low`` and ``high``.

        Raises
        ------
        InvalidInput
            The bounds leave no room for the values.
        """
        ...

    def limits(self, lower: Array, upper: Array) -> tuple[Array, Array]:
        """Smallest and largest value of each, (m,), in a box of coordinates (d,)."""
        ...

    def derivative(self, values: Array) -> Array:
        """Derivative (m,), by the value, of the coordinate in which its interval is symmetric."""
        ...

    def interval(self, values: Array, half: Array) -> tuple[Array, Array]:
        """Ends (m,) of intervals of half widths (m,) in the coordinate of ``derivative``."""
        ...


@dataclass(frozen=True)
class Log:
    """A positive value, searched as its logarithm; intervals are symmetric as factors."""

    def forward(self, values: Array) -> Array:
        """Logarithms."""
        with np.errstate(divide="ignore"):  # zero becomes the lower bound of any box
            return np.log(values)

    def inverse(self, x: Array) -> Array:
        """Exponentials."""
        return np.exp(x)

    def box(self, low: float, high: float, count: int) -> tuple[Array, Array]:
        """Logarithms of the bounds."""
        return np.full(count, np.log(low)), np.full(count, np.log(high))

    def limits(self, lower: Array, upper: Array) -> tuple[Array, Array]:
        """Values at the corners."""
        return self.inverse(lower), self.inverse(upper)

    def derivative(self, values: Array) -> Array:
        """Of the logarithm."""
        return 1.0 / values

    def interval(self, values: Array, half: Array) -> tuple[Array, Array]:
        """The same factor in both directions."""
        with np.errstate(over="ignore"):
            return values * np.exp(-half), values * np.exp(half)


@dataclass(frozen=True)
class Linear:
    """A value counted in ``unit`` from ``zero``, both in the value's own SI unit."""

    unit: float
    zero: float = 0.0

    def forward(self, values: Array) -> Array:
        """Units from zero."""
        return np.asarray((values - self.zero) / self.unit)

    def inverse(self, x: Array) -> Array:
        """Values."""
        return self.zero + self.unit * x

    def box(self, low: float, high: float, count: int) -> tuple[Array, Array]:
        """Bounds in units from zero."""
        return self.forward(np.full(count, low)), self.forward(np.full(count, high))

    def limits(self, lower: Array, upper: Array) -> tuple[Array, Array]:
        """Values at the corners."""
        return self.inverse(lower), self.inverse(upper)

    def derivative(self, values: Array) -> Array:
        """One over the unit."""
        return np.full(values.shape, 1.0 / self.unit)

    def interval(self, values: Array, half: Array) -> tuple[Array, Array]:
        """The same difference in both directions."""
        width = half / self.derivative(values)
        return values - width, values + width


def equal_shares(count: int) -> Array:
    """(count,) shares that are all the same."""
    return np.full(count, 1.0 / count)


@dataclass(frozen=True)
class Shares:
    """Positive shares that sum to one, searched as log-ratios to the last one: d = m - 1.

    The additive log-ratio (Aitchison 1982): a box of the coordinates lies inside the simplex. Intervals are
    symmetric in the log-odds of a share.

    Attributes
    ----------
    nominal : callable, int -> ndarray, shape (m,)
        The shares in the middle of a box, by their number.
    ratio_range : float
        Of the log-ratios around them, in a box.
    """

    nominal: Callable[[int], Array] = equal_shares
    ratio_range: float = RATIO_RANGE

    def forward(self, values: Array) -> Array:
        """Log-ratios to the last share."""
        return np.log(values[..., :-1] / values[..., -1:])

    def inverse(self, x: Array) -> Array:
        """Shares."""
        ratios = np.concatenate([x, np.zeros((*x.shape[:-1], 1))], axis=-1)
        shares = np.exp(ratios - ratios.max(axis=-1, keepdims=True))
        return np.asarray(shares / shares.sum(axis=-1, keepdims=True))

    def box(self, low: float, high: float, count: int) -> tuple[Array, Array]:
        """Log-ratios within ``ratio_range`` of the nominal ones for which all shares stay within the bounds.

        If the nominal shares violate the bounds, the box is centred on equal shares.
        """
        if count == 1:
            return np.zeros(0), np.zeros(0)
        if not low * count < 1.0 < high * count:
            raise InvalidInput(
                f"division bounds {low:g}..{high:g} leave no room for {count} links",
                pointer="/model/bounds/division",
                hint=f"they must hold 1/{count}",
            )
        shares = self.nominal(count)
        if not low < shares.min() <= shares.max() < high:
            shares = equal_shares(count)
        centre = self.forward(shares)

        def fits(half: float) -> bool:
            smallest, largest = self.limits(centre - half, centre + half)
            return bool(smallest.min() >= low and largest.max() <= high)

        widest = self.ratio_range
        half, beyond = (widest, widest) if fits(widest) else (0.0, widest)
        for _ in range(HALVINGS):
            middle = 0.5 * (half + beyond)
            half, beyond = (middle, beyond) if fits(middle) else (half, middle)
        return centre - half, centre + half

    def limits(self, lower: Array, upper: Array) -> tuple[Array, Array]:
        """Limits of each share with all others at their opposite ends; the last share's own ratio is one."""
        low, high = np.exp(np.append(lower, 0.0)), np.exp(np.append(upper, 0.0))
        return low / (low + high.sum() - high), high / (high + low.sum() - low)

    def derivative(self, values: Array) -> Array:
        """Of the log-odds."""
        return np.asarray(1.0 / (values * (1.0 - values)))

    def interval(self, values: Array, half: Array) -> tuple[Array, Array]:
        """The same factor of the odds in both directions."""
        odds = values / (1.0 - values)
        with np.errstate(over="ignore"):
            low, high = (1.0 / (1.0 + np.exp(-sign * half) / odds) for sign in (-1.0, 1.0))
        return low, high
