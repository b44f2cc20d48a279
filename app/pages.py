"""Pages of a list, newest first; the cursor is the id of the last row shown."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from sqlalchemy import Column, Row, Select

from app.database import Session

Rows = Sequence[Row[*tuple[Any, ...]]]


def read_page(
    session: Session, query: Select[Any], ids: Column[str], *, cursor: str | None, limit: int
) -> tuple[Rows, str | None]:
    """Read at most `limit` rows after `cursor`; return them and the next page's cursor, None on the last.

    ``ids`` is the column with the identifiers, which rise with time.
    """
    if cursor is not None:
        query = query.where(ids < cursor)
    rows = session.execute(query.order_by(ids.desc()).limit(limit + 1)).all()
    return rows[:limit], rows[limit - 1].id if len(rows) > limit else None
