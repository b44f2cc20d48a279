"""The aircraft and its flight condition, read from their JSON documents."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from morphcore.errors import InvalidInput, UnsupportedRegime
from morphcore.geometry.fields import Fields
from morphcore.geometry.section import GivenSection, Material
from morphcore.geometry.surface import DEFAULT_HINGE_RANGE_RAD, Hinge, Surface
from morphcore.shown import Shown
from morphdata.atmosphere import standard_atmosphere

Array = NDArray[np.float64]

MACH_LIMIT = 0.7  # beyond, Prandtl-Glauert's linear compressibility does not hold


@dataclass(frozen=True, repr=False)
class Fuselage(Shown):
    """A rigid body without aerodynamic force.

    ``centre_of_mass_B`` in m from the reference point; ``inertia_B`` (3, 3) in kg m^2 about the centre of
    mass.
    """

    mass_kg: float
    inertia_B: Array
    centre_of_mass_B: Array


@dataclass(frozen=True, repr=False)
class Aircraft(Shown):
    """A rigid fuselage with lifting surfaces on prescribed hinges."""

    name: str
    fuselage: Fuselage
    surfaces: tuple[Surface, ...]

    @property
    def flexible_surfaces(self) -> tuple[Surface, ...]:
        """Those that bend."""
        return tuple(s for s in self.surfaces if s.flexible)


@dataclass(frozen=True)
class Start:
    """A measured start: angle of attack (rad), constant force (N) and moment (N m) in B at its origin."""

    alpha_rad: float
    force_B: Array
    moment_B: Array


@dataclass(frozen=True, repr=False)
class Flight(Shown):
    """The flight condition: ``mach`` is None for incompressible flow, ``wind_N`` the air's velocity, m/s."""

    airspeed_m_s: float
    air_density_kg_m3: float
    gravity_m_s2: float
    altitude_m: float
    wind_N: Array
    mach: float | None
    start: Start | None

    @property
    def dynamic_pressure_pa(self) -> float:
        """q_dyn = rho V^2 / 2."""
        return 0.5 * self.air_density_kg_m3 * self.airspeed_m_s**2


def load_aircraft(path: str | Path) -> Aircraft:
    """Read an aircraft from its JSON file. Raises InvalidInput with a pointer to the field at fault."""
    return aircraft_from_document(_read_json(path))


def load_flight(path: str | Path) -> Flight:
    """Read a flight condition from its JSON file. Raises InvalidInput that points to the field at fault."""
    return flight_from_document(_read_json(path))


def aircraft_from_document(document: dict[str, Any], pointer: str = "/aircraft") -> Aircraft:
    """The aircraft that a parsed JSON document describes."""
    fields = Fields(document, pointer)
    name = fields.text("name", default="aircraft")
    fuselage = _fuselage(fields.child("fuselage"))
    surfaces = tuple(_surface(child) for child in fields.children("surfaces", at_least=1))
    fields.done()
    names = [s.name for s in surfaces]
    if len(set(names)) != len(names):
        raise InvalidInput("surface names are not unique", pointer=f"{pointer}/surfaces", hint="rename one")
    return Aircraft(name, fuselage, surfaces)


def flight_from_document(document: dict[str, Any], pointer: str = "/flight") -> Flight:
    """The flight condition that a parsed JSON document describes."""
    fields = Fields(document, pointer)
    airspeed = fields.number("airspeed_m_s", above=0.0, most=1000.0)
    altitude = fields.number("altitude_m", default=0.0, least=-1000.0, most=20_000.0)
    density = fields.optional_number("air_density_kg_m3", above=0.0, most=2.0)
    air = standard_atmosphere(altitude)
    gravity = fields.number("gravity_m_s2", default=9.80665, least=0.0, most=30.0)
    wind_N = fields.vector("wind_n_m_s", default=(0.0, 0.0, 0.0))
    mach_given = fields.raw("mach", default=None)
    if mach_given == "auto":
        mach: float | None = airspeed / air.speed_of_sound_m_s
    else:
        mach = fields.optional_number("mach", least=0.0)
    if mach is not None and mach > MACH_LIMIT:
        raise UnsupportedRegime(
            f"Mach {mach:.2f} is beyond {MACH_LIMIT}, where linear compressibility ends",
            pointer=f"{pointer}/mach",
            hint="lower the airspeed, or leave mach out for incompressible flow",
        )
    start = None
    if fields.has("start"):
        child = fields.child("start")
        start = Start(
            alpha_rad=child.number("alpha_rad", least=-0.5, most=0.5),
            force_B=child.vector("force_b_n", default=(0.0, 0.0, 0.0)),
            moment_B=child.vector("moment_b_n_m", default=(0.0, 0.0, 0.0)),
        )
        child.done()
    fields.done()
    return Flight(
        airspeed_m_s=airspeed,
        air_density_kg_m3=air.density_kg_m3 if density is None else density,
        gravity_m_s2=gravity,
        altitude_m=altitude,
        wind_N=wind_N,
        mach=mach,
        start=start,
    )


