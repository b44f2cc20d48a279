"""The aircraft: a rigid fuselage and lifting surfaces, hinged or fixed (``examples/aircraft.json``)."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field

from morphdata.base import Document, Length, Position, Text
from morphdata.controls import (
    Control,
    Controls,
    control_drives,
    control_faults,
    control_names,
    overlap_faults,
)
from morphdata.drives import MAX_HINGES, Drive, Hinge, Side, drive_faults, drive_name, drives_of
from morphdata.faults import Fault
from morphdata.inertia import Inertia, inertia_faults
from morphdata.masses import MAX_POINT_MASSES, PointMass, Propulsion, mass_faults
from morphdata.stations import (
    MAX_STATIONS,
    MIN_STATIONS,
    Chord,
    Station,
    Stiffness,
    row_chords,
    station_faults,
)
from morphdata.telescopes import inner_panel_faults, telescope_faults

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

MAX_SWEEP_RAD = 1.2
MAX_DIHEDRAL_RAD = 1.5708  # pi / 2, as it is usually written
MAX_INCIDENCE_RAD = 0.5
BOX = ("length_m", "width_m", "height_m", "density_kg_m3")


class Fuselage(Document):
    """A rigid body: a box of uniform density, or explicit mass and inertia."""

    shape: Literal["box"] | None = Field(
        default=None, description="Only a name; the shape is given by the four numbers of a box."
    )
    length_m: Length | None = None
    width_m: Length | None = None
    height_m: Length | None = None
    density_kg_m3: Annotated[float, Field(gt=0.0, le=20_000.0)] | None = None
    mass_kg: Annotated[float, Field(gt=0.0, le=1e7)] | None = Field(
        default=None, description="Instead of a density; needs `inertia_kg_m2`."
    )
    inertia_kg_m2: Inertia | None = Field(
        default=None, description="About the centre of mass, body axes: three diagonal terms or 3 x 3."
    )
    centre_of_mass_m: Position | None = Field(
        default=None, description="From the reference point, body axes."
    )

    def faults(self) -> Iterator[Fault]:
        """Check that a box is complete, or that mass and inertia are both given and physically possible."""
        if self.mass_kg is None:
            for name in BOX:
                if getattr(self, name) is None:
                    yield Fault(
                        "missing",
                        f"A box needs {name}.",
                        f"/{name}",
                        f"Add {name}, or give mass_kg and inertia_kg_m2 instead of a box.",
                    )
        elif self.inertia_kg_m2 is None:
            yield Fault(
                "missing",
                "mass_kg needs inertia_kg_m2.",
                "/inertia_kg_m2",
                "Add three diagonal terms or a 3 x 3 matrix about the centre of mass.",
            )
        yield from inertia_faults(self.inertia_kg_m2)


class Material(Document):
    """An isotropic material."""

    density_kg_m3: float = Field(gt=0.0, le=30_000.0)
    youngs_modulus_pa: float = Field(gt=0.0, le=2e12)
    poisson_ratio: float = Field(default=0.3, ge=-0.99, le=0.5)
    stiffness_damping_s: float = Field(
        default=0.0, ge=0.0, le=10.0, description="Damping as a multiple of stiffness, c = beta k."
    )

    @property
    def shear_modulus_pa(self) -> float:
        """G = E / (2 (1 + nu))."""
        return self.youngs_modulus_pa / (2 * (1 + self.poisson_ratio))


class Section(Document):
    """Explicit section properties, instead of those of a solid box."""

    ei_flap_n_m2: Stiffness
    ei_edge_n_m2: Stiffness
    gj_n_m2: Stiffness
    mass_per_length_kg_m: float = Field(gt=0.0, le=1e5)
    inertia_per_length_kg_m: list[Annotated[float, Field(ge=0.0, le=1e6)]] = Field(
        min_length=3, max_length=3, description="About x, y, z of the section's centre of mass."
    )
    ea_n: Stiffness | None = Field(
        default=None, description="Axial stiffness, N; default 12 EI_flap / thickness^2, a rectangle's."
    )
    ga_chord_n: Stiffness | None = Field(
        default=None,
        description="Shear stiffness along the chord, N; default 5/12 of the axial stiffness over (1 + nu).",
    )
    ga_normal_n: Stiffness | None = Field(
        default=None, description="Shear stiffness along the normal, N; default as along the chord."
    )

    def faults(self) -> Iterator[Fault]:
        """Check that a section that can twist has a moment of inertia about the span."""
        if self.inertia_per_length_kg_m[1] == 0.0:
            yield Fault(
                "greater_than",
                "The section has no moment of inertia about y, the span.",
                "/inertia_per_length_kg_m/1",
                "Give the moments about chord axis, span axis and normal; the second must be more than 0.",
            )


class Surface(Document):
    """A lifting surface, hinged (it morphs) or fixed (a tail)."""

    name: Text
    side: Side
    span_m: Length
    chord_m: Chord | None = Field(
        default=None, description="Uniform chord, or the default of root and tip chord."
    )
    root_chord_m: Chord | None = None
    tip_chord_m: Chord | None = None
    sweep_rad: Annotated[float, Field(ge=-MAX_SWEEP_RAD, le=MAX_SWEEP_RAD)] = Field(
        default=0.0,
        description="Sweep of the mid-chord line, aft, in the plane of the surface; chords stay parallel to "
        "the root's. `span_m` is measured across the root chord: the mid-chord line is span / cos(sweep) "
        "long.",
    )
    dihedral_rad: Annotated[float, Field(ge=-MAX_DIHEDRAL_RAD, le=MAX_DIHEDRAL_RAD)] = Field(
        default=0.0, description="Tip up; pi / 2 makes a vertical fin."
    )
    incidence_rad: Annotated[float, Field(ge=-MAX_INCIDENCE_RAD, le=MAX_INCIDENCE_RAD)] = Field(
        default=0.0, description="Of the root chord to the fuselage, nose up, after the dihedral."
    )
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
    zero_lift_rad: Annotated[float, Field(ge=-0.35, le=0.35)] = Field(
        default=0.0,
        description="Zero-lift angle of attack of the sections, rad; negative for positive camber.",
    )
    cm0: Annotated[float, Field(ge=-0.5, le=0.5)] = Field(
        default=0.0,
        description="Moment coefficient of the sections about their aerodynamic centre, nose up positive; in "
        "incompressible flow.",
    )
    cl_max: Annotated[float, Field(gt=0.0, le=10.0)] | None = Field(
        default=None,
        description="Largest lift coefficient of the sections, at which they stall; default: no limit.",
    )
    cl_min: Annotated[float, Field(ge=-10.0, lt=0.0)] | None = Field(
        default=None, description="The smallest, negative; default: no limit."
    )
    twist_rad: Annotated[float, Field(ge=-0.5, le=0.5)] = Field(
        default=0.0, description="Twist of the tip against the root, rad, nose up positive; linear."
    )
    hinge: Hinge | None = Field(default=None, description="A single hinge; use `hinges` for several.")
    hinges: Annotated[list[Hinge], Field(min_length=1, max_length=MAX_HINGES)] | None = Field(
        default=None,
        description="From the fuselage outward; each carries the following ones and the surface. The parts "
        "between them have neither mass nor lift.",
    )
    position_m: Position | None = Field(
        default=None, description="Root at mid-chord; default: at the last hinge."
    )
    flexible: bool = True
    stations: Annotated[list[Station], Field(min_length=MIN_STATIONS, max_length=MAX_STATIONS)] | None = (
        Field(
            default=None,
            description="Properties that vary along the span, linear between rows; what a row leaves out is "
            "the surface's own. Places across the chord are linear in m.",
        )
    )
    controls: Controls | None = Field(
        default=None, description="Trailing-edge control surfaces, side by side along the span."
    )

    @property
    def root_and_tip_chord_m(self) -> tuple[float, float]:
        """Chord at the root and at the tip."""
        if self.stations:
            chords_of_rows = row_chords(self.stations, *self.own_chords_m)
            return chords_of_rows[0], chords_of_rows[-1]
        return self.own_chords_m

    @property
    def own_chords_m(self) -> tuple[float, float]:
        """Chord at root and tip by the surface's own fields; 0 where it has none."""
        chords = [self.chord_m if chord is None else chord for chord in (self.root_chord_m, self.tip_chord_m)]
        return float(chords[0] or 0.0), float(chords[1] or 0.0)

    @property
    def root_m(self) -> list[float]:
        """Mid-chord of the root with all hinges at rest, body axes; default: at the last hinge."""
        return self.position_m or (self.all_hinges[-1].position_m if self.all_hinges else [0.0, 0.0, 0.0])

    @property
    def all_hinges(self) -> tuple[Hinge, ...]:
        """Hinges from the fuselage outward; empty for a fixed surface."""
        return tuple(self.hinges or ()) if self.hinge is None else (self.hinge,)

    @property
    def all_controls(self) -> tuple[Control, ...]:
        """Its control surfaces, in the document's order."""
        return tuple(self.controls or ())

    def hinge_pointer(self, number: int) -> str:
        """Return the JSON pointer of a hinge."""
        return f"/hinges/{number}" if self.hinge is None else "/hinge"

    def faults(self) -> Iterator[Fault]:
        """Check that the chord is known, the surface is attached, and its axes are near the chord."""
        if self.stations:
            wrong = list(station_faults(self.stations, self.own_chords_m, self.elastic_axis_offset_m))
            if wrong:
                yield from wrong
                return
        root, tip = self.root_and_tip_chord_m
        if not (root and tip):
            yield Fault(
                "missing", "The chord is not given.", "/chord_m", "Add chord_m, or root and tip chord."
            )
            return
        for name in ("elastic_axis_offset_m", "mass_axis_offset_m"):
            offset = getattr(self, name)
            if abs(offset) > root:
                yield Fault(
                    "axis_outside",
                    f"{name} is {offset:g}, more than the chord of {root:g} m at the root.",
                    f"/{name}",
                    "It is measured from mid-chord, in m, positive aft.",
                )
        if self.hinge is not None and self.hinges is not None:
            yield Fault(
                "given_twice",
                "hinge and hinges are both given.",
                "/hinges",
                "Leave hinge out, and put it into the list.",
            )
        if not self.all_hinges and self.position_m is None:
            yield Fault(
                "missing",
                f"{self.name!r} has neither a hinge nor a position.",
                "/hinge",
                "Add a hinge, or position_m for a fixed surface.",
            )
        yield from overlap_faults(self.all_controls)
        yield from telescope_faults(self)


