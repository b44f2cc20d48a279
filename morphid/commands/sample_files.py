"""Options by which a user declares what is in sample files: axes, quaternions, columns, a window of time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

import typer

from morphdata.faults import InvalidInput
from morphdata.options import VEHICLE
from morphdata.samplefiles.declared import declared
from morphid.exits import CommandError, Exit

OPTIONS = {
    "earth": Annotated[
        str | None,
        typer.Option("--earth", help="Axes of the earth in sample files: ned, enu.", rich_help_panel=VEHICLE),
    ],
    "body": Annotated[
        str | None,
        typer.Option("--body", help="Axes of the body in sample files: frd or flu.", rich_help_panel=VEHICLE),
    ],
    "quaternion": Annotated[
        str | None,
        typer.Option(
            "--quaternion",
            help="Order of a quaternion in the columns q0 to q3: wxyz or xyzw.",
            rich_help_panel=VEHICLE,
        ),
    ],
    "column": Annotated[
        list[str] | None,
        typer.Option(
            "--column",
            help="A column of sample files, NAME=TITLE*SCALE+OFFSET: sweep_left_deg=servo_1*0.09-135.",
            rich_help_panel=VEHICLE,
        ),
    ],
    "between": Annotated[
        str | None,
        typer.Option(
            "--between",
            help="Use only rows of sample files between two times, s: 120:180.",
            rich_help_panel=VEHICLE,
        ),
    ],
}


def said(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return what the options declare, as arguments of `morphdata.samplefiles.declared.declared`.

    Raises
    ------
    CommandError : naming the option.
    """
    found = {name: values[name] for name in ("earth", "body", "quaternion") if values[name] is not None}
    columns: dict[str, str] = {}
    for given in values["column"] or []:
        name, equals, title = given.partition("=")
        if not equals or name in columns:
            said = f"{name} is declared twice" if equals else f"{given!r} is no NAME=TITLE"
            raise _error(said, "write --column sweep_left=TITLE once for each column", "--column")
        columns[name] = title
    if columns:
        found["columns"] = columns
    if values["between"] is not None:
        found["between"] = values["between"].split(":")
    try:
        declared(**found)
    except InvalidInput as error:
        name = (error.pointer or "").split("/")[1]
        raise _error(
            error.message, error.hint or "", f"--{'column' if name == 'columns' else name}"
        ) from None
    if "between" in found:
        found["between"] = [float(time) for time in found["between"]]
    return found


def _error(message: str, hint: str, option: str) -> CommandError:
    return CommandError(message, code=Exit.INVALID_INPUT, hint=hint, given_by=option)
