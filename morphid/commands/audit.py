"""``morphid audit``: who did what."""

from __future__ import annotations

from typing import Annotated

import typer

from morphid.commands import options
from morphid.screen import print_json, reports_errors, stdout

audit = typer.Typer(help="Look at the audit log.", no_args_is_help=True, epilog=options.EXIT_CODES)


@audit.command("ls")
@reports_errors
def list_entries(
    owner: Annotated[str | None, typer.Option(help="Only deeds of this owner.")] = None,
    action: Annotated[
        str | None, typer.Option(help="Only actions of this kind, such as auth.refused.")
    ] = None,
    limit: Annotated[int, typer.Option(min=1, max=10_000, help="Maximum number shown.")] = 50,
    data_dir: options.DataDir = None,
    as_json: options.AsJson = False,
) -> None:
    """List the newest deeds: jobs posted, cancelled and deleted, keys made and refused."""
    from morphid import audit as work

    found = work.listed(data_dir, owner=owner, action=action, limit=limit)
    if as_json:
        print_json([work.document(entry) for entry in found])
    else:
        stdout().print(work.table(found))
