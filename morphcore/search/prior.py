"""What a descent knows before any residual is computed, as residuals of its own."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Prior(Protocol):
    """What is known of a point before any residual is seen."""

    @property
    def point(self) -> Array:
        """The most likely point (d,)."""
        ...

    @property
    def first(self) -> Array:
        """Weights (d,) with which a descent begins: the cost of one unit off the point, squared."""
        ...

    def weights(self, error: Array, jacobian: Array, offset: Array, present: Array) -> Array:
        """Return the weights (d,) of the next iteration.

        Parameters
        ----------
        error, jacobian : ndarray, shape (m,) and (m, d)
            Residuals at a point, and their derivatives.
        offset : ndarray, shape (d,)
            The point less the most likely one.
        present : ndarray, shape (d,)
            The weights of the iteration before.
        """
        ...


@dataclass(frozen=True)
class FixedPrior:
    """A prior whose weights do not depend on the residuals.

    Attributes
    ----------
    point : ndarray, shape (d,)
        The most likely point.
    first : ndarray, shape (d,)
        The weights.
    """

    point: Array
    first: Array

    def weights(self, error: Array, jacobian: Array, offset: Array, present: Array) -> Array:
        """Return the weights as they are."""
        del error, jacobian, offset
        return present
