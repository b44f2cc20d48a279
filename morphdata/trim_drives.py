"""Which drives balance the moments of a trim: those a flight names, and for "auto" the aircraft's own."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass

from morphdata.drives import without_side

NO_NAMES = ("auto", "none")  # not names of drives
UPRIGHT_RAD = 1.0  # dihedral from which a surface is a fin
PITCH, ROLL, YAW = (
    "trim_drive",
    "roll_trim_drive",
    "yaw_trim_drive",
)  # fields of a flight, in the order of search


@dataclass(frozen=True)
class ControlPart:
    """A control surface on one side, of an aircraft's document or of the numerics.

    Attributes
    ----------
    drive : str
        Name of its drive.
    side : str
        Of its surface.
    dihedral_rad : float
        Of its surface.
    sign : float
        +1 if a positive angle moves the trailing edge down, else -1.
    """

    drive: str
    side: str
    dihedral_rad: float
    sign: float


def meant(name: str, drives: Collection[str]) -> list[str]:
    """Return the drives that a name means: the drive itself, or those of both sides of a word."""
    return [name] if name in drives else [each for each in drives if without_side(each) == name]


def balancing(
    given: Mapping[str, str | None],
    drives: Collection[str],
    parts: Iterable[ControlPart],
    *,
    asymmetric: bool,
) -> dict[str, str]:
    """Return the name or word of the drive for each field that has one.

    Parameters
    ----------
    given : mapping of str to str or None
        By field, what the flight says: None and "none" are no drive, "auto" is the aircraft's own control in
        asymmetric flight, else none.
    drives : collection of str
        Names of the aircraft's drives.
    parts : iterable of ControlPart
        Its controls.
    asymmetric : bool
        Whether the steady flight differs from its mirror image.
    """
    chosen = {field: name for field in (PITCH, ROLL, YAW) if (name := given[field]) not in (None, *NO_NAMES)}
    taken = {drive for name in chosen.values() for drive in meant(name, drives)}
    every = list(parts)
    for field in (ROLL, YAW) if asymmetric else ():
        if given[field] == "auto" and (own := own_control(field, every, taken)) is not None:
            chosen[field] = own
            taken |= {*meant(own, drives)}
    return chosen


def own_control(field: str, parts: Iterable[ControlPart], taken: Collection[str] = ()) -> str | None:
    """Return the word of an aircraft's first control for roll or yaw that is not taken; None without one.

    Ailerons move the trailing edges of both sides against each other. A rudder is on a fin; on a pair of
    fins, too, it moves the trailing edges against each other.
    """
    words: dict[str, list[ControlPart]] = {}
    for part in parts:
        words.setdefault(without_side(part.drive), []).append(part)
    for word, same in words.items():
        fins = all(abs(part.dihedral_rad) >= UPRIGHT_RAD for part in same)
        opposed, alone = any(part.sign < 0.0 for part in same), len({part.side for part in same}) == 1
        free = not {part.drive for part in same} & {*taken}
        if free and fins == (field == YAW) and (opposed or (fins and alone)):
            return word
    return None
