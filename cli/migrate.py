"""Migrate the database; say what is wrong in a sentence."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from cli.exits import CommandError, Exit


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
    CommandError : the settings contradict one another.
    """
    from app.settings import UnsafeSettings, load_settings

    try:
        return load_settings(**({} if data_dir is None else {"data_dir": data_dir})).database_url
    except UnsafeSettings as error:
        raise CommandError(str(error), code=Exit.USAGE) from None


@contextmanager
def _sentences() -> Iterator[None]:
    from alembic.util import CommandError as MigrationError
    from sqlalchemy.exc import ArgumentError, OperationalError

    try:
        yield
    except OperationalError as error:
        raise CommandError(
            f"the database cannot be reached: {error.orig}",
            code=Exit.ENVIRONMENT,
            hint="start it, or correct MORPHID_DATABASE_URL; without that variable an SQLite file is used",
        ) from None
    except ArgumentError as error:
        raise CommandError(
            f"MORPHID_DATABASE_URL: {error}",
            code=Exit.USAGE,
            hint="postgresql://user:password@host:5432/name",
        ) from None
    except MigrationError as error:
        raise CommandError(
            f"the database cannot be migrated: {error}",
            code=Exit.ENVIRONMENT,
            hint="a newer version of MorphID may have used it; run that version, or choose another database",
        ) from None
