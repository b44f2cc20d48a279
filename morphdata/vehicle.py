"""Aircraft and flight condition together: checks across their fields, and what a worker gets of them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from morphdata.aircraft import Aircraft, Fuselage, Hinge, Surface
from morphdata.faults import Fault
from morphdata.flight import MACH_LIMIT, Flight

ANGLE_TOLERANCE_RAD = 1e-6  # measured sweeps are not exactly zero


@dataclass(frozen=True, slots=True)
class HingeRange:
    """Angles that all hinges of one side allow, rad, and the name of a surface there."""

    low: float
    high: float
    surface: str

    def fault(self, side: str, angle: float, pointer: str) -> Fault | None:
        """Tell that an angle is out of range, or None."""
        if self.low - ANGLE_TOLERANCE_RAD <= angle <= self.high + ANGLE_TOLERANCE_RAD:
            return None
        hint = f"The hinge of {self.surface!r} goes from {self.low:g} to {self.high:g} rad."
        if abs(angle) > math.pi:
            hint += " Is the sweep in degrees?"
        return Fault(
            "sweep_out_of_range",
            f"The {side} sweep is {angle:g} rad.",
            pointer,
            f"{hint} Correct the angle, or the hinge's min_rad and max_rad.",
        )


def vehicle_document(aircraft: Aircraft, flight: Flight) -> dict[str, Any]:
    """Build the aircraft and flight of a worker's request: as they came."""
    return {
        "aircraft": aircraft.model_dump(exclude_unset=True, exclude_none=True),
        "flight": flight.model_dump(exclude_unset=True, exclude_none=True),
    }


def hinge_ranges(aircraft: Aircraft) -> Mapping[str, HingeRange]:
    """Range of every side that has a hinge."""
    ranges: dict[str, HingeRange] = {}
    for surface in aircraft.surfaces:
        if surface.hinge is not None:
            former = ranges.get(surface.side, HingeRange(-math.inf, math.inf, surface.name))
            low, high = max(former.low, surface.hinge.min_rad), min(former.high, surface.hinge.max_rad)
            ranges[surface.side] = HingeRange(low, high, former.surface)
    return ranges


def vehicle_faults(aircraft: Aircraft, flight: Flight, *, start: str | None) -> list[Fault]:
    """Check aircraft and flight condition.

    Parameters
    ----------
    start
        How the flight is to start; "given" needs ``flight.start``.
    """
    faults = [
        *_fuselage_faults(aircraft.fuselage),
        *_surfaces_faults(aircraft),
        *_flight_faults(flight),
    ]
    if start == "given" and flight.start is None:
        faults.append(
            Fault(
                "start_missing",
                'model.start is "given", but the flight has no start.',
                "/flight/start",
                'Give alpha_rad, force_b_n and moment_b_n_m, or use model.start = "trim".',
            )
        )
    return faults


def flexible_wing_faults(aircraft: Aircraft, code: str) -> Iterator[Fault]:
    """Check that there is a wing whose bending counts."""
    if not any(surface.flexible and surface.hinge is not None for surface in aircraft.surfaces):
        yield Fault(
            code,
            "No surface is both hinged and flexible.",
            "/aircraft/surfaces",
            "Give a wing a hinge, and do not set its flexible to false.",
        )


def _fuselage_faults(fuselage: Fuselage) -> Iterator[Fault]:
    at = "/aircraft/fuselage"
    if fuselage.mass_kg is None:
        for name in ("length_m", "width_m", "height_m", "density_kg_m3"):
            if getattr(fuselage, name) is None:
                yield Fault(
                    "missing",
                    f"A box needs {name}.",
                    f"{at}/{name}",
                    f"Add {name}, or give mass_kg and inertia_kg_m2 instead of a box.",
                )
    elif fuselage.inertia_kg_m2 is None:
        yield Fault(
            "missing",
            "A given mass needs a given inertia.",
            f"{at}/inertia_kg_m2",
            "Add three diagonal terms or a 3 x 3 matrix about the centre of mass.",
        )
    if fuselage.inertia_kg_m2 is not None and not _is_inertia(fuselage.inertia_kg_m2):
        yield Fault(
            "inertia_not_physical",
            "This matrix is not the inertia of a body: it must be symmetric and positive definite.",
            f"{at}/inertia_kg_m2",
            "Check signs and symmetry; products of inertia enter with their minus sign.",
        )


