"""Rotations, against their definitions and scipy's."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from morphcore.frames import (
    euler_from_quaternion,
    euler_rates,
    quaternion_from_euler,
    rotation_from_quaternion,
    skew,
    wrap_angle,
)

ANGLES = st.floats(-3.1, 3.1)
PITCHES = st.floats(-1.5, 1.5)  # short of the singularity at pi/2
NUMBERS = st.floats(-10, 10)
VECTORS = st.tuples(NUMBERS, NUMBERS, NUMBERS).map(np.array)
LAWS = settings(deadline=None)


@LAWS
@given(ANGLES, PITCHES, ANGLES)
def test_euler_angles_come_back(phi: float, theta: float, psi: float) -> None:
    """Euler angles to quaternion and back; the sine is flat near pi/2 of pitch: digits are lost as 1/cos."""
    back = euler_from_quaternion(quaternion_from_euler(phi, theta, psi))
    np.testing.assert_allclose(back, [phi, theta, psi], rtol=0, atol=2e-15 / np.cos(theta) ** 2 + 2e-15)


@LAWS
@given(ANGLES, PITCHES, ANGLES)
def test_attitude_is_yaw_then_pitch_then_roll(phi: float, theta: float, psi: float) -> None:
    """R_NB = R_z(psi) R_y(theta) R_x(phi): Stevens, Lewis & Johnson (2016), equation 1.3-13 transposed."""
    quaternion = quaternion_from_euler(phi, theta, psi)
    scipys = Rotation.from_euler("ZYX", [psi, theta, phi])
    np.testing.assert_allclose(rotation_from_quaternion(quaternion), scipys.as_matrix(), atol=1e-14)


@LAWS
@given(st.tuples(NUMBERS, NUMBERS, NUMBERS, NUMBERS).filter(lambda q: np.linalg.norm(q) > 1e-3))
def test_a_rotation_is_orthonormal(components: tuple[float, ...]) -> None:
    """R R^T = 1 and det R = +1 for every unit quaternion; q and -q are the same attitude."""
    quaternion = np.array(components) / np.linalg.norm(components)
    R = rotation_from_quaternion(quaternion)
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-14)
    assert np.linalg.det(R) == pytest.approx(1.0, abs=1e-14)
    np.testing.assert_array_equal(rotation_from_quaternion(-quaternion), R)
    np.testing.assert_allclose(euler_from_quaternion(-quaternion), euler_from_quaternion(quaternion), atol=0)


def test_signs_of_the_angles() -> None:
    """Nose up is positive theta, right wing down positive phi, nose right positive psi."""
    nose_N = rotation_from_quaternion(quaternion_from_euler(0, 0.1, 0))[:, 0]
    right_N = rotation_from_quaternion(quaternion_from_euler(0.1, 0, 0))[:, 1]
    assert nose_N[2] < 0
    assert right_N[2] > 0
    assert rotation_from_quaternion(quaternion_from_euler(0, 0, 0.1))[1, 0] > 0


@LAWS
@given(ANGLES, st.floats(-1.3, 1.3), ANGLES, VECTORS)
def test_euler_rates_are_the_derivative(phi: float, theta: float, psi: float, omega_B: np.ndarray) -> None:
    """Angles of the attitude turned on by +-h omega differ by 2 h times the rates: R' = R skew(omega)."""
    step = 1e-5
    R = Rotation.from_euler("ZYX", [psi, theta, phi])

    def after(time: float) -> np.ndarray:
        quaternion = (R * Rotation.from_rotvec(omega_B * time)).as_quat(scalar_first=True)
        return euler_from_quaternion(quaternion)

    difference = wrap_angle(after(step) - after(-step)) / (2 * step)
    # the differences' error grows with |omega|^3 / cos(theta)^3, their round-off is 1e-16 / step
    np.testing.assert_allclose(euler_rates([phi, theta, psi], omega_B), difference, atol=1e-4, rtol=1e-6)


@LAWS
@given(st.floats(-1e4, 1e4))
def test_a_wrapped_angle_points_the_same_way(angle: float) -> None:
    """Wrapping changes an angle by whole turns into -pi..pi, and leaves it there when wrapped again."""
    wrapped = wrap_angle(angle)
    assert -np.pi <= wrapped <= np.pi
    turns = (angle - wrapped) / (2 * np.pi)
    assert turns == pytest.approx(round(float(turns)), abs=1e-11)
    assert np.cos(wrap_angle(wrapped) - wrapped) == pytest.approx(1.0, abs=1e-15)


@LAWS
@given(VECTORS, VECTORS)
def test_skew_is_the_cross_product(a: np.ndarray, b: np.ndarray) -> None:
    """The matrix of a vector does what its cross product does."""
    np.testing.assert_allclose(skew(a) @ b, np.cross(a, b), atol=1e-13)


def test_histories_broadcast() -> None:
    """A whole history of attitudes is converted as one by one."""
    rng = np.random.default_rng(0)
    euler = rng.uniform(-1.4, 1.4, size=(5, 4, 3))
    quaternions = quaternion_from_euler(euler[..., 0], euler[..., 1], euler[..., 2])
    rates = euler_rates(euler, euler)
    assert quaternions.shape == (5, 4, 4)
    np.testing.assert_allclose(euler_from_quaternion(quaternions), euler, atol=1e-14)
    np.testing.assert_array_equal(quaternions[2, 3], quaternion_from_euler(*euler[2, 3]))
    np.testing.assert_array_equal(
        rotation_from_quaternion(quaternions)[2, 3], rotation_from_quaternion(quaternions[2, 3])
    )
    np.testing.assert_array_equal(rates[2, 3], euler_rates(euler[2, 3], euler[2, 3]))
