"""The aircraft: a rigid fuselage and lifting surfaces, hinged or fixed (``examples/aircraft.json``)."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field

from morphdata.base import Angle, Document, Length, Position, Text

HINGE_RANGE_RAD = 1.3  # either way, where a hinge does not say
MAX_SURFACES = 16

EXAMPLE_MATERIAL: dict[str, Any] = {
    "density_kg_m3": 500.0,
    "youngs_modulus_pa": 2.1e9,
    "poisson_ratio": 0.3,
    "stiffness_damping_s": 0.004,
}


def _example_wing(side: str, y_m: float) -> dict[str, Any]:
    return {
        "name": f"{side} wing",
        "side": side,
        "span_m": 3.0,
        "chord_m": 0.3,
        "thickness_m": 0.1,
        "material": EXAMPLE_MATERIAL,
        "profile_drag": 0.01,
        "hinge": {"position_m": [0.0, y_m, 0.0], "axis": "z"},
        "flexible": True,
    }


EXAMPLE_AIRCRAFT: dict[str, Any] = {
    "name": "reference sweep-morphing aircraft",
    "fuselage": {"shape": "box", "length_m": 5.0, "width_m": 0.7, "height_m": 0.5, "density_kg_m3": 500.0},
    "surfaces": [_example_wing("right", 0.35), _example_wing("left", -0.35)],
}

Inertia = Annotated[float, Field(ge=-1e12, le=1e12)]
Row3 = Annotated[list[Inertia], Field(min_length=3, max_length=3)]
Stiffness = Annotated[float, Field(gt=0.0, le=1e15)]


class Fuselage(Document):
    """A rigid body: a box of uniform density, or mass and inertia given outright."""

    shape: Literal["box"] | None = Field(
        default=None, description="Only a name for the four numbers of a box."
    )
    length_m: Length | None = None
    width_m: Length | None = None
    height_m: Length | None = None
    density_kg_m3: Annotated[float, Field(gt=0.0, le=20_000.0)] | None = None
    mass_kg: Annotated[float, Field(gt=0.0, le=1e7)] | None = Field(
        default=None, description="Instead of a density; needs `inertia_kg_m2`."
    )
    inertia_kg_m2: (
        Annotated[list[Inertia], Field(min_length=3, max_length=3)]
        | Annotated[list[Row3], Field(min_length=3, max_length=3)]
        | None
    ) = Field(default=None, description="About the centre of mass, body axes: three diagonal terms or 3 x 3.")
    centre_of_mass_m: Position | None = Field(
        default=None, description="From the reference point, body axes."
    )


class Material(Document):
    """An isotropic material."""

    density_kg_m3: float = Field(gt=0.0, le=30_000.0)
    youngs_modulus_pa: float = Field(gt=0.0, le=2e12)
    poisson_ratio: float = Field(default=0.3, gt=-1.0, le=0.5)
    stiffness_damping_s: float = Field(
        default=0.0, ge=0.0, le=10.0, description="Damping as a multiple of stiffness, c = beta k."
    )


class Section(Document):
    """Section properties given outright, instead of those of a solid box."""

    ei_flap_n_m2: Stiffness
    ei_lag_n_m2: Stiffness
    gj_n_m2: Stiffness
    mass_per_length_kg_m: float = Field(gt=0.0, le=1e5)
    inertia_per_length_kg_m: list[Annotated[float, Field(ge=0.0, le=1e6)]] = Field(
        min_length=3, max_length=3, description="About x, y, z of the section's centre of mass."
    )


class Hinge(Document):
    """A revolute joint with prescribed motion: z sweeps, x folds, y changes incidence."""

    position_m: Position = Field(
        description="From the fuselage reference point, body axes (forward, right, down)."
    )
    axis: Literal["x", "y", "z"]
    min_rad: Angle = Field(
        default=-HINGE_RANGE_RAD, description="Least angle; samples beyond it are refused."
    )
    max_rad: Angle = Field(
        default=HINGE_RANGE_RAD, description="Greatest angle; samples beyond it are refused."
    )


class Surface(Document):
    """A lifting surface, hinged (it morphs) or fixed (a tail)."""

    name: Text
    side: Literal["right", "left"]
    span_m: Length
    chord_m: Annotated[float, Field(gt=0.0, le=50.0)] | None = Field(
        default=None, description="Uniform chord, or the chord where root or tip is not given."
    )
    root_chord_m: Annotated[float, Field(gt=0.0, le=50.0)] | None = None
    tip_chord_m: Annotated[float, Field(gt=0.0, le=50.0)] | None = None
    thickness_m: Annotated[float, Field(gt=0.0, le=10.0)]
    material: Material
    section: Section | None = None
    elastic_axis_offset_m: Annotated[float, Field(ge=-50.0, le=50.0)] = Field(
        default=0.0, description="Elastic axis aft of mid-chord, m; negative: forward of it."
    )
    mass_axis_offset_m: Annotated[float, Field(ge=-50.0, le=50.0)] = Field(
        default=0.0,
        description="Line of the sections' centres of mass aft of mid-chord, m; negative: forward of it.",
    )
    profile_drag: Annotated[float, Field(ge=0.0, le=2.0)] = 0.0
    hinge: Hinge | None = None
    position_m: Position | None = Field(
        default=None, description="Root of a fixed surface, which has no hinge."
    )
    flexible: bool = True


class Aircraft(Document):
    """A fuselage with its lifting surfaces."""

    model_config = ConfigDict(json_schema_extra={"examples": [EXAMPLE_AIRCRAFT]})

    name: Text = "aircraft"
    fuselage: Fuselage
    surfaces: list[Surface] = Field(min_length=1, max_length=MAX_SURFACES)
