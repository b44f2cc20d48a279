"""``morphid db``: migrate, copy and put back the database."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from morphid.commands import options
from morphid.screen import print_json, reports_errors, stdout

if TYPE_CHECKING:
    from morphid.backup import Backup

database = typer.Typer(help="Migrate, back up and restore the database.", no_args_is_help=True)


@database.command("upgrade")
@reports_errors
def upgrade_database(
    revision: Annotated[str, typer.Argument()] = "head", data_dir: options.DataDir = None
) -> None:
    """Migrate the database up: MORPHID_DATABASE_URL's, else the one in the data directory."""
    from morphid.migrate import configured_url, upgrade_to

    upgrade_to(configured_url(data_dir), revision)


@database.command("downgrade")
@reports_errors
def downgrade_database(
    revision: Annotated[str, typer.Argument(help="`base` empties the database.")],
    data_dir: options.DataDir = None,
) -> None:
    """Migrate the database down."""
    from morphid.migrate import configured_url, downgrade_to

    downgrade_to(configured_url(data_dir), revision)


@database.command("backup")
@reports_errors
def backup_database(
    target: Annotated[Path, typer.Argument(metavar="FILE", help="New file; must not exist.")],
    data_dir: options.DataDir = None,
    as_json: options.AsJson = False,
) -> None:
    """Copy the SQLite database to FILE while the service goes on."""
    from morphid.backup import backup
    from morphid.migrate import configured_url

    _say("copied to", backup(configured_url(data_dir), target), as_json=as_json)


@database.command("restore")
@reports_errors
def restore_database(
    source: Annotated[Path, typer.Argument(metavar="FILE", help="Made by `morphid db backup`.")],
    data_dir: options.DataDir = None,
    as_json: options.AsJson = False,
) -> None:
    """Restore the SQLite database from FILE; the service must be stopped."""
    from morphid.backup import restore
    from morphid.migrate import configured_url

    _say("put back to", restore(configured_url(data_dir), source), as_json=as_json)


def _say(what: str, copy: Backup, *, as_json: bool) -> None:
    if as_json:
        print_json(
            {
                "file": str(copy.path),
                "size_bytes": copy.size_bytes,
                "jobs": copy.jobs,
                "revision": copy.revision,
            }
        )
    else:
        stdout().print(
            f"{copy.jobs} jobs, {copy.size_bytes} bytes, revision {copy.revision}: {what} {copy.path}",
            soft_wrap=True,
        )
