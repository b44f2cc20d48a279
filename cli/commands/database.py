"""``morphid db``: migrate the database."""

from __future__ import annotations

from typing import Annotated

import typer

from cli.screen import reports_errors

database = typer.Typer(help="Migrate the database.", no_args_is_help=True)


@database.command("upgrade")
@reports_errors
def upgrade_database(revision: Annotated[str, typer.Argument()] = "head") -> None:
    """Migrate the database (MORPHID_DATABASE_URL) up."""
    from cli.migrate import configured_url, upgrade_to

    upgrade_to(configured_url(), revision)


@database.command("downgrade")
@reports_errors
def downgrade_database(revision: Annotated[str, typer.Argument(help="`base` empties the database.")]) -> None:
    """Migrate the database (MORPHID_DATABASE_URL) down."""
    from cli.migrate import configured_url, downgrade_to

    downgrade_to(configured_url(), revision)
