"""Rotations between frames: quaternions internally, Euler angles (z-y-x) at the API.

``R_NB`` maps components in B (body, forward-right-down) to components in N (north-east-down): ``v_N = R_NB @
v_B``. Quaternions are ``(w, x, y, z)`` and describe ``R_NB``. All functions broadcast over leading axes.
Source: Stevens, Lewis & Johnson (2016), section 1.3 and 1.8.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def quaternion_from_euler(phi: ArrayLike, theta: ArrayLike, psi: ArrayLike) -> Array:
    """Unit quaternion of R_NB, shape (..., 4), from roll, pitch and yaw in rad."""
    half_phi, half_theta, half_psi = (np.asarray(a, dtype=np.float64) / 2 for a in (phi, theta, psi))
    c1, s1 = np.cos(half_phi), np.sin(half_phi)
    c2, s2 = np.cos(half_theta), np.sin(half_theta)
    c3, s3 = np.cos(half_psi), np.sin(half_psi)
    return np.stack(
        [
            c1 * c2 * c3 + s1 * s2 * s3,
            s1 * c2 * c3 - c1 * s2 * s3,
            c1 * s2 * c3 + s1 * c2 * s3,
            c1 * c2 * s3 - s1 * s2 * c3,
        ],
        axis=-1,
    )


def euler_from_quaternion(quaternion: ArrayLike) -> Array:
    """Roll, pitch, yaw in rad, shape (..., 3); phi and psi in (-pi, pi], theta in [-pi/2, pi/2]."""
    w, x, y, z = np.moveaxis(np.asarray(quaternion, dtype=np.float64), -1, 0)
    phi = np.arctan2(2 * (w * x + y * z), w * w - x * x - y * y + z * z)
    theta = np.arcsin(np.clip(2 * (w * y - x * z), -1.0, 1.0))
    psi = np.arctan2(2 * (w * z + x * y), w * w + x * x - y * y - z * z)
    return np.stack([phi, theta, psi], axis=-1)


def euler_from_rotation(R_NB: ArrayLike) -> Array:
    """Roll, pitch, yaw in rad, shape (..., 3), of rotations (..., 3, 3); ranges as above."""
    R = np.asarray(R_NB, dtype=np.float64)
    phi = np.arctan2(R[..., 2, 1], R[..., 2, 2])
    theta = np.arcsin(np.clip(-R[..., 2, 0], -1.0, 1.0))
    psi = np.arctan2(R[..., 1, 0], R[..., 0, 0])
    return np.stack([phi, theta, psi], axis=-1)


def rotation_from_quaternion(quaternion: ArrayLike) -> Array:
    """R_NB, shape (..., 3, 3), of a unit quaternion."""
    w, x, y, z = np.moveaxis(np.asarray(quaternion, dtype=np.float64), -1, 0)
    rows = [
        [w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def euler_rates(euler: ArrayLike, omega_B: ArrayLike) -> Array:
    """Time derivatives of (phi, theta, psi), shape (..., 3), rad/s, from body rates p, q, r.

    Stevens, Lewis & Johnson (2016), equation 1.4-4; singular at theta = +-pi/2.
    """
    phi, theta, _ = np.moveaxis(np.asarray(euler, dtype=np.float64), -1, 0)
    p, q, r = np.moveaxis(np.asarray(omega_B, dtype=np.float64), -1, 0)
    lateral = q * np.sin(phi) + r * np.cos(phi)
    return np.stack(
        [p + np.tan(theta) * lateral, q * np.cos(phi) - r * np.sin(phi), lateral / np.cos(theta)], axis=-1
    )


def wrap_angle(angle: ArrayLike) -> Array:
    """The same angle in [-pi, pi), rad."""
    return (np.asarray(angle, dtype=np.float64) + np.pi) % (2 * np.pi) - np.pi


def skew(v: ArrayLike) -> Array:
    """Cross-product matrix of a 3-vector: ``skew(a) @ b == cross(a, b)``."""
    x, y, z = np.asarray(v, dtype=np.float64)
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