def _read_json(path: str | Path) -> dict[str, Any]:
    try:
        document = json.loads(Path(path).read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InvalidInput(f"{path} does not exist", hint="check the path") from None
    except OSError as error:
        raise InvalidInput(f"{path} cannot be read: {error.strerror}", hint="check the path") from None
    except (ValueError, RecursionError) as error:  # also of bytes that are no text, and of absurd numbers
        raise InvalidInput(f"{path} is not JSON: {error}", hint="see examples/aircraft.json") from None
    if not isinstance(document, dict):
        raise InvalidInput(f"{path} holds no JSON object", hint="see examples/aircraft.json")
    return document


def _fuselage(fields: Fields) -> Fuselage:
    fields.choice("shape", ("box",), default="box")
    centre = fields.vector("centre_of_mass_m", default=(0.0, 0.0, 0.0))
    if fields.has("mass_kg"):
        mass = fields.number("mass_kg", above=0.0, most=1e7)
        inertia = fields.matrix3("inertia_kg_m2")
        least, middle, most = np.linalg.eigvalsh(inertia)
        if least <= 0 or most > (least + middle) * (1 + 1e-9):
            raise InvalidInput(
                "no rigid body has this inertia: a principal moment is negative or above the others' sum",
                pointer=f"{fields.pointer}/inertia_kg_m2",
                hint="give the inertia about the centre of mass, products with their sign",
            )
        for name in ("length_m", "width_m", "height_m", "density_kg_m3"):
            fields.optional_number(name)
    else:
        lx, ly, lz = (fields.number(f"{n}_m", above=0.0, most=500.0) for n in ("length", "width", "height"))
        mass = fields.number("density_kg_m3", above=0.0, most=2e4) * lx * ly * lz
        inertia = np.diag([ly**2 + lz**2, lx**2 + lz**2, lx**2 + ly**2]) * mass / 12
    fields.done()
    return Fuselage(mass, inertia, centre)


def _surface(fields: Fields) -> Surface:
    chord = fields.optional_number("chord_m", above=0.0, most=50.0)
    root = fields.optional_number("root_chord_m", above=0.0, most=50.0) or chord
    tip = fields.optional_number("tip_chord_m", above=0.0, most=50.0) or root
    if root is None or tip is None:
        raise InvalidInput(
            "no chord is given",
            pointer=f"{fields.pointer}/chord_m",
            hint="give chord_m, or root_chord_m and tip_chord_m",
        )
    hinge = _hinge(fields.child("hinge")) if fields.has("hinge") else None
    position = fields.vector("position_m", default=hinge.position_m if hinge else None)
    surface = Surface(
        name=fields.text("name"),
        side=fields.choice("side", ("right", "left")),  # type: ignore[arg-type]
        span_m=fields.number("span_m", above=0.0, most=200.0),
        root_chord_m=root,
        tip_chord_m=tip,
        thickness_m=fields.number("thickness_m", above=0.0, most=10.0),
        material=_material(fields.child("material")),
        hinge=hinge,
        position_m=(float(position[0]), float(position[1]), float(position[2])),
        flexible=fields.flag("flexible", default=True),
        profile_drag=fields.number("profile_drag", default=0.0, least=0.0, most=2.0),
        section=_given_section(fields.child("section")) if fields.has("section") else None,
        elastic_axis_offset_m=fields.number("elastic_axis_offset_m", default=0.0, least=-root, most=root),
        mass_axis_offset_m=fields.number("mass_axis_offset_m", default=0.0, least=-root, most=root),
    )
    fields.done()
    return surface


def _hinge(fields: Fields) -> Hinge:
    x, y, z = fields.vector("position_m")
    low = fields.number("min_rad", default=-DEFAULT_HINGE_RANGE_RAD, least=-np.pi, most=np.pi)
    high = fields.number("max_rad", default=DEFAULT_HINGE_RANGE_RAD, least=-np.pi, most=np.pi)
    axis = fields.choice("axis", ("x", "y", "z"))
    fields.done()
    if low >= high:
        raise InvalidInput(
            "min_rad is not below max_rad", pointer=f"{fields.pointer}/min_rad", hint="swap them"
        )
    return Hinge((float(x), float(y), float(z)), axis, low, high)  # type: ignore[arg-type]


def _material(fields: Fields) -> Material:
    material = Material(
        density_kg_m3=fields.number("density_kg_m3", above=0.0, most=3e4),
        youngs_modulus_pa=fields.number("youngs_modulus_pa", above=0.0, most=2e12),
        poisson_ratio=fields.number("poisson_ratio", default=0.3, least=-0.99, most=0.5),
        stiffness_damping_s=fields.number("stiffness_damping_s", default=0.0, least=0.0, most=10.0),
    )
    fields.done()
    return material


def _given_section(fields: Fields) -> GivenSection:
    ix, iy, iz = fields.vector("inertia_per_length_kg_m")
    if min(ix, iz) < 0 or iy <= 0:
        raise InvalidInput(
            "inertia_per_length_kg_m has a negative entry, or none about the span",
            pointer=f"{fields.pointer}/inertia_per_length_kg_m",
            hint="give the moments about the section's centre of mass: chord axis, span axis, normal",
        )
    section = GivenSection(
        ei_flap_n_m2=fields.number("ei_flap_n_m2", above=0.0),
        ei_lag_n_m2=fields.number("ei_lag_n_m2", above=0.0),
        gj_n_m2=fields.number("gj_n_m2", above=0.0),
        mass_per_length_kg_m=fields.number("mass_per_length_kg_m", above=0.0),
        inertia_per_length_kg_m=(float(ix), float(iy), float(iz)),
    )
    fields.done()
    return section
