"""Options shared by several commands, and their place in a request."""

from __future__ import annotations

from copy import deepcopy
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from morphdata.options import MODEL, OUTPUT
from morphid.connections import KEY_VARIABLE, URL_VARIABLE
from morphid.exits import CommandError, Exit
from morphid.files import read_json
from morphid.request import Request

EXIT_CODES = (
    "Exit codes: 0 done, 1 failed, 2 wrong usage, 3 input refused, 4 cancelled or out of time, 5 no service, "
    "6 machine not ready, 130 Ctrl-C."
)
KNOWN_MODEL = frozenset({"--parameters", "--model-id"})  # see `put_known_model`
HOW_IDENTIFIED = ("lattice", "step_s", "start")  # next to the parameters of an identified model

# headings of option groups in a command's help
model_option = partial(typer.Option, rich_help_panel=MODEL)
answer_option = partial(typer.Option, rich_help_panel=OUTPUT)


class Core(StrEnum):
    """Law that keeps the velocity of a lattice's vortices finite."""

    LINE = "line"
    SMOOTHED = "smoothed"


def setting(name: str, default: str, what: str, **more: Any) -> Any:
    """Declare an option for a setting of the service, in the order option, variable, default.

    The option's own default is None, because `morphid.configured.settings_for` reads the others.
    """
    return typer.Option(
        f"--{name.replace('_', '-')}",
        help=what,
        show_default=f"MORPHID_{name.upper()}, else {default}",
        **more,
    )


DataDir = Annotated[
    Path | None, setting("data_dir", "var", "Database, queue and logs of the service on this machine.")
]
Host = Annotated[str | None, setting("host", "127.0.0.1", "Address the API listens on.")]
Port = Annotated[
    int | None, setting("port", "8000", "Port of the API; 0 selects a free one.", min=0, max=65535)
]
Workers = Annotated[int | None, setting("workers", "1", "Jobs that run at once.", min=1, max=1024)]

# for commands that always use a service
Url = Annotated[str, typer.Option("--url", envvar=URL_VARIABLE, help="Address of the service.")]
API_KEY_HELP = "Key of the service; prefer MORPHID_API_KEY, which does not appear in process listings."
ApiKey = Annotated[
    str | None, typer.Option("--api-key", envvar=KEY_VARIABLE, show_default=False, help=API_KEY_HELP)
]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON.")]

AtUrl = Annotated[
    str | None,
    answer_option("--url", envvar=URL_VARIABLE, help="Run at this service instead of in this process."),
]
AtUrlKey = Annotated[
    str | None, answer_option("--api-key", envvar=KEY_VARIABLE, show_default=False, help=API_KEY_HELP)
]
JsonFile = Annotated[Path | None, answer_option("--json", help="Write the result here; `-` prints it.")]
Plots = Annotated[Path | None, answer_option("--plots", help="Write plots and curves into this folder.")]


def put_known_model(request: Request, parameters: Path | None, model_id: str | None, url: str | None) -> None:
    """Fill in a known equivalent model: from a file, or by the id of a model at a service."""
    if (parameters is None) == (model_id is None):
        raise CommandError(
            f"{'no' if parameters is None else 'more than one'} equivalent model is given",
            code=Exit.USAGE,
            hint="give either --parameters out.json, which `morphid identify --json out.json` writes, "
            "or --model-id",
        )
    if parameters is not None:
        found = _parameters_in(parameters)
        request.put("/model/parameters", found, f"--parameters {parameters}")
        # written out, so that one option (`--core smoothed`) changes only that field
        for name in HOW_IDENTIFIED:
            request.put(f"/model/{name}", deepcopy(found.get(name)), f"--parameters {parameters}")
        return
    if url is None:
        raise CommandError(
            f"--model-id {model_id} names a model at a service",
            code=Exit.USAGE,
            hint="name the service with --url, or give --parameters",
        )
    request.put("/model/model_id", model_id, "--model-id")


def _parameters_in(path: Path) -> dict[str, Any]:
    """Return the model in an identification's result, or the model file itself."""
    found = read_json(path)
    if isinstance(found, dict):
        found = found.get("model", found)
    if not isinstance(found, dict) or "links_per_wing" not in found:
        raise CommandError(
            f"--parameters {path}: it contains no equivalent model",
            code=Exit.INVALID_INPUT,
            hint="give the file written by `morphid identify --json`, or the `model` in it",
        )
    return found
