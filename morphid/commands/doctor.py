"""``morphid doctor`` and ``morphid ready``: what is wrong here, and may work begin."""

from __future__ import annotations

from typing import Annotated

import typer

from morphid.commands import options
from morphid.connections import URL_VARIABLE, at_service_of_environment
from morphid.exits import CommandError, Exit
from morphid.screen import print_json, reports_errors, stdout

COLOURS = {"ok": "green", "warn": "yellow", "fail": "red"}


@reports_errors
def doctor(
    url: Annotated[
        str | None,
        typer.Option(
            "--url",
            envvar=URL_VARIABLE,
            help="Examine the service there instead of this installation; not with --data-dir.",
        ),
    ] = None,
    api_key: options.ApiKey = None,
    data_dir: options.DataDir = None,
    as_json: options.AsJson = False,
) -> None:
    """Check this installation and suggest remedies; exit code 6 if a check fails."""
    from morphid.doctor.findings import State
    from morphid.doctor.round import round_here, round_there

    found = []
    if data_dir is not None and at_service_of_environment(url):
        url = None  # an option comes before a variable
    if url is not None and data_dir is not None:
        raise CommandError(
            "--url is a service elsewhere, --data-dir is one here",
            code=Exit.USAGE,
            hint="give one of the two",
        )
    for finding in round_here(data_dir) if url is None else round_there(url, api_key):
        found.append(finding)
        if not as_json:
            console = stdout()
            console.print(f"{finding.state.value:5}", style=COLOURS[finding.state.value], end="")
            console.print(f"{finding.name}: {finding.message}", markup=False, soft_wrap=True)
            if finding.remedy:
                console.print(f"       -> {finding.remedy}", markup=False, soft_wrap=True)
    failed = [finding for finding in found if finding.state is State.FAIL]
    if as_json:
        print_json(
            {"status": "fail" if failed else "ok", "findings": [finding.to_document() for finding in found]}
        )
    if failed:
        raise typer.Exit(int(Exit.ENVIRONMENT))


@reports_errors
def ready(
    worker: Annotated[bool, typer.Option("--worker", help="Check only this machine's worker.")] = False,
    wait: Annotated[float, typer.Option(min=0.0, help="Keep looking for so long, s.")] = 0.0,
    data_dir: options.DataDir = None,
) -> None:
    """Exit with 0 if jobs submitted now will run, otherwise with 6."""
    from morphid.ready import wait_until_ready

    stdout().print(wait_until_ready(data_dir, worker_here=worker, within_s=wait), soft_wrap=True)
