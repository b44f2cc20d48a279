"""``morphid serve``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cli.commands import options
from cli.screen import reports_errors


@reports_errors
def serve(
    host: Annotated[str, typer.Option(help="Address the API listens on.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port of the API; 0 takes a free one.")] = 8000,
    workers: Annotated[int, typer.Option(min=1, max=64, help="Jobs that run at once.")] = 1,
    data_dir: Annotated[Path, typer.Option(help="Database, queue and logs.")] = Path("var"),
    as_json: options.AsJson = False,
) -> None:
    """Run API, worker and broker on this machine until Ctrl-C."""
    from cli.serve import ServeOptions
    from cli.serve import serve as run

    run(ServeOptions(host=host, port=port, workers=workers, data_dir=data_dir, json_events=as_json))
