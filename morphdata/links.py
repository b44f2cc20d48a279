"""Links per wing, and other settings by surface: mirror images share them under the name of either or both.

A key of such a setting is the name of a surface, ``right tail``, or that without its side, ``tail``, for
both.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Annotated, Any, TypeVar

from pydantic import Discriminator, Field, Tag

from morphdata.faults import Fault
from morphdata.flight import Auto
from morphdata.refusals import escaped

MAX_LINKS = 16
MAX_WINGS = 16
MAX_NAME = 200
UNKNOWN = "no_such_surface"


def _form(value: Any) -> str:
    return "by_surface" if isinstance(value, Mapping) else "all"


Links = Annotated[int, Field(ge=1, le=MAX_LINKS)]
ChosenLinks = Links | Auto
SurfaceKey = Annotated[str, Field(min_length=1, max_length=MAX_NAME)]
BY_SURFACE = Field(min_length=1, max_length=MAX_WINGS)
LinksBySurface = Annotated[dict[SurfaceKey, Links], BY_SURFACE]
AskedBySurface = Annotated[dict[SurfaceKey, ChosenLinks], BY_SURFACE]
LinksPerWing = Annotated[
    Annotated[Links, Tag("all")] | Annotated[LinksBySurface, Tag("by_surface")], Discriminator(_form)
]
AskedLinks = Annotated[
    Annotated[ChosenLinks, Tag("all")] | Annotated[AskedBySurface, Tag("by_surface")], Discriminator(_form)
]
Pairs = Sequence[Sequence[int]]
T = TypeVar("T")

SIDE = re.compile(r"^(left|right)[ _-]+|[ _-]+(left|right)$", re.IGNORECASE)


def surface_word(name: str) -> str:
    """Return the name of a surface without its side.

    >>> surface_word("right wing"), surface_word("tail_left"), surface_word("fin")
    ('wing', 'tail', 'fin')
    """
    return SIDE.sub("", name)


def means(key: str, names: Sequence[str]) -> list[int]:
    """Return the places of the surfaces that a key means: the one of this name, or those of this word."""
    exact = [k for k, name in enumerate(names) if name == key]
    return exact or [k for k, name in enumerate(names) if surface_word(name) == key]


def common_names(names: Sequence[str], pairs: Pairs) -> list[str]:
    """Return a key for each group of surfaces: their word where it means no others, or their first name.

    >>> common_names(["right wing", "left wing", "fin"], [(0, 1), (2,)])
    ['wing', 'fin']
    """
    found = []
    for pair in pairs:
        word = surface_word(names[pair[0]])
        found.append(word if sorted(means(word, names)) == sorted(pair) else names[pair[0]])
    return found


def by_pair(
    given: Mapping[str, T], names: Sequence[str], pairs: Pairs, pointer: str
) -> tuple[dict[int, T], list[Fault]]:
    """Return the values that a setting by surface has for mirror pairs, and what is wrong with its keys.

    Parameters
    ----------
    given : mapping
        Values by name of a surface, or by that without its side.
    names : sequence of str
        Of all surfaces.
    pairs : sequence of sequences of int
        Places of the surfaces that share a value; each surface is in exactly one.
    pointer : str
        Of the setting.

    Returns
    -------
    dict
        Values by place among `pairs`.
    list of Fault
    """
    found: dict[int, T] = {}
    faults = []
    pair_of = {k: number for number, pair in enumerate(pairs) for k in pair}
    for key, value in given.items():
        at = f"{pointer}/{escaped(key)}"
        places = means(key, names)
        if not places:
            known = ", ".join(common_names(names, pairs))
            faults.append(Fault(UNKNOWN, f"There is no surface {key!r}.", at, f"Use {known}."))
        for number in dict.fromkeys(pair_of[k] for k in places):
            if found.setdefault(number, value) != value:
                word = common_names(names, pairs)[number]
                faults.append(
                    Fault(
                        "given_twice",
                        f"{key!r} has {value}, and another name of it or of its mirror image "
                        f"{found[number]}.",
                        at,
                        f"Mirror images share it: give it once, for {word!r}.",
                    )
                )
    return found, faults


def links_of(
    given: LinksPerWing, names: Sequence[str], flexible: Sequence[bool], pairs: Pairs, pointer: str
) -> tuple[list[int], list[Fault]]:
    """Return the number of links of each surface, one of a rigid one, and what is wrong with them.

    Parameters
    ----------
    given : int or mapping of str to int
        Of all flexible surfaces, or by surface.
    names, flexible : sequence
        Of each surface.
    pairs, pointer
        As of `by_pair`.
    """
    if isinstance(given, int):
        return [given if bends else 1 for bends in flexible], []
    shown = common_names(names, pairs)
    bent = [number for number, pair in enumerate(pairs) if flexible[pair[0]]]
    hint = f"Give one for each flexible surface: {', '.join(shown[number] for number in bent)}."
    found, faults = by_pair(given, names, pairs, pointer)
    faults = [replace(fault, hint=hint) if fault.code == UNKNOWN else fault for fault in faults]
    for number in bent:
        if number not in found and not faults:
            faults.append(Fault("missing", f"{shown[number]!r} has no number of links.", pointer, hint))
    for key, value in given.items():
        if value != 1 and (places := means(key, names)) and not any(flexible[k] for k in places):
            at = f"{pointer}/{escaped(key)}"
            faults.append(Fault("surface_rigid", f"{key!r} is rigid, which is one link.", at, hint))
    number_of = {k: number for number, pair in enumerate(pairs) for k in pair}
    return [found.get(number_of[k], 1) if bends else 1 for k, bends in enumerate(flexible)], faults


def links_document(names: Sequence[str], counts: Sequence[int]) -> LinksPerWing:
    """Return numbers of links of flexible surfaces as documents have them: one where all are the same.

    >>> links_document(["right wing", "left wing", "tail"], [4, 4, 1])
    {'wing': 4, 'tail': 1}
    """
    if len(set(counts)) < 2:
        return counts[0] if counts else 1
    found = {}
    for k, (name, count) in enumerate(zip(names, counts, strict=True)):
        both = means(surface_word(name), names)
        alike = k in both and all(counts[other] == count for other in both)
        found[surface_word(name) if alike else name] = count
    return found


def to_choose(links: AskedLinks) -> bool:
    """Whether a number of links is to be chosen from the samples."""
    return links == "auto" or (isinstance(links, dict) and "auto" in links.values())


def with_links(links: AskedLinks, number: int) -> LinksPerWing:
    """Return numbers of links with one in the place of each that is to be chosen.

    >>> with_links("auto", 2), with_links({"wing": "auto", "tail": 1}, 2)
    (2, {'wing': 2, 'tail': 1})
    """
    if isinstance(links, dict):
        return {name: number if own == "auto" else own for name, own in links.items()}
    return number if links == "auto" else links


def mean_links(links: LinksPerWing) -> float:
    """Return the mean number of links of flexible surfaces, mirror images counted once."""
    return float(links) if isinstance(links, int) else sum(links.values()) / len(links)


def shown_links(links: LinksPerWing) -> str:
    """Return numbers of links as text.

    >>> shown_links(1), shown_links(4), shown_links({"wing": 4, "tail": 1})
    ('1 link', '4 links', '4 links of wing, 1 of tail')
    """
    if isinstance(links, int):
        return f"{links} link{'s' if links != 1 else ''}"
    (name, first), *others = links.items()
    rest = "".join(f", {count} of {other}" for other, count in others)
    return f"{first} link{'s' if first != 1 else ''} of {name}{rest}"


def shown_per_wing(links: LinksPerWing) -> str:
    """Return numbers of links as text that stands by itself.

    >>> shown_per_wing(4), shown_per_wing({"wing": 4, "tail": 1})
    ('4 links per wing', '4 links of wing, 1 of tail')
    """
    return shown_links(links) if isinstance(links, dict) else f"{shown_links(links)} per wing"
