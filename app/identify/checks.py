"""Checks across fields of an identification request; each fault names the field and the way out."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence

from app.errors import Fault
from app.identify.schemas import Bounds, IdentifyRequest
from app.schemas.aircraft import Aircraft, Fuselage, Hinge, Surface
from app.schemas.flight import MACH_LIMIT, Flight
from app.schemas.samples import InlineSample
from app.trajectories.checks import columns_faults

MAX_TOTAL_ROWS = 200_000
MAX_DECADES = 12.0  # of a stiffness range: more is no knowledge at all, and spoils a logarithmic search
ANGLE_TOLERANCE_RAD = 1e-6  # measured sweeps are not exactly zero
POSITIVE_BOUNDS = ("stiffness_nm_rad", "damping_nms_rad", "lift_factor")  # searched on a logarithmic scale
BOUND_LIMITS = {
    "stiffness_nm_rad": (0.0, 1e12),
    "damping_nms_rad": (0.0, 1e10),
    "division": (0.0, 1.0),
    "lift_factor": (0.0, 10.0),
    "centre_shift_m": (-50.0, 50.0),
    "profile_drag": (0.0, 2.0),
    "lag_s": (0.0, 10.0),
}


def identify_faults(request: IdentifyRequest, samples: Sequence[InlineSample]) -> list[Fault]:
    """Everything that the schema alone cannot see.

    Parameters
    ----------
    samples
        The samples with their rows, those uploaded earlier resolved, in the order of the request.
    """
    faults = [
        *_fuselage_faults(request.aircraft.fuselage),
        *_surfaces_faults(request.aircraft),
        *_flight_faults(request.flight),
        *_bounds_faults(request.model.bounds),
        *_together_faults(samples),
    ]
    corrections = request.model.aero_coefficients
    for number, name in enumerate(corrections):
        if name in corrections[:number]:
            at = f"/model/aero_coefficients/{number}"
            faults.append(
                Fault("name_not_unique", f"{name} appears twice.", at, "Name each correction once.")
            )
    if request.model.start == "given" and request.flight.start is None:
        faults.append(
            Fault(
                "start_missing",
                'model.start is "given", but the flight has no start.',
                "/flight/start",
                'Give alpha_rad, force_b_n and moment_b_n_m, or use model.start = "trim".',
            )
        )
    hinges = _hinge_ranges(request.aircraft)
    for number, sample in enumerate(samples):
        faults += columns_faults(sample, f"/samples/{number}")
        faults += _sweep_faults(sample, f"/samples/{number}", hinges)
    return faults


def _together_faults(samples: Sequence[InlineSample]) -> Iterator[Fault]:
    names: dict[str, int] = {}
    for number, sample in enumerate(samples):
        if sample.name in names:
            yield Fault(
                "name_not_unique",
                f"Samples {names[sample.name]} and {number} are both called {sample.name!r}.",
                f"/samples/{number}/name",
                "Give every sample a name of its own: plots are named after it.",
            )
        names.setdefault(sample.name, number)
    if all(sample.role != "train" for sample in samples):
        yield Fault(
            "no_training_sample",
            "Every sample is held out.",
            "/samples/0/role",
            'Give at least one sample the role "train".',
        )


def total_rows_faults(rows: Iterable[int]) -> list[Fault]:
    """Check the rows of all samples together."""
    total = sum(rows)
    if total <= MAX_TOTAL_ROWS:
        return []
    return [
        Fault(
            "too_many_rows",
            f"The samples have {total} rows together.",
            "/samples",
            f"At most {MAX_TOTAL_ROWS}: 10 ms between rows are enough.",
        )
    ]


def _hinge_ranges(aircraft: Aircraft) -> dict[str, tuple[float, float, str]]:
    """Per side, the angles that all its hinges allow, and the name of a surface there."""
    ranges: dict[str, tuple[float, float, str]] = {}
    for surface in aircraft.surfaces:
        if surface.hinge is not None:
            low, high, name = ranges.get(surface.side, (-math.inf, math.inf, surface.name))
            ranges[surface.side] = (max(low, surface.hinge.min_rad), min(high, surface.hinge.max_rad), name)
    return ranges


def _sweep_faults(
    sample: InlineSample, pointer: str, hinges: dict[str, tuple[float, float, str]]
) -> Iterator[Fault]:
    for side, (low, high, surface) in hinges.items():
        column = sample.sweep_left_rad if side == "left" else sample.sweep_right_rad
        for row, angle in enumerate(column):
            if not low - ANGLE_TOLERANCE_RAD <= angle <= high + ANGLE_TOLERANCE_RAD:
                hint = f"The hinge of {surface!r} goes from {low:g} to {high:g} rad."
                if abs(angle) > math.pi:
                    hint += " Is the sweep in degrees?"
                yield Fault(
                    "sweep_out_of_range",
                    f"The {side} sweep is {angle:g} rad.",
                    f"{pointer}/sweep_{side}_rad/{row}",
                    f"{hint} Correct the row, or the hinge's min_rad and max_rad.",
                )
                break


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
    if not any(surface.flexible and surface.hinge is not None for surface in aircraft.surfaces):
        yield Fault(
            "nothing_to_identify",
            "No surface is both hinged and flexible.",
            "/aircraft/surfaces",
            "Give a wing a hinge, and do not set its flexible to false.",
        )


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


def _bounds_faults(bounds: Bounds | None) -> Iterator[Fault]:
    for name, (least, most) in BOUND_LIMITS.items():
        bound = None if bounds is None else getattr(bounds, name)
        if bound is None:
            continue
        low, high = bound
        at = f"/model/bounds/{name}"
        if low >= high:
            yield Fault(
                "range_upside_down",
                f"The lower bound {low:g} is not below the upper bound {high:g}.",
                f"{at}/0",
                "Give [low, high] with low < high.",
            )
        elif name in POSITIVE_BOUNDS and low <= 0.0:
            yield Fault(
                "bound_not_positive",
                f"{name} is searched on a logarithmic scale; {low:g} has no logarithm.",
                f"{at}/0",
                "Give a small positive lower bound, or leave the bounds out: beam theory gives them.",
            )
        elif low < least or high > most:
            yield Fault(
                "bound_out_of_range",
                f"[{low:g}, {high:g}] leaves what is physical, [{least:g}, {most:g}].",
                f"{at}/{0 if low < least else 1}",
                "Narrow the bounds, or leave them out: they follow from beam theory.",
            )
        elif name in POSITIVE_BOUNDS and math.log10(high / low) > MAX_DECADES:
            yield Fault(
                "bound_too_wide",
                f"[{low:g}, {high:g}] spans {math.log10(high / low):.0f} decades.",
                f"{at}/1",
                f"Narrow it to {MAX_DECADES:g} decades, or leave the bounds out: beam theory gives them.",
            )
