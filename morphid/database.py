"""The service's database for commands: found by the settings, migrated, with errors as messages."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from morphid.configured import settings_for
from morphid.exits import CommandError, Exit

if TYPE_CHECKING:
    from app.database import Database


def migrate(migration: Callable[[str, str], None], url: str, revision: str = "head") -> None:
    """Migrate a database with `app.database.upgrade` or `downgrade`; raises CommandError on failure."""
    from alembic.util import CommandError as MigrationError
    from sqlalchemy.exc import OperationalError

    try:
        migration(url, revision)
    except OperationalError as error:
        raise CommandError(
            f"the database cannot be reached: {error.orig}",
            code=Exit.ENVIRONMENT,
            hint="start it, or correct MORPHID_DATABASE_URL; without that variable an SQLite file is used",
        ) from None
    except MigrationError as error:
        raise CommandError(
            f"the database cannot be migrated: {error}",
            code=Exit.ENVIRONMENT,
            hint="a newer version of MorphID may have used it; run that version, or choose another database",
        ) from None


@contextmanager
def service_database(data_dir: Path | None) -> Iterator[Database]:
    """Open the database that the environment names, or the file in `data_dir`, migrated."""
    from app.database import Database, upgrade

    url = settings_for(data_dir=data_dir).database_url
    migrate(upgrade, url)
    database = Database(url)
    try:
        yield database
    finally:
        database.dispose()
