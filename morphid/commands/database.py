"""``morphid db``: migrate, copy and put back the database."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from morphid.commands import options
from morphid.configured import settings_for
from morphid.database import migrate
from morphid.screen import print_json, reports_errors, stdout

if TYPE_CHECKING:
    from morphid.backup import Backup

database = typer.Typer(help="Migrate, back up and restore the database.", no_args_is_help=True)


@database.command("upgrade")
@reports_errors
def upgrade_database(
    revision: Annotated[str, typer.Argument()] = "head", data_dir: options.DataDir = None
) -> None:
    """Migrate the database up: that of MORPHID_DATABASE_URL, else the one in the data directory."""
    from app.database import upgrade

    migrate(upgrade, settings_for(data_dir=data_dir).database_url, revision)


@database.command("downgrade")
@reports_errors
def downgrade_database(
    revision: Annotated[str, typer.Argument(help="`base` empties the database.")],
    data_dir: options.DataDir = None,
) -> None:
    """Migrate the database down."""
    from app.database import downgrade

    migrate(downgrade, settings_for(data_dir=data_dir).database_url, revision)


@database.command("backup")
@reports_errors
def backup_database(
    target: Annotated[Path, typer.Argument(metavar="FILE", help="New file; must not exist.")],
    data_dir: options.DataDir = None,
    as_json: options.AsJson = False,
) -> None:
    """Copy the SQLite database to FILE while the service keeps running."""
    from morphid.backup import backup

    _show("copied to", backup(settings_for(data_dir=data_dir).database_url, target), as_json=as_json)


@database.command("restore")
@reports_errors
def restore_database(
    source: Annotated[Path, typer.Argument(metavar="FILE", help="Made by `morphid db backup`.")],
    data_dir: options.DataDir = None,
    as_json: options.AsJson = False,
) -> None:
    """Restore the SQLite database from FILE; the service must be stopped."""
    from morphid.backup import restore

    _show("put back to", restore(settings_for(data_dir=data_dir).database_url, source), as_json=as_json)


def _show(what: str, copy: Backup, *, as_json: bool) -> None:
    if as_json:
        facts = {"size_bytes": copy.size_bytes, "jobs": copy.jobs, "revision": copy.revision}
        print_json({"file": str(copy.path), **facts})
        return
    sentence = f"{copy.jobs} jobs, {copy.size_bytes} bytes, revision {copy.revision}: {what} {copy.path}"
    stdout().print(sentence, soft_wrap=True)
