"""Checks of requests that involve aircraft and flight condition together."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import islice
from typing import TypeVar

from morphdata.aircraft import Aircraft
from morphdata.drives import without_side
from morphdata.faults import Fault
from morphdata.flight import Flight
from morphdata.parameters import Parameters
from morphdata.telescopes import apparent_mass_fault, mouth_m

T = TypeVar("T")


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
    """Check that the aircraft has the drives that the flight is to be trimmed with."""
    name, drives = flight.trim_drive, aircraft.drives
    if name is not None and name not in drives and name not in map(without_side, drives):
        yield Fault(
            "no_such_drive",
            f"The aircraft has no drive {name!r} to trim with.",
            "/flight/trim_drive",
            f"Its drives are {', '.join(drives)}." if drives else "It has no drives: omit trim_drive.",
        )
    elif name is not None:
        for drive in drives.values():
            if name in (drive.name, without_side(drive.name)) and drive.unit != "rad":
                yield Fault(
                    "no_such_drive",
                    f"The drive {drive.name!r} slides, and a trim turns its drive.",
                    "/flight/trim_drive",
                    "Trim with a drive that turns, or omit trim_drive.",
                )


def sliding_faults(aircraft: Aircraft, flight: Flight) -> Iterator[Fault]:
    """Check that nothing is asked of telescoping surfaces that is not computed."""
    if flight.apparent_mass:
        names = (each.name for each in aircraft.surfaces if mouth_m(each) is not None)
        yield from map(apparent_mass_fault, islice(names, 1))


def moved_trim_faults(flight: Flight, start: str | None, moved: Sequence[str]) -> Iterator[Fault]:
    """Check that no morph moves the drive with which its flights are trimmed.

    Parameters
    ----------
    start : str or None
        Requested start of the flight; a given one is not trimmed.
    moved : sequence of str
        Names of the drives that the morph moves.
    """
    both = [name for name in moved if flight.trim_drive in (name, without_side(name))]
    if both and start != "given":
        yield Fault(
            "morph_of_trim_drive",
            f"The morph moves {both[0]!r}, with which the flight is trimmed.",
            "/flight/trim_drive",
            "Trim with another drive, or omit trim_drive.",
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


def paired_by_reflection(surfaces: Sequence[T], reflections: Sequence[T]) -> tuple[tuple[int, ...], ...]:
    """Indices of surfaces by mirror pair, in order of first appearance.

    Parameters
    ----------
    surfaces, reflections : sequence
        Each surface and its mirror image, both without their names, which are not compared.

    Returns
    -------
    tuple of tuples of int
        Groups (first, image) and (first,); every surface is in exactly one.
    """
    groups = []
    waiting = list(range(len(surfaces)))
    while waiting:
        first = waiting.pop(0)
        image = [k for k in waiting if surfaces[k] == reflections[first]][:1]
        waiting = [k for k in waiting if k not in image]
        groups.append((first, *image))
    return tuple(groups)
