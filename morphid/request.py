"""The request built from a command line, and the option behind each part of it."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from morphdata.aircraft import Aircraft
from morphdata.drives import Drive
from morphdata.faults import InvalidInput
from morphdata.samples import Role
from morphid.exits import CommandError, Exit

Document = dict[str, Any]
SampleForm = Callable[[Path, Role], Document]


class Request:
    """A request, built part by part; the operation's name is also its path at a service."""

    def __init__(self, operation: str) -> None:
        self.operation = operation
        self.document: Document = {}
        self.said: dict[str, Any] = {}  # about sample files, see `morphid.commands.sample_files`
        self._samples: list[tuple[Path, Role]] = []
        self._given_by: dict[str, str] = {}

    def put(self, pointer: str, value: Any, option: str) -> None:
        """Set a part; None omits it, so that the library's default applies.

        Parameters
        ----------
        pointer : JSON pointer of the part.
        option : the option that gave the value, as written by the user; named in errors.
        """
        if value is None:
            return
        _put(self.document, pointer.split("/")[1:], value)
        self._given_by[pointer] = option if isinstance(value, dict | list) else f"{option} {value}"

    def add_samples(self, paths: Sequence[Path], role: Role, option: str) -> None:
        """Add sample files; their form in the request depends on its destination (see `body`)."""
        for path in paths:
            self._given_by[f"/samples/{len(self._samples)}"] = f"{option} {path}"
            self._samples.append((path, role))

    def body(self, sample: SampleForm) -> Document:
        """Return the whole request, with each sample file in the form returned by ``sample``."""
        if not self._samples:
            return self.document
        return {**self.document, "samples": [sample(path, role) for path, role in self._samples]}

    def option_at(self, pointer: str) -> str:
        """Return the option behind a part of the request, "" if no option set it."""
        parts = pointer.split("/")
        for length in range(len(parts), 1, -1):
            option = self._given_by.get("/".join(parts[:length]))
            if option:
                return option
        return ""


def aircraft_drives(request: Request) -> Mapping[str, Drive] | None:
    """Return the drives of the request's aircraft; None if it is invalid, which is reported elsewhere."""
    try:
        return Aircraft.parse(request.document.get("aircraft")).drives
    except InvalidInput:
        return None


def changed(document: Document, changes: Iterable[str]) -> Document:
    """Return a request with changed values.

    Parameters
    ----------
    changes : ``pointer=value`` each; the value is JSON, or else text.

    Examples
    --------
    >>> changed({"search": {"seed": 1}}, ["/search/seed=2", "/search/method=cma"])
    {'search': {'seed': 2, 'method': 'cma'}}
    """
    document = copy.deepcopy(document)
    for change in changes:
        pointer, equals, text = change.partition("=")
        if not pointer.startswith("/") or not equals:
            raise CommandError(
                f"--set {change}: not of the form POINTER=VALUE", code=Exit.USAGE, hint="--set /search/seed=2"
            )
        try:
            value = json.loads(text)
        except json.JSONDecodeError:
            value = text
        try:
            _put(document, [_unescaped(token) for token in pointer.split("/")[1:]], value)
        except (LookupError, ValueError, TypeError, AttributeError):
            raise CommandError(
                f"--set {change}: the request has no place {pointer}",
                code=Exit.INVALID_INPUT,
                hint="objects are named and list items counted from 0, as in /samples/0/role",
            ) from None
    return document


def _put(document: Any, tokens: Sequence[str], value: Any) -> None:
    *parents, last = tokens
    place = document
    for token in parents:
        place = place[_index(token)] if isinstance(place, list) else place.setdefault(token, {})
    if isinstance(place, list):
        place[_index(last)] = value
    elif isinstance(place, dict):
        place[last] = value
    else:
        raise TypeError(last)


def _index(token: str) -> int:
    if not token.isascii() or not token.isdigit():
        raise ValueError(token)
    return int(token)


def _unescaped(token: str) -> str:
    """Undo the escapes of RFC 6901."""
    return token.replace("~1", "/").replace("~0", "~")
