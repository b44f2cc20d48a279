"""What an examination finds."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum


class State(StrEnum):
    """How good or bad it is."""

    OK = "ok"
    WARN = "warn"  # it works, but not as it should or not for long
    FAIL = "fail"  # it does not work


@dataclass(frozen=True, slots=True)
class Finding:
    """One line of the report.

    Attributes
    ----------
    name : str
        What was looked at.
    state : State
    message : str
        What was seen.
    remedy : str
        What to do about it; empty when it is ok.
    """

    name: str
    state: State
    message: str
    remedy: str = ""


Check = Callable[[], Iterator[Finding]]


def ok(name: str, message: str) -> Finding:
    """Say that something is as it should be."""
    return Finding(name, State.OK, message)


def warn(name: str, message: str, remedy: str) -> Finding:
    """Say that something could be better."""
    return Finding(name, State.WARN, message, remedy)


def fail(name: str, message: str, remedy: str) -> Finding:
    """Say that something does not work."""
    return Finding(name, State.FAIL, message, remedy)


def examined(checks: Sequence[tuple[str, Check]]) -> Iterator[Finding]:
    """Make the checks one after the other; one that breaks is a finding too."""
    for name, check in checks:
        try:
            yield from check()
        except Exception as error:  # noqa: BLE001 - the doctor must finish his round
            yield fail(name, f"could not be examined: {type(error).__name__}: {error}", "please report this")
