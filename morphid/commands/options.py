"""Options that several commands share, and what they become in a request."""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from morphid.connections import KEY_VARIABLE, URL_VARIABLE
from morphid.exits import CommandError, Exit
from morphid.files import matching_files, read_json
from morphid.request import Request

EXIT_CODES = (
    "Exit codes: 0 done, 1 failed, 2 wrong usage, 3 input refused, 4 cancelled or out of time, 5 no service, "
    "6 machine not ready, 130 Ctrl-C."
)
HOW_IDENTIFIED = ("lattice", "step_s", "start")  # stand beside the parameters of an identified model

# groups of options, as a command's help shows them
flight_option = partial(typer.Option, rich_help_panel="Aircraft and flights")
model_option = partial(typer.Option, rich_help_panel="Model")
search_option = partial(typer.Option, rich_help_panel="Search")
answer_option = partial(typer.Option, rich_help_panel="Where it runs, and where the answer goes")


class Core(StrEnum):
    """What keeps the velocity of a lattice's vortices finite."""

    LINE = "line"
    SMOOTHED = "smoothed"


class Start(StrEnum):
    """Where a flight starts."""

    TRIM = "trim"
    GIVEN = "given"


def setting(name: str, default: str, what: str, **more: Any) -> Any:
    """Describe an option that is a setting of the service: the option, then its variable, then the default.

    The option's own default is None, for `morphid.configured.settings_for` reads the others.
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
    int | None, setting("port", "8000", "Port of the API; 0 takes a free one.", min=0, max=65535)
]
Workers = Annotated[int | None, setting("workers", "1", "Jobs that run at once.", min=1, max=1024)]

# of commands that talk to a service anyway
Url = Annotated[str, typer.Option("--url", envvar=URL_VARIABLE, help="Address of the service.")]
API_KEY_HELP = "Key of the service; better set MORPHID_API_KEY, which no process list shows."
ApiKey = Annotated[
    str | None, typer.Option("--api-key", envvar=KEY_VARIABLE, show_default=False, help=API_KEY_HELP)
]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON for machines.")]

AircraftFile = Annotated[Path, flight_option("--aircraft", help="Aircraft, JSON.")]
FlightFile = Annotated[Path, flight_option("--flight", help="Flight condition, JSON.")]
Samples = Annotated[
    list[Path],
    flight_option(
        "--sample", help="Sample flights to fit: CSV, JSON, Parquet, MATLAB; several, or a pattern."
    ),
]
HeldOut = Annotated[
    list[Path] | None,
    flight_option("--held-out", help="Sample flights to predict, not to fit; several, or a pattern."),
]

Parameters = Annotated[
    Path | None, model_option("--parameters", help="Equivalent model: result of an identification, JSON.")
]
ModelId = Annotated[
    str | None, model_option("--model-id", help="Instead of --parameters: a model identified at the --url.")
]
Elements = Annotated[
    int | None, model_option("--elements", min=1, help="Beam elements of each wing of the flexible model.")
]
Chordwise = Annotated[int | None, model_option("--chordwise", min=1, help="Lattice panels along the chord.")]
Spanwise = Annotated[int | None, model_option("--spanwise", min=1, help="Lattice panels along the span.")]
VortexCore = Annotated[Core | None, model_option("--core", help="Core of the lattice's vortices.")]
StartAt = Annotated[
    Start | None, model_option("--start", help="Trim each model by itself, or start as the flight file says.")
]

Method = Annotated[str | None, search_option("--method", help="hybrid, least_squares, cma or pso.")]
Seed = Annotated[int | None, search_option("--seed", min=0, help="Same seed, same answer.")]
Particles = Annotated[int | None, search_option("--particles", min=2, help="Swarm size.")]
Generations = Annotated[int | None, search_option("--generations", min=1, help="Swarm generations.")]
MaxSeconds = Annotated[
    float | None, search_option("--max-seconds", min=1.0, help="Stop searching after this long.")
]
WarmStart = Annotated[
    Path | None, search_option("--warm-start", help="Begin from the model of this earlier result (JSON).")
]

AtUrl = Annotated[
    str | None,
    answer_option("--url", envvar=URL_VARIABLE, help="Run at this service instead of in this process."),
]
AtUrlKey = Annotated[
    str | None, answer_option("--api-key", envvar=KEY_VARIABLE, show_default=False, help=API_KEY_HELP)
]
JsonFile = Annotated[Path | None, answer_option("--json", help="Write the result here; `-` prints it.")]
Plots = Annotated[Path | None, answer_option("--plots", help="Write plots and curves into this folder.")]


def sample_request(
    operation: str, aircraft: Path, flight: Path, samples: Sequence[Path], held_out: Sequence[Path]
) -> Request:
    """Begin a request that has sample flights."""
    request = flight_request(operation, aircraft, flight)
    request.add_samples(matching_files(samples, "--sample"), "train", "--sample")
    request.add_samples(matching_files(held_out, "--held-out"), "held_out", "--held-out")
    return request


def flight_request(operation: str, aircraft: Path, flight: Path) -> Request:
    """Begin a request about an aircraft in a flight condition."""
    request = Request(operation)
    request.put_file("/aircraft", aircraft, "--aircraft")
    request.put_file("/flight", flight, "--flight")
    return request


def put_known_model(request: Request, parameters: Path | None, model_id: str | None, url: str | None) -> None:
    """Fill in an equivalent model that is known already: a file, or the id of a model at a service.

    Raises
    ------
    CommandError : neither or both are given, or an id without a service.
    """
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
        # told outright, so that one option (`--core smoothed`) changes that alone
        for name in HOW_IDENTIFIED:
            request.put(f"/model/{name}", deepcopy(found.get(name)), f"--parameters {parameters}")
        return
    if url is None:
        raise CommandError(
            f"--model-id {model_id} names a model at a service",
            code=Exit.USAGE,
            hint="say at which one with --url, or give --parameters",
        )
    request.put("/model/model_id", model_id, "--model-id")


def _parameters_in(path: Path) -> dict[str, Any]:
    """Give the model in an identification's result, or the model that the file is."""
    found = read_json(path)
    if isinstance(found, dict):
        found = found.get("model", found)
    if not isinstance(found, dict) or "links_per_wing" not in found:
        raise CommandError(
            f"--parameters {path}: there is no equivalent model in it",
            code=Exit.INVALID_INPUT,
            hint="give the file that `morphid identify --json` wrote, or the `model` in it",
        )
    return found


def put_search(request: Request, **options: Any) -> None:
    """Fill in how to search; what the user did not choose is left out."""
    request.document.setdefault("search", {})
    for name, value in options.items():
        request.put(f"/search/{name}", value, f"--{name.replace('_', '-')}")


def put_lattice(
    request: Request, pointer: str, *, chordwise: int | None, spanwise: int | None, core: Core | None
) -> None:
    """Fill in the vortex lattice at a pointer."""
    request.put(f"{pointer}/chordwise", chordwise, "--chordwise")
    request.put(f"{pointer}/spanwise", spanwise, "--spanwise")
    request.put(f"{pointer}/core/law", core, "--core")
