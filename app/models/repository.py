"""SQL of identified models; every read is filtered by owner."""

from __future__ import annotations

from sqlalchemy import delete, insert, select, update

from app.database import Session, database_time
from app.documents import Document, packed, unpacked
from app.errors import ModelNotFound
from app.identifiers import new_identifier
from app.jobs.store import load_request
from app.leases import LeasedRow
from app.models.schemas import ModelPage, ModelSummary
from app.pages import read_page
from app.tables import jobs, models
from morphdata.links import shown_per_wing

NAME_LENGTH = 200

SUMMARY_COLUMNS = (models.c.id, models.c.name, models.c.job_id, models.c.links_per_wing, models.c.created_at)


def insert_model(session: Session, job: LeasedRow, identified: Document) -> None:
    """Store the model that a job has identified, with all data needed to fly it again.

    It counts in the stored bytes of the job's key until it is deleted. ``identified`` has the ``model`` and
    its ``fit``; aircraft, flight and options are those of the job's request.
    """
    request = load_request(session, job.id)
    model, aircraft = identified.get("model") or {}, request.get("aircraft") or {}
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
    model_id = new_identifier("model")
    session.execute(
        insert(models).values(
            id=model_id,
            owner=job.owner,
            name=(f"{name}, {shown_per_wing(links)}" if links else name)[:NAME_LENGTH],
            job_id=job.id,
            links_per_wing=max(links.values()) if isinstance(links, dict) else links,
            document=stored,
            created_at=database_time(),
            key_id=job.key_id,
            size_bytes=len(stored),
        )
    )
    session.execute(update(jobs).where(jobs.c.id == job.id).values(model_id=model_id))


def list_models(session: Session, owner: str, *, cursor: str | None, limit: int) -> ModelPage:
    """One page of the owner's models."""
    query = select(*SUMMARY_COLUMNS).where(models.c.owner == owner)
    rows, next_cursor = read_page(session, query, models.c.id, cursor=cursor, limit=limit)
    return ModelPage(models=[ModelSummary.model_validate(row) for row in rows], next_cursor=next_cursor)


def delete_model(session: Session, owner: str, model_id: str) -> None:
    """Delete one model; its job stays, and so do jobs that were started with it."""
    deleted = session.execute(
        delete(models).where(models.c.id == model_id, models.c.owner == owner).returning(models.c.job_id)
    ).one_or_none()
    if deleted is None:
        raise ModelNotFound(model_id)
    session.execute(update(jobs).where(jobs.c.id == deleted.job_id).values(model_id=None))


def get_model(session: Session, owner: str, model_id: str) -> tuple[ModelSummary, Document]:
    """Read one model with its document; raise `ModelNotFound` if the owner has none with this id."""
    row = session.execute(
        select(*SUMMARY_COLUMNS, models.c.document).where(models.c.id == model_id, models.c.owner == owner)
    ).one_or_none()
    if row is None:
        raise ModelNotFound(model_id)
    return ModelSummary.model_validate(row), unpacked(row.document)
