"""Options that several commands share, and what they become in a request."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from cli.request import Request

EXIT_CODES = (
    "Exit codes: 0 done, 1 failed, 2 wrong usage, 3 input refused, 4 cancelled or out of time, 5 no service, "
    "6 machine not ready, 130 Ctrl-C."
)
DEFAULT_URL = "http://127.0.0.1:8000"

# of commands that talk to a service anyway
Url = Annotated[str, typer.Option(envvar="MORPHID_URL", help="Address of the service.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON for machines.")]

# of operations, which run in this process unless told otherwise
AircraftFile = Annotated[Path, typer.Option("--aircraft", help="Aircraft, JSON.")]
FlightFile = Annotated[Path, typer.Option("--flight", help="Flight condition, JSON.")]
AtUrl = Annotated[str | None, typer.Option("--url", help="Run at this service instead of in this process.")]
JsonFile = Annotated[
    Path | None, typer.Option("--json", help="Write the result to this file; `-` prints it.")
]
Plots = Annotated[Path | None, typer.Option("--plots", help="Write plots and curves into this folder.")]

# sample flights
Samples = Annotated[list[Path], typer.Option("--sample", help="Sample flight to fit, CSV; repeat.")]
HeldOut = Annotated[
    list[Path] | None, typer.Option("--held-out", help="Sample flight to predict, not to fit; repeat.")
]

# searches
Method = Annotated[str | None, typer.Option("--method", help="hybrid, pso or least_squares.")]
Seed = Annotated[int | None, typer.Option("--seed", min=0, help="Same seed, same answer.")]
Particles = Annotated[int | None, typer.Option("--particles", min=2, help="Swarm size.")]
Generations = Annotated[int | None, typer.Option("--generations", min=1, help="Swarm generations.")]
MaxSeconds = Annotated[
    float | None, typer.Option("--max-seconds", min=1.0, help="Stop searching after this long.")
]


def sample_request(
    operation: str, aircraft: Path, flight: Path, samples: Sequence[Path], held_out: Sequence[Path]
) -> Request:
    """Begin a request that has sample flights."""
    request = flight_request(operation, aircraft, flight)
    request.add_samples(samples, "train", "--sample")
    request.add_samples(held_out, "held_out", "--held-out")
    return request


def flight_request(operation: str, aircraft: Path, flight: Path) -> Request:
    """Begin a request about an aircraft in a flight condition."""
    request = Request(operation)
    request.put_file("/aircraft", aircraft, "--aircraft")
    request.put_file("/flight", flight, "--flight")
    return request


def put_search(request: Request, **options: Any) -> None:
    """Fill in how to search; what the user did not choose is left out."""
    request.document.setdefault("search", {})
    for name, value in options.items():
        request.put(f"/search/{name}", value, f"--{name.replace('_', '-')}")
