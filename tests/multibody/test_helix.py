"""Twists and forces inside an element, against products of matrix exponentials and their quadrature."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm, solve

from morphcore.frames import skew
from morphcore.multibody.kernels import helix as helix_kernels
from morphcore.multibody.kernels.helix import TERMS
from tests.kernels import module_from_python

helix = module_from_python(helix_kernels)

RNG = np.random.default_rng(17)


def bracket(d: np.ndarray) -> np.ndarray:
    """ad(d) as a matrix, from its definition."""
    matrix = np.zeros((6, 6))
    matrix[:3, :3] = matrix[3:, 3:] = skew(d[:3])
    matrix[3:, :3] = skew(d[3:])
    return matrix


def tangent(d: np.ndarray) -> np.ndarray:
    """T(d) by its series in plain matrices."""
    total, term = np.eye(6), np.eye(6)
    for k in range(1, 40):
        term = -term @ bracket(d) / (k + 1)
        total = total + term
    return total


@pytest.mark.parametrize("angle", [1e-6, 0.05, 0.29, 0.31, 1.4])
@pytest.mark.parametrize("s", [0.0, 0.2, 0.5, 1.0])
def test_the_map_is_that_of_the_helix(angle: float, s: float) -> None:
    """Ad(exp s d)^-1 V_a + s T(s d) d', with d' from both nodes' twists, by matrix series; to rounding."""
    d, V_a, V_b = RNG.normal(size=6), RNG.normal(size=6), RNG.normal(size=6)
    d[:3] *= angle / np.linalg.norm(d[:3])
    d_rate = solve(tangent(d), V_b - expm(-bracket(d)) @ V_a)
    expected = expm(-s * bracket(d)) @ V_a + s * tangent(s * d) @ d_rate
    blocks, found = np.empty((2, 3, 3)), np.empty(6)
    helix.helix_map(d, s, helix.helix_series(s)[0], blocks)
    helix.helix_twist(V_a, V_b, blocks, found)
    np.testing.assert_allclose(found, expected, atol=2e-12)
    # power does not depend on where it is counted
    force, inner, outer = RNG.normal(size=6), np.zeros(6), np.zeros(6)
    helix.subtract_helix_force(force, blocks, inner, outer)
    assert -(inner @ V_a + outer @ V_b) == pytest.approx(force @ found, rel=1e-12)


def test_coefficients_have_their_derivatives() -> None:
    """First and second derivatives by z are those of central differences."""
    series, z, h = helix.helix_series(0.3)[0], -1.1, 1e-3
    at = [helix.helix_coefficients(series, z + k * h, TERMS) for k in (-1, 0, 1)]
    for i in range(2):
        slope = (at[2][i] - at[0][i]) / (2.0 * h)
        curvature = (at[2][i] - 2.0 * at[1][i] + at[0][i]) / h**2
        assert at[1][2 + i] == pytest.approx(slope, rel=1e-5)
        assert at[1][4 + i] == pytest.approx(curvature, rel=1e-4)
