"""Parameters that routes share: identifiers, and the page of a list."""

from __future__ import annotations

from typing import Annotated

from fastapi import Path, Query

ID_PATTERN = r"^[A-Za-z0-9_]{1,64}$"

IdPath = Annotated[str, Path(pattern=ID_PATTERN)]
CursorQuery = Annotated[str | None, Query(pattern=ID_PATTERN, description="From `next_cursor`.")]
LimitQuery = Annotated[int, Query(ge=1, le=200)]
