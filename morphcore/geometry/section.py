"""Cross-section properties of a lifting surface: from a solid box of material, or given explicitly."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from morphdata.aircraft import Material, Section

Array = NDArray[np.float64]

TORSION_SERIES_TERMS = 60  # odd terms of Saint-Venant's series; converged to 1e-9


@dataclass(frozen=True)
class SectionProperties:
    """Structural properties per unit span at some stations, each of shape (stations,).

    Stiffnesses EI, GJ in N m^2; mass in kg/m; inertia per length in kg m about axes through the section's
    centre of mass, parallel to the wing axes: x (chord), y (span: torsion), z (normal).
    """

    ei_flap: Array
    ei_edge: Array
    gj: Array
    mass: Array
    inertia_x: Array
    inertia_y: Array
    inertia_z: Array


def given_section(section: Section, chord: Array) -> SectionProperties:
    """Properties given explicitly, constant along the span, at stations of the given chords (stations,)."""
    ones = np.ones_like(chord)
    ix, iy, iz = section.inertia_per_length_kg_m
    return SectionProperties(
        ei_flap=section.ei_flap_n_m2 * ones,
        ei_edge=section.ei_edge_n_m2 * ones,
        gj=section.gj_n_m2 * ones,
        mass=section.mass_per_length_kg_m * ones,
        inertia_x=ix * ones,
        inertia_y=iy * ones,
        inertia_z=iz * ones,
    )


def torsion_constant(width: Array, height: Array) -> Array:
    """Saint-Venant torsion constant of a solid rectangle, m^4, shape of the inputs.

    Timoshenko & Goodier (1970), equation 109.160: J = a b^3 (1/3 - 64 b / (pi^5 a) sum tanh(n pi a / 2 b) /
    n^5).
    """
    a, b = np.maximum(width, height), np.minimum(width, height)
    n = np.arange(1, 2 * TORSION_SERIES_TERMS, 2)[:, None]
    series = np.sum(np.tanh(n * np.pi * a / (2 * b)) / n**5, axis=0)
    return np.asarray(a * b**3 * (1 / 3 - 64 * b / (np.pi**5 * a) * series))


def solid_box(material: Material, chord: Array, thickness: float) -> SectionProperties:
    """Properties of a solid rectangle ``chord`` x ``thickness`` (m), chord of shape (stations,)."""
    height = np.full_like(chord, thickness)
    mass = material.density_kg_m3 * chord * height
    return SectionProperties(
        ei_flap=material.youngs_modulus_pa * chord * height**3 / 12,
        ei_edge=material.youngs_modulus_pa * height * chord**3 / 12,
        gj=material.shear_modulus_pa * torsion_constant(chord, height),
        mass=mass,
        inertia_x=mass * height**2 / 12,
        inertia_y=mass * (chord**2 + height**2) / 12,
        inertia_z=mass * chord**2 / 12,
    )
