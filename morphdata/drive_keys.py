"""Which history of a schedule, or column of a file, each drive of an aircraft follows."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Iterator, Mapping, Sequence

from morphdata.drives import BOTH, SIDES, SWEEPS, WORDS, Drive
from morphdata.faults import Fault
from morphdata.refusals import MAX_POINTER, escaped

MAX_LISTED = 20  # columns of a file shown in an error
SHOWN_KEY = 60  # characters shown of a key from outside


def resolved(keys: Iterable[str], drives: Mapping[str, Drive]) -> tuple[dict[str, str], list[Fault]]:
    """Find the history that each drive follows.

    A key is the name of a drive (`sweep_left`), its word for both sides (`sweep`), or, if unambiguous,
    `both`, `left`, `right` and, as in old samples, `sweep_left` and `sweep_right` for hinges of another kind.

    Parameters
    ----------
    keys : iterable of str
        Of the histories.
    drives : mapping of str to Drive
        Of the aircraft.

    Returns
    -------
    keys_of_drives : dict
        Drive -> key; drives that no key moves are left out.
    faults : list of Fault
        Keys that name no drive, are ambiguous, or move a drive that another key moves; at ``/key``.
    """
    followed: dict[str, str] = {}
    faults = []
    for key in keys:
        meant, fault = _meant(key, drives)
        if fault is not None:
            faults.append(fault)
        for name in meant:
            if name in followed:
                faults.append(
                    Fault(
                        "given_twice",
                        f"{followed[name]!r} and {key!r} both move the drive {name!r}.",
                        f"/{escaped(key)}",
                        "Leave one of them out.",
                    )
                )
                break
            followed[name] = key
    return followed, faults


def resolved_columns(
    titles: Iterable[str], drives: Mapping[str, Drive]
) -> tuple[dict[str, str], list[Fault]]:
    """Find the column of a file that each drive follows, and ignore the other columns.

    A column named after a drive takes precedence over one with the word of both sides, and that over
    `sweep_left` and `sweep_right` in their old meaning, the hinge of that side of any kind.

    Parameters
    ----------
    titles : iterable of str
        Columns that could be drives, without their units.
    drives : mapping of str to Drive
        Of the aircraft.

    Returns
    -------
    columns_of_drives : dict
        Drive -> column; drives that no column moves are left out.
    faults : list of Fault
        Columns that are ambiguous or move a drive that another one moves; and, at "", a file without any
        column that moves a drive.
    """
    titles = list(titles)
    words = {drive.word for drive in drives.values() if drive.name not in titles}
    named = [title for title in titles if title in drives or title in words]
    followed, faults = resolved(named, drives)
    others = [title for title in titles if title in SWEEPS and title not in named]
    for title in others:
        meant, fault = _meant(title, drives)
        if fault is None:
            followed.update({name: title for name in meant if name not in followed})
        elif fault.code == "ambiguous_drive" and not named:
            faults.append(fault)
    if drives and not followed and not faults:
        faults.append(
            Fault(
                "no_drive",
                f"None of the columns {_listed(titles)} moves a drive of the aircraft."
                if titles
                else "No column moves a drive of the aircraft.",
                "",
                f"Name the columns after its drives: {shown_names(drives)}; the unit may follow "
                f"({next(iter(drives))}_deg).",
            )
        )
    return followed, faults


def unmeasured_sides(followed: Mapping[str, str], drives: Mapping[str, Drive]) -> Iterator[Fault]:
    """Check that a word measured on one side is also measured on the other; faults at ``/drive``."""
    for name, drive in drives.items():
        other = next((side for side in SIDES if side != drive.side), "")
        counterpart = f"{drive.word}_{other}"
        if name not in followed and counterpart in followed:
            key = followed[counterpart]
            yield Fault(
                "missing",
                f"{key} is given, and {_named_like(key, drive)} is missing.",
                f"/{escaped(_named_like(key, drive))}",
                f"Add {_named_like(key, drive)}, or, if both sides moved together, name the single column "
                f"{drive.word}.",
            )


def _named_like(key: str, drive: Drive) -> str:
    """Return the expected name of a drive's column, given that of the other side."""
    return f"{WORDS['z']}_{drive.side}" if key in SWEEPS else drive.name


def _listed(titles: Sequence[str]) -> str:
    shown = ", ".join(title[:SHOWN_KEY] for title in titles[:MAX_LISTED])
    return f"{shown}, ..." if len(titles) > MAX_LISTED else shown


def _meant(key: str, drives: Mapping[str, Drive]) -> tuple[list[str], Fault | None]:
    if key in drives:
        return [key], None
    of_word = [drive.name for drive in drives.values() if drive.word == key]
    if of_word:
        return of_word, None
    side = key.removeprefix(f"{WORDS['z']}_")
    if key != BOTH and side not in SIDES:
        return [], _unknown(key, drives)
    # `left` and `sweep_left` in their old meaning are hinges: a control has its own name
    candidates = [drive for drive in drives.values() if drive.hinges and (key == BOTH or drive.side == side)]
    if not candidates and any(drive.controls for drive in drives.values()):
        return [], _unknown(key, drives)
    if len({drive.word for drive in candidates}) > 1:
        return [], Fault(
            "ambiguous_drive",
            f"{key!r} could mean several drives: {', '.join(drive.name for drive in candidates)}.",
            f"/{escaped(key)}",
            f"Name them: {shown_names(drives)}.",
        )
    return [drive.name for drive in candidates], None


def _unknown(key: str, drives: Mapping[str, Drive]) -> Fault:
    words = dict.fromkeys(drive.word for drive in drives.values())
    near = difflib.get_close_matches(key, [*drives, *words], n=1)
    guess = f"Did you mean {near[0]!r}? " if near else ""
    return Fault(
        "unknown_drive",
        f"The aircraft has no drive {key[:SHOWN_KEY]!r}.",
        f"/{escaped(key)}"[:MAX_POINTER],
        f"{guess}Its drives are {shown_names(drives)}."
        if drives
        else "None of its surfaces has a hinge or a control.",
    )


def shown_names(drives: Mapping[str, Drive]) -> str:
    """Return the names of drives for messages, with the words that move both sides."""
    words = dict.fromkeys(drive.word for drive in drives.values())
    pairs = [word for word in words if all(f"{word}_{side}" in drives for side in SIDES)]
    both = f" (or {', '.join(pairs)} for both sides)" if pairs else ""
    return f"{', '.join(drives)}{both}"
