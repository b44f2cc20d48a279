"""Lanes: the innermost, contiguous axis of every hot array is the particle index, in blocks of one width.

A kernel's loops ``for l in range(len(lanes))`` become vector instructions if the compiler knows the row
length of an array. Numba passes shapes as run-time values, so each kernel starts with ``if not_in_lanes(...,
lanes): return``: after that line the row length is a known constant. (Without it the same loop runs two to
three times slower.)

The width is a *type*: ``lanes`` is a tuple of as many zeros, and numba compiles a kernel once per length. So
one source yields the kernels of a batch (``TOGETHER`` lanes) and those of a single flight (one lane), which
would otherwise carry fifteen idle lanes. Both round identically: a flight is bit-identical alone and in any
batch.
"""

from __future__ import annotations

import math

from morphcore.jit import inlined

# two 512-bit or four 256-bit vectors: long enough to amortise loop overhead, short enough for the cache
TOGETHER = 16
ALONE = 1

TWO_OVER_PI = 2.0 / math.pi
# pi/2 in two parts (Cody & Waite): the first has trailing zeros, so that n * first is exact
HALF_PI_HIGH = 1.5707963267341256
HALF_PI_LOW = 6.077100506506192e-11


@inlined
def sine_cosine(angle: float) -> tuple[float, float]:
    """Sine and cosine, accurate to 4e-16 for |angle| < 1e5 rad, without a call or a branch.

    Range reduction after Cody & Waite (1980), minimax polynomials on [-pi/4, pi/4] after Moshier's Cephes.
    """
    n = math.floor(angle * TWO_OVER_PI + 0.5)
    r = (angle - n * HALF_PI_HIGH) - n * HALF_PI_LOW
    z = r * r
    s = r + r * z * (
        -1.66666666666666307295e-1
        + z
        * (
            8.33333333332211858878e-3
            + z
            * (
                -1.98412698295895385996e-4
                + z
                * (
                    2.75573136213857245213e-6
                    + z * (-2.50507477628578072866e-8 + z * 1.58962301576546568060e-10)
                )
            )
        )
    )
    c = (
        1.0
        - 0.5 * z
        + z
        * z
        * (
            4.16666666666665929218e-2
            + z
            * (
                -1.38888888888730564116e-3
                + z
                * (
                    2.48015872888517045348e-5
                    + z
                    * (
                        -2.75573141792967388112e-7
                        + z * (2.08757008419747316778e-9 - z * 1.13585365213876817300e-11)
                    )
                )
            )
        )
    )
    quadrant = n - 4.0 * math.floor(n * 0.25)
    odd = (quadrant == 1.0) or (quadrant == 3.0)
    sine = c if odd else s
    cosine = s if odd else c
    sine = -sine if quadrant >= 2.0 else sine
    cosine = -cosine if (quadrant == 1.0) or (quadrant == 2.0) else cosine
    return sine, cosine


def lane_width(particles: int) -> int:
    """Number of lanes of the blocks for a number of particles."""
    return ALONE if particles == 1 else TOGETHER


def lane_type(width: int) -> tuple[int, ...]:
    """The argument that sets a kernel's width: a tuple of that length (its elements are ignored)."""
    return (0,) * width


@inlined
def not_in_lanes(a, lanes) -> bool:
    """Whether the row length differs from the width (never; the test informs the compiler, see above)."""
    return a.shape[1] != len(lanes)