def _is_inertia(given: Sequence[float | list[float]]) -> bool:
    """Symmetric and positive definite, by Sylvester's leading minors."""
    m = [
        list(row) if isinstance(row, list) else [row if column == number else 0.0 for column in range(3)]
        for number, row in enumerate(given)
    ]
    scale = max(abs(term) for row in m for term in row) or 1.0
    if any(abs(m[i][j] - m[j][i]) > 1e-9 * scale for i in range(3) for j in range(i)):
        return False
    first = m[0][0]
    second = m[0][0] * m[1][1] - m[0][1] * m[1][0]
    third = (
        m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1])
        - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0])
        + m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0])
    )
    return first > 0.0 and second > 0.0 and third > 0.0


def _surfaces_faults(aircraft: Aircraft) -> Iterator[Fault]:
    names: set[str] = set()
    for number, surface in enumerate(aircraft.surfaces):
        at = f"/aircraft/surfaces/{number}"
        if surface.name in names:
            yield Fault(
                "name_not_unique", f"Two surfaces are called {surface.name!r}.", f"{at}/name", "Rename one."
            )
        names.add(surface.name)
        yield from _surface_faults(surface, at)


def _surface_faults(surface: Surface, at: str) -> Iterator[Fault]:
    if surface.chord_m is None and (surface.root_chord_m is None or surface.tip_chord_m is None):
        yield Fault(
            "missing", "The chord is not given.", f"{at}/chord_m", "Add chord_m, or root and tip chord."
        )
    if surface.hinge is None:
        if surface.position_m is None:
            yield Fault(
                "missing",
                f"{surface.name!r} is attached nowhere.",
                f"{at}/hinge",
                "Add a hinge, or position_m for a fixed surface.",
            )
    else:
        yield from _hinge_faults(surface.hinge, f"{at}/hinge")


def _hinge_faults(hinge: Hinge, at: str) -> Iterator[Fault]:
    if hinge.min_rad >= hinge.max_rad:
        yield Fault(
            "range_upside_down",
            f"min_rad {hinge.min_rad:g} is not below max_rad {hinge.max_rad:g}.",
            f"{at}/min_rad",
            "Swap them, or correct one.",
        )


def model_surfaces_faults(aircraft: Aircraft, parameters: Mapping[str, Any], pointer: str) -> Iterator[Fault]:
    """Check that every flexible surface has its parameters in the document of an equivalent model."""
    flexible = [surface.name for surface in aircraft.surfaces if surface.flexible]
    surfaces, division = parameters.get("surfaces"), parameters["division"]
    wings = len(division) if isinstance(division[0], list) else 1
    hint = "Give the model that was identified for this aircraft."
    if surfaces:
        for name in (each for each in flexible if each not in surfaces):
            yield Fault(
                "surface_without_parameters",
                f"The flexible surface {name!r} has no parameters.",
                f"{pointer}/surfaces",
                hint,
            )
    elif wings not in (1, len(flexible)):
        yield Fault(
            "other_number_of_wings",
            f"The parameters are of {wings} wings, the aircraft has {len(flexible)} flexible surfaces.",
            f"{pointer}/division",
            hint,
        )


def speed_of_sound(altitude_m: float) -> float:
    """Speed of sound of the standard atmosphere, m/s (ICAO Doc 7488: 6.5 K/km up to 11 km, then constant)."""
    temperature_k = 288.15 - 0.0065 * min(altitude_m, 11_000.0)
    return math.sqrt(1.4 * 287.05287 * temperature_k)


def _flight_faults(flight: Flight) -> Iterator[Fault]:
    if flight.mach == "auto":
        mach = flight.airspeed_m_s / speed_of_sound(flight.altitude_m)
        if mach > MACH_LIMIT:
            yield Fault(
                "unsupported_regime",
                f"{flight.airspeed_m_s:g} m/s at {flight.altitude_m:g} m is Mach {mach:.2f}.",
                "/flight/mach",
                f"Linear compressibility ends at Mach {MACH_LIMIT}: fly slower, or leave mach out.",
            )
