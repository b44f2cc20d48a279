"""What ``morphid audit`` reads from the service's database."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.markup import escape
from rich.table import Table

from app.audit import repository
from app.audit.records import Entry
from morphid.keys import service_database


def listed(data_dir: Path | None, *, owner: str | None, action: str | None, limit: int) -> list[Entry]:
    """Read the newest deeds."""
    with service_database(data_dir) as database, database.read() as session:
        return repository.list_entries(session, owner=owner, action=action, limit=limit)


def document(entry: Entry) -> dict[str, Any]:
    """Give a deed as JSON."""
    return {**asdict(entry), "at": entry.at.isoformat(timespec="milliseconds")}


def table(found: Sequence[Entry]) -> Table:
    """Give deeds as a table."""
    made = Table(box=SIMPLE_HEAD, pad_edge=False)
    for title in ("at UTC", "action", "outcome", "owner", "target", "address"):
        made.add_column(title, overflow="fold")
    for entry in found:
        cells = (entry.outcome, entry.owner, entry.target, entry.address)
        made.add_row(f"{entry.at:%m-%d %H:%M:%S}", entry.action, *(escape(cell or "") for cell in cells))
    return made
