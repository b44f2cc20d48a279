"""The group SE(3): exponential and logarithm against matrix series, coefficients against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

from morphcore.frames import skew
from morphcore.multibody.kernels import se3 as se3_kernels
from tests.kernels import module_from_python

se3 = module_from_python(se3_kernels)

RNG = np.random.default_rng(5)
ANGLES = (1e-9, 1e-4, 0.03, 0.4, 1.4)  # rad: below, at and above the switches between series and closed forms


def a_twist(angle: float) -> np.ndarray:
    """A logarithm that turns by ``angle``."""
    d = RNG.normal(size=6)
    d[:3] *= angle / np.linalg.norm(d[:3])
    return d


def hat(d: np.ndarray) -> np.ndarray:
    """The 4 x 4 matrix of a logarithm."""
    matrix = np.zeros((4, 4))
    matrix[:3, :3] = skew(d[:3])
    matrix[:3, 3] = d[3:]
    return matrix


def pose(d: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """exp(d) by the kernel."""
    R, x = np.empty((3, 3)), np.empty(3)
    se3.exponential(d, R, x)
    return R, x


@pytest.mark.parametrize("angle", ANGLES)
def test_exponential_is_the_matrix_exponential(angle: float) -> None:
    """Rodrigues' closed form equals the series of the 4 x 4 matrix, to rounding."""
    d = a_twist(angle)
    R, x = pose(d)
    expected = expm(hat(d))
    np.testing.assert_allclose(R, expected[:3, :3], atol=1e-14)
    np.testing.assert_allclose(x, expected[:3, 3], atol=1e-14)


@pytest.mark.parametrize("angle", ANGLES)
def test_logarithm_inverts_the_exponential(angle: float) -> None:
    """log exp d = d to the digits that a rotation matrix keeps."""
    d = a_twist(angle)
    found = np.empty(6)
    assert se3.logarithm(*pose(d), found)
    np.testing.assert_allclose(found, d, atol=5e-13)


def test_a_turn_beyond_the_series_is_refused() -> None:
    """Past 1.5 rad, and at half a turn where the sine vanishes again, there is no logarithm, only False."""
    for angle in (1.6, 2.5, np.pi):
        assert not se3.logarithm(*pose(a_twist(angle)), np.empty(6))


def test_coefficients_match_the_closed_form() -> None:
    """Bullo & Murray (1995): c2 and c4 in sines and cosines, where these do not cancel."""
    for theta in (0.5, 1.0, 1.5):
        sine, cosine = np.sin(theta), np.cos(theta)
        c2 = 2.0 / theta**2 + (theta + 3.0 * sine) / (4.0 * theta * (cosine - 1.0))
        c4 = 1.0 / theta**4 + (theta + sine) / (4.0 * theta**3 * (cosine - 1.0))
        found = se3.inverse_tangent_coefficients(-(theta**2))
        np.testing.assert_allclose(found[:2], [c2, c4], rtol=1e-10)
        step = 1e-5
        ahead = se3.inverse_tangent_coefficients(-(theta**2) + step)
        behind = se3.inverse_tangent_coefficients(-(theta**2) - step)
        slopes = [(ahead[i] - behind[i]) / (2.0 * step) for i in range(2)]
        np.testing.assert_allclose(found[2:], slopes, rtol=1e-6, atol=1e-12)


def test_forces_move_as_the_transpose_of_motions() -> None:
    """Power does not depend on the frame: f . (Ad V) = (Ad^T f) . V."""
    R, x = pose(a_twist(0.7))
    V, f, moved, gathered = RNG.normal(size=6), RNG.normal(size=6), np.empty(6), np.zeros(6)
    se3.to_body(R, x, V, moved)
    se3.add_from_body(R, x, f, gathered)
    assert f @ moved == pytest.approx(gathered @ V, rel=1e-13)
