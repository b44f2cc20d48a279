"""``morphid doctor``: what is wrong here."""

from __future__ import annotations

from dataclasses import asdict
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
        print_json({"status": "fail" if failed else "ok", "findings": [asdict(each) for each in found]})
    if failed:
        raise typer.Exit(int(Exit.ENVIRONMENT))
