"""Findings of an examination."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import partial


class State(StrEnum):
    """Severity of a finding."""

    OK = "ok"
    WARN = "warn"  # it works, but not properly or not for long
    FAIL = "fail"  # it does not work


@dataclass(frozen=True, slots=True)
class Finding:
    """One line of the report: what was examined, the observation, and a remedy if it is not ok."""

    state: State
    name: str
    message: str
    remedy: str = ""


Check = Callable[[], Iterator[Finding]]


ok, warn, fail = (partial(Finding, state) for state in (State.OK, State.WARN, State.FAIL))


def examined(checks: Sequence[tuple[str, Check]]) -> Iterator[Finding]:
    """Run the checks one after the other; a check that fails to run is a finding too."""
    for name, check in checks:
        try:
            yield from check()
        except Exception as error:  # noqa: BLE001 - all checks must be run
            yield fail(name, f"could not be examined: {type(error).__name__}: {error}", "please report this")
