"""Checks of requests that involve aircraft and flight condition together."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from morphdata.aircraft import Aircraft
from morphdata.controls import control_names
from morphdata.drives import without_side
from morphdata.faults import Fault
from morphdata.flight import Flight
from morphdata.lattice import Lattice
from morphdata.links import by_pair
from morphdata.pairs import mirror_pairs
from morphdata.parameters import Parameters
from morphdata.telescopes import telescoping, unsupported_faults
from morphdata.trim_drives import PITCH, ROLL, YAW, ControlPart, balancing, meant


def start_faults(flight: Flight, start: str | None) -> Iterator[Fault]:
    """Check that a flight has the start requested for a model.

    Parameters
    ----------
    start : str or None
        Requested start of the flight; "given" needs ``flight.start``.
    """
    if start == "given" and flight.start is None:
        yield Fault(
            "start_missing",
            'model.start is "given", but the flight has no start.',
            "/flight/start",
            'Give alpha_rad, force_b_n and moment_b_n_m, or use model.start = "trim".',
        )


def trim_drive_faults(aircraft: Aircraft, flight: Flight) -> Iterator[Fault]:
    """Check that the aircraft has the drives that the flight is to be trimmed with, one for each moment."""
    drives, taken = aircraft.drives, dict[str, str]()
    for field, name in trim_drives(aircraft, flight).items():
        names = meant(name, drives)
        if not names:
            yield Fault(
                "no_such_drive",
                f"The aircraft has no drive {name!r} to trim with.",
                f"/flight/{field}",
                f"Its drives are {', '.join(drives)}." if drives else f"It has no drives: omit {field}.",
            )
        for each in names:
            if drives[each].unit != "rad":
                yield Fault(
                    "no_such_drive",
                    f"The drive {each!r} slides, and a trim turns its drive.",
                    f"/flight/{field}",
                    f"Trim with a drive that turns, or omit {field}.",
                )
        for former in {taken[each]: None for each in names if each in taken}:
            yield Fault(
                "drive_named_twice",
                f"The drive {name!r} cannot balance two moments.",
                f"/flight/{field}",
                f"It is the flight's {former} already: name another drive, or omit {field}.",
            )
        taken |= dict.fromkeys(names, field)


def sliding_faults(aircraft: Aircraft, flight: Flight, lattice: Lattice) -> Iterator[Fault]:
    """Check that nothing is asked of telescoping surfaces that is not computed."""
    yield from unsupported_faults(
        telescoping(aircraft.surfaces), apparent_mass=flight.apparent_mass, lattice_shape=lattice.shape
    )


def trim_drives(aircraft: Aircraft, flight: Flight) -> dict[str, str]:
    """Return the names of the drives that balance moments in trim, by the fields of the flight.

    Parameters
    ----------
    aircraft : Aircraft
    flight : Flight
    """
    names = control_names(aircraft.surfaces)
    parts = [
        ControlPart(names[number, place], surface.side, surface.dihedral_rad, control.sign(surface.side))
        for number, surface in enumerate(aircraft.surfaces)
        for place, control in enumerate(surface.all_controls)
    ]
    given = {field: getattr(flight, field) for field in (PITCH, ROLL, YAW)}
    return balancing(given, aircraft.drives, parts, asymmetric=flight.is_lateral)


def moved_trim_faults(
    aircraft: Aircraft, flight: Flight, start: str | None, moved: Sequence[str]
) -> Iterator[Fault]:
    """Check that no morph moves the drive with which its flights are trimmed.

    Parameters
    ----------
    start : str or None
        Requested start of the flight; a given one is not trimmed.
    moved : sequence of str
        Names of the drives that the morph moves.
    """
    for field, drive in trim_drives(aircraft, flight).items():
        both = [name for name in moved if drive in (name, without_side(name))]
        if both and start != "given":
            instead = f"omit {field}" if field == PITCH else f'set {field} to "none"'
            yield Fault(
                "morph_of_trim_drive",
                f"The morph moves {both[0]!r}, with which the flight is trimmed.",
                f"/flight/{field}",
                f"Trim with another drive, or {instead}.",
            )


def flexible_wing_faults(aircraft: Aircraft, code: str) -> Iterator[Fault]:
    """Check that there is a wing that is both hinged and flexible, or flexible where a control moves."""
    flexible = [surface for surface in aircraft.surfaces if surface.flexible]
    if any(surface.controls for surface in aircraft.surfaces):
        if not flexible:
            hint = "Do not set the wing's flexible to false."
            yield Fault(code, "No surface is flexible.", "/aircraft/surfaces", hint)
    elif not any(surface.all_hinges for surface in flexible):
        yield Fault(
            code,
            "No surface is both hinged and flexible.",
            "/aircraft/surfaces",
            "Give a wing a hinge, and do not set its flexible to false.",
        )


def model_surfaces_faults(aircraft: Aircraft, model: Parameters | None, pointer: str) -> Iterator[Fault]:
    """Check that an equivalent model has parameters for every flexible surface of an aircraft."""
    if model is None:
        return
    factors = getattr(model.aero, "lift_factors", None)
    if factors:
        names = [surface.name for surface in aircraft.surfaces]
        yield from by_pair(factors, names, mirror_pairs(aircraft), f"{pointer}/aero/lift_factors")[1]
    flexible = [surface.name for surface in aircraft.surfaces if surface.flexible]
    hint = "Give a model that was identified for this aircraft."
    if model.surfaces:
        for name in (each for each in flexible if each not in model.surfaces):
            yield Fault(
                "surface_without_parameters",
                f"The flexible surface {name!r} has no parameters.",
                f"{pointer}/surfaces",
                hint,
            )
    elif len(model.divisions) not in (1, len(flexible)):
        yield Fault(
            "other_number_of_wings",
            f"The parameters are for {len(model.divisions)} wings, the aircraft has {len(flexible)} flexible "
            "surfaces.",
            f"{pointer}/division",
            hint,
        )
