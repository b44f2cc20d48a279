"""Additions of ``morphid export`` to its request: the known model, and the written file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from morphid.commands import options
from morphid.commands.operation import Particulars, Values
from morphid.exits import CommandError, Exit
from morphid.files import read_json, write_bytes
from morphid.request import Request
from morphid.screen import stdout

if TYPE_CHECKING:
    from morphid.running import Answer


def _fill(request: Request, values: Values) -> None:
    if values["out"] is None and values["plots"] is None:
        raise CommandError(
            "there is no place for the exported file", code=Exit.USAGE, hint="name it with --out FILE"
        )
    options.put_known_model(request, values["parameters"], values["model_id"], values["url"])
    if values["parameters"] is not None:
        _put_origin(request, values["parameters"])


def _put_origin(request: Request, path: Path) -> None:
    """Fill in how well the model fits its samples, if the file contains it."""
    found = read_json(path)
    if "model" not in found:
        return
    option = f"--parameters {path}"
    if "origin" in found:  # the file is an exported model
        request.put("/origin", found["origin"], option)
        return
    for name in ("fit", "verdict"):
        if found.get(name):
            request.put(f"/origin/{name}", found[name], option)


def _save(answer: Answer, path: Path) -> None:
    from morphid.running import wrote

    result = answer.result or {}
    write_bytes(answer.files[str(result["file"])], path)
    wrote(path)


def show_export(result: Mapping[str, Any]) -> None:
    """Print a summary of the written file."""
    stdout().print(f"{result['format']} file of {result['size_bytes']} bytes, SHA-256 {result['sha256']}")


EXPORT = Particulars(
    show_export,
    fill=_fill,
    fills=options.KNOWN_MODEL,
    out="Write the exported file.",
    save=_save,
)
