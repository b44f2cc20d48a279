"""One command for every operation."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

from morphdata.operations import OPERATIONS
from morphid.commands.export import EXPORT
from morphid.commands.identify import IDENTIFY
from morphid.commands.operation import Particulars, command_of
from morphid.commands.optimize import OPTIMIZE
from morphid.commands.simulate import SIMULATE
from morphid.commands.study import STUDY

PARTICULARS: Mapping[str, Particulars] = {
    "identify": IDENTIFY,
    "study": STUDY,
    "simulate": SIMULATE,
    "optimize": OPTIMIZE,
    "export": EXPORT,
}


def operation_commands() -> Iterator[Callable[..., None]]:
    """Make the commands, in the order of the operations."""
    for operation in OPERATIONS:
        yield command_of(operation, particulars_of(operation.name))


def particulars_of(operation: str) -> Particulars:
    """Find the additions of an operation's command; most have none."""
    return PARTICULARS.get(operation, Particulars())
