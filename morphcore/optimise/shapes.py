"""Shapes of a morph: batches of clamped cubic splines from 0 to 1 over unit time.

A morph of duration T from one angle to another is ``initial + change p(t / T)`` with a shape p, so that its
rate is ``change p' / T`` and its acceleration ``change p'' / T^2``. The rate is a quadratic on each piece and
the acceleration linear: their extrema, and those of the angle, are known in closed form.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SHORTEST_PIECE = 1e-9  # of the morph: spares a division by zero where knots are out of order


@dataclass(frozen=True)
class Shapes:
    """Clamped cubic splines (p of them, of k knots).

    time, value, rate : (p, k) at the knots; the rate is zero at both ends. first, last : (p, k - 1)
    acceleration at the beginning and at the end of each piece.
    """

    time: Array
    value: Array
    rate: Array
    first: Array
    last: Array

    @property
    def length(self) -> Array:
        """(p, k - 1) lengths of the pieces."""
        return _lengths(self.time)

    def turning_rate(self) -> Array:
        """(p, k - 1) the rate at its extremum inside each piece; at the piece's end if it has none."""
        bend = self.last - self.first
        turn = -self.first / np.where(bend == 0.0, 1.0, bend)  # share of the piece
        inside = (bend != 0.0) & (turn > 0.0) & (turn < 1.0)
        extreme = self.rate[:, :-1] + 0.5 * self.first * np.where(inside, turn, 0.0) * self.length
        return np.where(inside, extreme, self.rate[:, 1:])

    def turning_values(self) -> Array:
        """(p, 2 (k - 1)) the values where the rate vanishes inside a piece; a knot's value if it does not.

        Roots of ``d + a s + (b - a) s^2 / 2`` with the rate d, accelerations a, b times the length. The rate
        vanishes at both ends of the shape, which are not reversals: the first and the last piece have one
        other root each.
        """
        length = self.length
        d, a, b = self.rate[:, :-1], self.first * length, self.last * length
        bend = b - a
        discriminant = a * a - 2.0 * d * bend
        # the form of the roots that avoids cancellation (Press et al. 2007, equation 5.6.4)
        q = -(a + np.copysign(np.sqrt(np.maximum(discriminant, 0.0)), a))
        one, other = (2.0 * d, q), (q, bend)
        inner = self.value[:, 1:].copy()
        inner[:, -1] = self.value[:, -2]
        found = []
        for above, below in (one, other):
            s = np.divide(above, below, out=np.zeros_like(q), where=(below != 0.0) & (discriminant >= 0.0))
            ends = -2.0 * a[:, :1], 2.0 * d[:, -1:]
            for piece, known in zip((slice(0, 1), slice(-1, None)), ends, strict=True):
                flat = bend[:, piece]
                s[:, piece] = np.divide(known, flat, out=np.zeros_like(flat), where=flat != 0.0)
            value = self.value[:, :-1] + length * s * (d + s * (a / 2.0 + s * bend / 6.0))
            found.append(np.where((s > 0.0) & (s < 1.0), value, inner))
        return np.concatenate(found, axis=1)


def clamped_shapes(time: Array, value: Array) -> Shapes:
    """Return the splines through knots (p, k) with zero rate at both ends (de Boor 1978, chapter IV)."""
    length = _lengths(time)
    slope = np.diff(value, axis=1) / length
    rate = np.zeros_like(time)
    # equal accelerations on both sides of every knot: a tridiagonal system for the rates between the ends
    right = 3.0 * (slope[:, :-1] / length[:, :-1] + slope[:, 1:] / length[:, 1:])
    diagonal = 2.0 / length[:, :-1] + 2.0 / length[:, 1:]
    coupling = 1.0 / length[:, 1:-1]
    for i in range(1, diagonal.shape[1]):
        share = coupling[:, i - 1] / diagonal[:, i - 1]
        diagonal[:, i] -= share * coupling[:, i - 1]
        right[:, i] -= share * right[:, i - 1]
    for i in range(diagonal.shape[1] - 1, -1, -1):
        carried = coupling[:, i] * rate[:, i + 2] if i < diagonal.shape[1] - 1 else 0.0
        rate[:, i + 1] = (right[:, i] - carried) / diagonal[:, i]
    first = (6.0 * slope - 4.0 * rate[:, :-1] - 2.0 * rate[:, 1:]) / length
    last = (-6.0 * slope + 2.0 * rate[:, :-1] + 4.0 * rate[:, 1:]) / length
    return Shapes(time, value, rate, first, last)


def _lengths(time: Array) -> Array:
    return np.maximum(np.diff(time, axis=1), SHORTEST_PIECE)
