"""Section formulas against textbook numbers and independent series."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from morphcore.geometry.section import given_section, solid_box, torsion_constant
from morphdata.aircraft import Material, Section

WOOD = Material(density_kg_m3=500.0, youngs_modulus_pa=2.1e9, poisson_ratio=0.3, stiffness_damping_s=0.004)


@pytest.mark.parametrize(
    ("ratio", "beta"), [(1.0, 0.1406), (1.5, 0.196), (2.0, 0.229), (3.0, 0.263), (5.0, 0.291), (10.0, 0.312)]
)
def test_torsion_constant_of_the_textbook(ratio: float, beta: float) -> None:
    """J = beta a b^3: Timoshenko & Goodier (1970), table of section 109, three digits."""
    J = torsion_constant(np.array([ratio]), np.array([1.0]))
    assert J[0] / ratio == pytest.approx(beta, abs=6e-4)


@given(st.floats(0.05, 20.0))
def test_torsion_constant_solves_prandtls_equation(ratio: float) -> None:
    """J is twice the volume under Prandtl's membrane, by its double Fourier series.

    The double series falls off as 1/N^3 or so: 2e-6 is its own error at N = 400.
    """
    odd = np.arange(1, 801, 2.0)
    m, n = odd[:, None], odd[None, :]
    volume = np.sum(1 / (m**2 * n**2 * (m**2 / ratio**2 + n**2)))
    J = torsion_constant(np.array([ratio]), np.array([1.0]))
    assert J[0] == pytest.approx(256 * ratio / np.pi**6 * volume, rel=2e-6)


def test_torsion_constant_of_a_square_to_nine_digits() -> None:
    """J = 0.1405770149553 a^4 (the converged series): the terms kept are enough for 1e-9."""
    m = np.arange(1, 20001, 2.0)
    exact = 1 / 3 - 64 / np.pi**5 * np.sum(np.tanh(m * np.pi / 2) / m**5)
    J = torsion_constant(np.array([1.0]), np.array([1.0]))
    assert J[0] == pytest.approx(exact, rel=2e-9)


@given(st.floats(0.01, 10.0), st.floats(0.01, 10.0))
def test_torsion_knows_no_upright(width: float, height: float) -> None:
    """Turning a section by a right angle leaves its torsion constant."""
    w, h = np.array([width]), np.array([height])
    assert torsion_constant(w, h)[0] == torsion_constant(h, w)[0]


def test_the_reference_wing() -> None:
    """The examples' wing, 0.3 x 0.1 m of density 500 kg/m^3 and E = 2.1 GPa, computed by hand."""
    box = solid_box(WOOD, np.array([0.3]), 0.1)
    assert box.ei_flap[0] == pytest.approx(52_500.0)  # 2.1e9 x 0.3 x 0.1^3 / 12
    assert box.ei_edge[0] == pytest.approx(472_500.0)  # 2.1e9 x 0.1 x 0.3^3 / 12
    assert box.gj[0] == pytest.approx(2.1e9 / 2.6 * 0.263 * 0.3e-3, rel=2e-3)  # 3 : 1 rectangle
    assert box.mass[0] == pytest.approx(15.0)
    assert box.inertia_x[0] == pytest.approx(0.0125)
    assert box.inertia_z[0] == pytest.approx(0.1125)


@given(st.floats(0.05, 5.0), st.floats(0.01, 1.0))
def test_polar_moment_is_the_sum(chord: float, thickness: float) -> None:
    """The inertia about the span axis is the sum of the other two: the section is flat."""
    box = solid_box(WOOD, np.array([chord]), thickness)
    assert box.inertia_y[0] == pytest.approx(box.inertia_x[0] + box.inertia_z[0], rel=1e-13)


def test_isotropic_shear_modulus() -> None:
    """G = E / 2 without lateral contraction, E / 3 of an incompressible material."""
    for ratio, modulus in ((0.0, 3.0), (0.5, 2.0)):
        material = Material(density_kg_m3=1.0, youngs_modulus_pa=6.0, poisson_ratio=ratio)
        assert material.shear_modulus_pa == pytest.approx(modulus)


def test_a_given_section_is_taken_as_given() -> None:
    """Properties given outright hold at every station, whatever the chord."""
    given = Section(
        ei_flap_n_m2=1.0,
        ei_edge_n_m2=2.0,
        gj_n_m2=3.0,
        mass_per_length_kg_m=4.0,
        inertia_per_length_kg_m=[5.0, 6.0, 7.0],
    )
    section = given_section(given, np.array([0.3, 0.1]))
    for name, value in zip(
        ("ei_flap", "ei_edge", "gj", "mass", "inertia_x", "inertia_y", "inertia_z"), range(1, 8), strict=True
    ):
        np.testing.assert_array_equal(getattr(section, name), [value, value])
