"""``morphid audit``: who did what."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated

import typer
from rich.markup import escape

from morphid.commands import options
from morphid.database import service_database
from morphid.screen import new_table, print_json, reports_errors, stdout

audit = typer.Typer(help="Look at the audit log.", no_args_is_help=True, epilog=options.EXIT_CODES)

COLUMNS = ("at UTC", "action", "outcome", "owner", "target", "address")


@audit.command("ls")
@reports_errors
def list_entries(
    owner: Annotated[str | None, typer.Option(help="Only actions of this owner.")] = None,
    action: Annotated[
        str | None, typer.Option(help="Only actions of this kind, such as auth.refused.")
    ] = None,
    limit: Annotated[int, typer.Option(min=1, max=10_000, help="Maximum number shown.")] = 50,
    data_dir: options.DataDir = None,
    as_json: options.AsJson = False,
) -> None:
    """List the newest actions: jobs posted, cancelled and deleted, keys made and refused."""
    from app.audit import repository

    with service_database(data_dir) as database, database.read() as session:
        found = repository.list_entries(session, owner=owner, action=action, limit=limit)
    if as_json:
        print_json([{**asdict(each), "at": each.at.isoformat(timespec="milliseconds")} for each in found])
        return
    table = new_table(*COLUMNS, left=len(COLUMNS), wrapped=COLUMNS)
    for entry in found:
        cells = (entry.outcome, entry.owner, entry.target, entry.address)
        table.add_row(f"{entry.at:%m-%d %H:%M:%S}", entry.action, *(escape(cell or "") for cell in cells))
    stdout().print(table)
