"""Twists between the nodes of an element, and the virtual work of forces there.

On the helix H_a exp(s d) the twist at s is V_a + P (V_b - V_a) for any motion of the nodes, with P(s, d) the
function g(x) = (1 - e^(-s x)) / (1 - e^(-x)) of x = ad(d): with P_a and P_b the maps of both nodes' twists,
P_b = s T(s d) T(d)^-1 and P_a = e^(-s ad) - P_b e^(-ad) = 1 - P_b, as e^(-s x) - g e^(-x) = 1 - g. Twists are
in node axes and in the section's own axes, so time derivatives are those of the components.

Powers of ad above the second need no further brackets. With W = w~, N = v~ of d = [w; v], z = -|w|^2 and m =
w . v, W^3 = z W, and ad^k has W^k in its blocks on the diagonal and below them the derivative of W^k along N.
So with alpha(z), beta(z) the odd and even part of g's series,

    P = s + alpha ad + beta ad^2 - 2 m E (alpha' ad + beta' ad^2),

where E moves the rotational rows to the linear ones and a prime is the derivative by z.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from morphcore.jit import kernel

TERMS = 13  # terms of each series in z: (1.5 / 2 pi)^26 is below rounding at `se3.LARGEST_ANGLE`
TERMS_SMALL = 6  # (0.3 / 2 pi)^12 is
SMALL = 0.09  # rad^2


def helix_series(fractions: ArrayLike) -> NDArray[np.float64]:
    """Coefficients (k, TERMS, 2) of alpha and beta in powers of z for fractions s (k,) of an element."""
    s = np.asarray(fractions, dtype=np.float64).reshape(-1)
    count = 2 * TERMS + 1
    below = np.ones(count)  # of (1 - e^-x) / x
    above = np.empty((count, s.size))  # of (1 - e^(-s x)) / x
    above[0] = s
    for n in range(1, count):
        below[n] = -below[n - 1] / (n + 1)
        above[n] = -above[n - 1] * s / (n + 1)
    quotient = np.empty((count, s.size))
    for n in range(count):
        quotient[n] = above[n] - below[n:0:-1] @ quotient[:n]
    return np.ascontiguousarray(np.stack([quotient[1::2], quotient[2::2]], axis=-1).transpose(1, 0, 2))


@kernel
def helix_terms(z):
    """Number of terms of the series down to rounding."""
    return TERMS_SMALL if z > -SMALL else TERMS


@kernel
def helix_coefficients(series, z, terms):
    """alpha, beta and their first and second derivatives by z from one section's series (TERMS, 2)."""
    a, a1, a2, b, b1, b2 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(terms - 1, -1, -1):
        a2 = a2 * z + a1
        a1 = a1 * z + a
        a = a * z + series[k, 0]
        b2 = b2 * z + b1
        b1 = b1 * z + b
        b = b * z + series[k, 1]
    return a, b, a1, b1, 2.0 * a2, 2.0 * b2


@kernel
def helix_map(d, s, series, out):
    """Blocks of P = [[X, 0], [Y, X]]: X in out[0], Y in out[1], (2, 3, 3)."""
    w0, w1, w2, v0, v1, v2 = d[0], d[1], d[2], d[3], d[4], d[5]
    z = -(w0 * w0 + w1 * w1 + w2 * w2)
    m = w0 * v0 + w1 * v1 + w2 * v2
    a, b, a1, b1, _, _ = helix_coefficients(series, z, helix_terms(z))
    a1, b1 = -2.0 * m * a1, -2.0 * m * b1
    for i in range(3):
        for j in range(3):
            square = d[i] * d[j]  # W^2 = w w^T + z, N W + W N = v w^T + w v^T - 2 m
            mixed = d[3 + i] * d[j] + d[i] * d[3 + j]
            out[0, i, j] = b * square
            out[1, i, j] = b * mixed + b1 * square
        out[0, i, i] += s + b * z
        out[1, i, i] += b1 * z - 2.0 * m * b
    out[0, 0, 1] -= a * w2
    out[0, 0, 2] += a * w1
    out[0, 1, 0] += a * w2
    out[0, 1, 2] -= a * w0
    out[0, 2, 0] -= a * w1
    out[0, 2, 1] += a * w0
    out[1, 0, 1] -= a * v2 + a1 * w2
    out[1, 0, 2] += a * v1 + a1 * w1
    out[1, 1, 0] += a * v2 + a1 * w2
    out[1, 1, 2] -= a * v0 + a1 * w0
    out[1, 2, 0] -= a * v1 + a1 * w1
    out[1, 2, 1] += a * v0 + a1 * w0


@kernel
def helix_twist(inner, outer, blocks, out):
    """Twist (6,) of a section from those of its nodes, with the blocks of `helix_map`."""
    for i in range(3):
        turning, moving = inner[i], inner[3 + i]
        for j in range(3):
            turn, move = outer[j] - inner[j], outer[3 + j] - inner[3 + j]
            turning += blocks[0, i, j] * turn
            moving += blocks[1, i, j] * turn + blocks[0, i, j] * move
        out[i], out[3 + i] = turning, moving


@kernel
def subtract_helix_force(force, blocks, inner, outer):
    """Subtract a section's force vector (6,), shared between its nodes (possibly the same), from theirs."""
    for j in range(3):
        moment, push = 0.0, 0.0
        for i in range(3):
            moment += blocks[0, i, j] * force[i] + blocks[1, i, j] * force[3 + i]
            push += blocks[0, i, j] * force[3 + i]
        outer[j] -= moment
        outer[3 + j] -= push
        inner[j] -= force[j] - moment
        inner[3 + j] -= force[3 + j] - push