class Aircraft(Document):
    """A fuselage with its lifting surfaces."""

    model_config = ConfigDict(json_schema_extra={"examples": [EXAMPLE_AIRCRAFT]})

    name: Text = "aircraft"
    fuselage: Fuselage
    surfaces: list[Surface] = Field(min_length=1, max_length=MAX_SURFACES)
    point_masses: Annotated[list[PointMass], Field(max_length=MAX_POINT_MASSES)] | None = Field(
        default=None, description="Masses beside the fuselage's and the surfaces' own."
    )
    propulsion: Propulsion | None = Field(
        default=None,
        description="The line of thrust. Without it, the thrust that a trim finds acts along the flight path "
        "at the reference point.",
    )

    @property
    def drives(self) -> dict[str, Drive]:
        """The drives, by name: those of hinges, then those of controls."""
        hinges = drives_of(
            (drive_name(hinge, surface.side), surface, (number, place), hinge)
            for number, surface in enumerate(self.surfaces)
            for place, hinge in enumerate(surface.all_hinges)
        )
        controls = control_drives(
            (name, self.surfaces[at[0]], at, self.surfaces[at[0]].all_controls[at[1]])
            for at, name in control_names(self.surfaces).items()
        )
        return hinges | controls

    def faults(self) -> Iterator[Fault]:
        """Check that surface names are unique and that each drive turns equal hinges."""
        yield from drive_faults(self.surfaces)
        yield from control_faults(self.surfaces)
        yield from inner_panel_faults(self.surfaces)
        names: set[str] = set()
        for number, surface in enumerate(self.surfaces):
            if surface.name in names:
                yield Fault(
                    "name_not_unique",
                    f"Two surfaces are called {surface.name!r}.",
                    f"/surfaces/{number}/name",
                    "Rename one.",
                )
            names.add(surface.name)
        yield from mass_faults(self.point_masses or [], [surface.name for surface in self.surfaces])


def load_aircraft(path: str | Path) -> Aircraft:
    """Read an aircraft from its JSON file.

    Parameters
    ----------
    path : str or Path
        The file.

    Returns
    -------
    Aircraft
        The document.

    Raises
    ------
    InvalidInput
        Lists every fault, with pointers that begin with ``/aircraft``.

    Examples
    --------
    >>> from morphcore import load_aircraft
    >>> sorted(load_aircraft("examples/aircraft.json").drives)
    ['sweep_left', 'sweep_right']
    """
    return Aircraft.load(path, "/aircraft")
