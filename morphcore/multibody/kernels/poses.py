"""Poses of many nodes moved by increments in their own axes."""

from __future__ import annotations

from morphcore.jit import entry_kernel
from morphcore.multibody.kernels.se3 import exponential


@entry_kernel
def move_poses(increments, R, x, scratch):
    """Multiply every pose, R (n, 3, 3) and x (n, 3), from the right by exp(increment), (n, 6).

    The product of rotations is re-orthogonalised by R (3 I - R^T R) / 2, so that rounding does not accumulate
    over a flight. ``scratch`` (7, 3).
    """
    turn, offset, turned = scratch[:3], scratch[3], scratch[4:7]
    for n in range(increments.shape[0]):
        exponential(increments[n], turn, offset)
        for i in range(3):
            x[n, i] += R[n, i, 0] * offset[0] + R[n, i, 1] * offset[1] + R[n, i, 2] * offset[2]
            for j in range(3):
                turned[i, j] = R[n, i, 0] * turn[0, j] + R[n, i, 1] * turn[1, j] + R[n, i, 2] * turn[2, j]
        for j in range(3):
            for k in range(3):
                dot = turned[0, j] * turned[0, k] + turned[1, j] * turned[1, k] + turned[2, j] * turned[2, k]
                turn[j, k] = (1.5 if j == k else 0.0) - 0.5 * dot
        for i in range(3):
            for j in range(3):
                R[n, i, j] = turned[i, 0] * turn[0, j] + turned[i, 1] * turn[1, j] + turned[i, 2] * turn[2, j]
