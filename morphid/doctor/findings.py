"""What an examination finds."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import partial


class State(StrEnum):
    """How good or bad it is."""

    OK = "ok"
    WARN = "warn"  # it works, but not as it should or not for long
    FAIL = "fail"  # it does not work


@dataclass(frozen=True, slots=True)
class Finding:
    """One line of the report: what was examined, what was seen, and the remedy where it is not ok."""

    state: State
    name: str
    message: str
    remedy: str = ""


Check = Callable[[], Iterator[Finding]]


ok, warn, fail = (partial(Finding, state) for state in (State.OK, State.WARN, State.FAIL))


def examined(checks: Sequence[tuple[str, Check]]) -> Iterator[Finding]:
    """Make the checks one after the other; one that breaks is a finding too."""
    for name, check in checks:
        try:
            yield from check()
        except Exception as error:  # noqa: BLE001 - the doctor must finish his round
            yield fail(name, f"could not be examined: {type(error).__name__}: {error}", "please report this")
