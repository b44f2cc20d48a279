"""SQL of identified models; every read is filtered by owner."""

from __future__ import annotations

from typing import Any

from sqlalchemy import Row, delete, insert, select, update

from app.database import Session, database_time
from app.documents import Document, packed, unpacked
from app.errors import ModelNotFound
from app.jobs.records import moment
from app.models.schemas import ModelPage, ModelSummary
from app.pages import read_page
from app.tables import jobs, models

NAME_LENGTH = 200

SUMMARY_COLUMNS = (models.c.id, models.c.name, models.c.job_id, models.c.links_per_wing, models.c.created_at)


def insert_model(
    session: Session,
    *,
    model_id: str,
    owner: str,
    job_id: str,
    key_id: str | None,
    request: Document,
    identified: Document,
) -> None:
    """Store an identified model with all that is needed to fly it again.

    Parameters
    ----------
    key_id
        Of the job that identified it; the model counts in this key's stored bytes until it is deleted.
    request
        Of the job that identified it; its aircraft, flight and options are kept.
    identified
        The ``model`` and its ``fit``, see `app.models.extraction`.
    """
    model = identified.get("model") or {}
    aircraft = request.get("aircraft") or {}
    links = model.get("links_per_wing")
    name = str(aircraft.get("name") or "aircraft")
    stored = packed(
        {
            "model": model,
            "fit": identified.get("fit", []),
            "aircraft": aircraft,
            "flight": request.get("flight") or {},
            "options": {**(request.get("model") or {}), "links_per_wing": links},
        }
    )
    session.execute(
        insert(models).values(
            id=model_id,
            owner=owner,
            name=f"{name}, {links} links per wing"[:NAME_LENGTH],
            job_id=job_id,
            links_per_wing=links,
            document=stored,
            created_at=database_time(),
            key_id=key_id,
            size_bytes=len(stored),
        )
    )


def _summary(row: Row[*tuple[Any, ...]]) -> ModelSummary:
    return ModelSummary(
        id=row.id,
        name=row.name,
        links_per_wing=row.links_per_wing,
        job_id=row.job_id,
        created_at=moment(row.created_at),
    )


def list_models(session: Session, owner: str, *, cursor: str | None, limit: int) -> ModelPage:
    """One page of the owner's models."""
    query = select(*SUMMARY_COLUMNS).where(models.c.owner == owner)
    rows, next_cursor = read_page(session, query, models.c.id, cursor=cursor, limit=limit)
    return ModelPage(models=[_summary(row) for row in rows], next_cursor=next_cursor)


def delete_model(session: Session, owner: str, model_id: str) -> None:
    """Delete one model; its job stays, and so do jobs that were started with it.

    Raises
    ------
    ModelNotFound
        When `owner` has no such model.
    """
    deleted = session.execute(
        delete(models).where(models.c.id == model_id, models.c.owner == owner).returning(models.c.job_id)
    ).one_or_none()
    if deleted is None:
        raise ModelNotFound(model_id)
    session.execute(update(jobs).where(jobs.c.id == deleted.job_id).values(model_id=None))


def get_model(session: Session, owner: str, model_id: str) -> tuple[ModelSummary, Document]:
    """Read one model with its document.

    Raises
    ------
    ModelNotFound
        When `owner` has no such model.
    """
    row = session.execute(
        select(*SUMMARY_COLUMNS, models.c.document).where(models.c.id == model_id, models.c.owner == owner)
    ).one_or_none()
    if row is None:
        raise ModelNotFound(model_id)
    return _summary(row), unpacked(row.document)
