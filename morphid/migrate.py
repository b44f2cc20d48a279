"""Migrate the database; say what is wrong in a sentence."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from morphid.configured import settings_for
from morphid.exits import CommandError, Exit


def upgrade_to(url: str, revision: str = "head") -> None:
    """Migrate up.

    Raises
    ------
    CommandError : the database is out of reach, or knows a revision that this version does not.
    """
    from app.database import upgrade

    with _sentences():
        upgrade(url, revision)


def downgrade_to(url: str, revision: str) -> None:
    """Migrate down; ``base`` empties the database.

    Raises
    ------
    CommandError : as above.
    """
    from app.database import downgrade

    with _sentences():
        downgrade(url, revision)


def configured_url(data_dir: Path | None = None) -> str:
    """Give the database that the environment names, or the file in `data_dir`.

    Raises
    ------
    CommandError : a setting is refused.
    """
    return settings_for(data_dir=data_dir).database_url


@contextmanager
def _sentences() -> Iterator[None]:
    from alembic.util import CommandError as MigrationError
    from sqlalchemy.exc import OperationalError

    try:
        yield
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
