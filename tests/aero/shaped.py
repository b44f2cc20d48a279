"""Aircraft of swept, inclined and upright surfaces, and the same lattices in AeroSandbox."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np

from morphcore.geometry.aircraft import Aircraft
from tests.models.chains import aircraft_of

MATERIAL = {
    "density_kg_m3": 500.0,
    "youngs_modulus_pa": 2.1e9,
    "poisson_ratio": 0.3,
    "stiffness_damping_s": 0.004,
}


def surface(
    name: str, side: str, span_m: float, chords_m: tuple[float, float], **more: Any
) -> dict[str, Any]:
    """A fixed surface at the reference point, unless ``more`` says otherwise; without profile drag."""
    document = {
        "name": name,
        "side": side,
        "span_m": span_m,
        "root_chord_m": chords_m[0],
        "tip_chord_m": chords_m[1],
        "thickness_m": 0.05,
        "material": MATERIAL,
        "flexible": False,
    }
    if not {"hinge", "hinges"} & more.keys():
        document["position_m"] = [0.0, 0.0, 0.0]
    return document | more


def pair(name: str, span_m: float, chords_m: tuple[float, float], **more: Any) -> list[dict[str, Any]]:
    """A right surface and its mirror image, with their root in the plane of symmetry."""
    return [surface(f"{side} {name}", side, span_m, chords_m, **more) for side in ("right", "left")]


def aircraft(*surfaces: dict[str, Any]) -> Aircraft:
    """An aircraft with these surfaces and a fuselage that is symmetric."""
    fuselage = {"mass_kg": 60.0, "inertia_kg_m2": [30.0, 120.0, 140.0]}
    return aircraft_of({"name": "shaped", "fuselage": fuselage, "surfaces": list(surfaces)})


SWEPT = aircraft(*pair("wing", 3.0, (0.5, 0.3), sweep_rad=0.5, incidence_rad=0.05))
DIHEDRAL = aircraft(*pair("wing", 3.0, (0.4, 0.4), dihedral_rad=0.2))
TAILED = aircraft(
    *pair("wing", 3.0, (0.5, 0.3), sweep_rad=0.3, dihedral_rad=0.1),
    *pair("tail", 1.0, (0.3, 0.2), sweep_rad=0.4, incidence_rad=-0.04, position_m=[-3.0, 0.0, -0.4]),
)
FINNED = aircraft(
    *pair("wing", 3.0, (0.5, 0.3), sweep_rad=0.3, dihedral_rad=0.05),
    surface(
        "fin", "right", 0.8, (0.4, 0.25), sweep_rad=0.5, dihedral_rad=1.5708, position_m=[-2.5, 0.0, -0.1]
    ),
)
SHAPES = {"swept": SWEPT, "dihedral": DIHEDRAL, "tailed": TAILED, "finned": FINNED}


def of_aerosandbox(
    shape: Aircraft, alpha_rad: float, beta_rad: float, panels: tuple[int, int] = (4, 10)
) -> dict[str, Any]:
    """AeroSandbox's vortex lattice on the same planforms at 1 m/s, wake along the body's x axis.

    Forces (3,) ``F_b`` and moments ``M_b`` about the reference point, in B; density 1 kg/m^3.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # those of the other program are not ours
        import aerosandbox as asb

        wings = []
        for each in shape.surfaces:
            sections = []
            for distance, chord in ((0.0, each.root_chord_m), (each.length_m, each.tip_chord_m)):
                leading_B = each.position_m + each.rest_R_BW @ (
                    np.array([0.0, each.span_sign * distance, 0.0]) + 0.5 * chord * each.chord_W
                )
                sections.append((leading_B * [-1.0, 1.0, -1.0], chord, np.degrees(each.incidence_rad)))
            # their wings run from left to right
            wings.append(_wing(asb, sections if each.side == "right" else sections[::-1]))
        plane = asb.Airplane(wings=wings, xyz_ref=[0, 0, 0], s_ref=1.0, c_ref=1.0, b_ref=1.0)
        result = asb.VortexLatticeMethod(
            plane,
            asb.OperatingPoint(
                atmosphere=_unit_air(asb),
                velocity=1.0,
                alpha=np.degrees(alpha_rad),
                beta=np.degrees(beta_rad),
            ),
            spanwise_resolution=panels[1],
            chordwise_resolution=panels[0],
            spanwise_spacing_function=np.linspace,
            chordwise_spacing_function=np.linspace,
            align_trailing_vortices_with_wind=False,
        ).run()
    return dict(result)


def _wing(asb: Any, sections: list[Any]) -> Any:
    return asb.Wing(
        symmetric=False,
        xsecs=[
            asb.WingXSec(xyz_le=list(place), chord=chord, twist=twist, airfoil=asb.Airfoil("naca0008"))
            for place, chord, twist in sections
        ],
    )


def _unit_air(asb: Any) -> Any:
    class UnitAir(asb.Atmosphere):
        """Air of unit density."""

        def density(self) -> float:
            return 1.0

    return UnitAir()
