"""Gates that are neither lint nor tests: the committed OpenAPI document, and migrations up and down."""

from __future__ import annotations

import difflib
import sys
import tempfile

SHOWN_LINES = 40


def openapi_differences() -> list[str]:
    """Give the lines in which the committed OpenAPI document differs from the one that the code makes."""
    from app.openapi import DOCUMENT, document_text

    committed = DOCUMENT.read_text(encoding="utf-8").splitlines() if DOCUMENT.exists() else []
    made = document_text().splitlines()
    return list(difflib.unified_diff(committed, made, "committed", "made from the code", lineterm="", n=2))


def migration_differences() -> list[str]:
    """Migrate an empty database up, down and up; give what then differs from the declared tables."""
    from alembic.autogenerate import compare_metadata
    from alembic.migration import MigrationContext
    from sqlalchemy import inspect

    from app.database import Database, downgrade, upgrade
    from app.tables import metadata

    with tempfile.TemporaryDirectory() as folder:
        url = f"sqlite:///{folder}/gate.sqlite3"
        upgrade(url)
        downgrade(url, "base")
        database = Database(url)
        left = [name for name in inspect(database.engine).get_table_names() if name != "alembic_version"]
        upgrade(url)
        with database.engine.connect() as connection:
            found = compare_metadata(MigrationContext.configure(connection), metadata)
        database.dispose()
    return [f"table {name} is left behind by the way down" for name in left] + [str(item) for item in found]


def main() -> int:
    """Run the gates and say what is wrong."""
    failed = False
    for name, gate, remedy in (
        (
            "OpenAPI document",
            openapi_differences,
            "write it anew with `make openapi` and read the difference",
        ),
        ("migrations", migration_differences, "write a migration in migrations/versions"),
    ):
        differences = gate()
        sys.stdout.write(f"{name}: {'differs' if differences else 'ok'}\n")
        if differences:
            failed = True
            sys.stdout.write("\n".join([*differences[:SHOWN_LINES], f"-> {remedy}", ""]))
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
