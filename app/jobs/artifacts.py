"""Files produced by a job, stored as rows."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import PurePosixPath

from sqlalchemy import insert

from app.database import Session, database_time
from app.tables import artifacts
from morphdata.formats import FORMATS

ARTIFACT_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,159}")  # a plain file name: no folder, no dot file

SHOWN_TYPES = {  # displayed by a browser in its window
    ".svg": "image/svg+xml",
    ".png": "image/png",
    ".csv": "text/csv; charset=utf-8",
    ".json": "application/json",
    ".html": "text/html; charset=utf-8",
    ".txt": "text/plain; charset=utf-8",
}
MEDIA_TYPES = {**{each.ending: each.media_type for each in FORMATS}, **SHOWN_TYPES}
OTHER_FILES = "application/octet-stream"
# scripts in a plot or report never run with the service's rights, and types are not guessed
HEADERS = {
    "Content-Security-Policy": "default-src 'none'; style-src 'unsafe-inline'; img-src data:; sandbox",
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "private, max-age=60",
}


def media_type(name: str) -> str:
    """Media type of a file by its extension."""
    return MEDIA_TYPES.get(PurePosixPath(name).suffix.lower(), OTHER_FILES)


def artifact_headers(name: str) -> dict[str, str]:
    """Headers of the response with a file; a plain name needs no quoting."""
    shown = "inline" if media_type(name) in SHOWN_TYPES.values() else "attachment"
    return {**HEADERS, "Content-Disposition": f'{shown}; filename="{name}"'}


def is_plain(name: str) -> bool:
    """Whether a name is a plain file name, as all files of jobs have."""
    return ARTIFACT_NAME.fullmatch(name) is not None


def store_artifacts(session: Session, job_id: str, files: Mapping[str, bytes]) -> None:
    """Store the files of a job that ends; each name must be a plain file name."""
    for name, data in files.items():
        if not is_plain(name):
            raise ValueError(f"artifact name {name!r} is not a plain file name")
        session.execute(
            insert(artifacts).values(
                job_id=job_id,
                name=name,
                media_type=media_type(name),
                size_bytes=len(data),
                data=data,
                at=database_time(),
            )
        )
