"""The mirror pairs of an aircraft document, and settings by surface that they share."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TypeVar

from morphdata.aircraft import Aircraft, Surface
from morphdata.drives import Hinge, drive_name
from morphdata.faults import Fault
from morphdata.links import LinksPerWing, by_pair, links_of
from morphdata.masses import reflected_masses

T = TypeVar("T")


def links_by_name(aircraft: Aircraft, links: LinksPerWing) -> dict[str, int]:
    """Return the number of links of each surface, one of a rigid one."""
    names = [each.name for each in aircraft.surfaces]
    return dict(zip(names, _links(aircraft, links, "")[0], strict=True))


def links_faults(aircraft: Aircraft, links: LinksPerWing, pointer: str) -> Iterator[Fault]:
    """Check that numbers of links by surface name each flexible surface once, and no others."""
    yield from _links(aircraft, links, pointer)[1]


def _links(aircraft: Aircraft, links: LinksPerWing, pointer: str) -> tuple[list[int], list[Fault]]:
    names, flexible = zip(*((each.name, each.flexible) for each in aircraft.surfaces), strict=True)
    pairs = () if isinstance(links, int) else mirror_pairs(aircraft)
    return links_of(links, names, flexible, pairs, pointer)


def joints_of_sets(aircraft: Aircraft, links: LinksPerWing, *, separate_wings: bool) -> int:
    """Count the joints whose parameters are searched: mirror images share them unless wings are separate."""
    counts, surfaces = _links(aircraft, links, "")[0], aircraft.surfaces
    sets = [pair if separate_wings else pair[:1] for pair in mirror_pairs(aircraft)]
    return sum(counts[k] - 1 for group in sets for k in group if surfaces[k].flexible)


def own_lift_count(aircraft: Aircraft, keys: Sequence[str]) -> int:
    """Count the lift factors beside the first: where all surfaces are named, one of them has that."""
    names, pairs = [each.name for each in aircraft.surfaces], mirror_pairs(aircraft) if keys else ()
    return min(len(by_pair(dict.fromkeys(keys, True), names, pairs, "")[0]), max(len(pairs) - 1, 0))


def own_lift_faults(aircraft: Aircraft, keys: Sequence[str], pointer: str) -> Iterator[Fault]:
    """Check the names of surfaces that are to have a lift factor of their own."""
    names, pairs = [each.name for each in aircraft.surfaces], mirror_pairs(aircraft) if keys else ()
    for number, key in enumerate(keys):
        for fault in by_pair({key: True}, names, pairs, pointer)[1]:
            yield replace(fault, pointer=f"{pointer}/{number}")


def mirror_pairs(aircraft: Aircraft) -> tuple[tuple[int, ...], ...]:
    """Return the places of an aircraft's surfaces by mirror pair, what they carry included.

    A surface without a mirror image is alone.
    """
    surfaces = aircraft.surfaces
    carried = [reflected_masses(aircraft.point_masses or [], each.name) for each in surfaces]
    nameless = [(_plainly(each), own) for each, (own, _) in zip(surfaces, carried, strict=True)]
    reflections = [
        (_reflection(each), images) for (each, _), (_, images) in zip(nameless, carried, strict=True)
    ]
    return paired_by_reflection(nameless, reflections)


def _reflection(surface: Surface) -> Surface:
    side = "left" if surface.side == "right" else "right"
    hinges = [_mirrored(hinge, surface.side, side) for hinge in surface.all_hinges]
    return surface.model_copy(
        update={"side": side, "position_m": _across(surface.position_m), "hinges": hinges}
    )


def _mirrored(hinge: Hinge, from_side: str, to_side: str) -> Hinge:
    """Return a hinge's mirror image: a rotation vector keeps its y and changes the other signs."""
    x, y, z = hinge.axis_B(from_side)
    name = drive_name(hinge, from_side).removesuffix(f"_{from_side}") + f"_{to_side}"
    update = {"name": name, "axis": [-x, y, -z], "position_m": _across(hinge.position_m)}
    return hinge.model_copy(update=update)


def _plainly(surface: Surface) -> Surface:
    """Return a surface without its name, with its hinges in normal form: a list, with names and vectors."""
    hinges = [
        hinge.model_copy(
            update={"name": drive_name(hinge, surface.side), "axis": list(hinge.axis_B(surface.side))}
        )
        for hinge in surface.all_hinges
    ]
    return surface.model_copy(update={"name": "", "hinge": None, "hinges": hinges})


def _across(position_m: list[float] | None) -> list[float] | None:
    return position_m and [position_m[0], -position_m[1], position_m[2]]


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
