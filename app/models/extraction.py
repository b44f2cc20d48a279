"""Model extraction: which identified model a finished job leaves, and its row.

That of an identification, the recommended one of a study. A model that does not fly the samples it was fitted
to is none.
"""

from __future__ import annotations

from sqlalchemy import update

from app.database import Session
from app.documents import Document
from app.identifiers import new_identifier
from app.jobs.records import JobStatus
from app.jobs.store import load_request
from app.leases import LeasedRow, Note
from app.models.repository import insert_model
from app.tables import jobs
from morphdata.operations import OPERATIONS
from morphdata.parameters import has_flown


def store_extracted(session: Session, job: LeasedRow, note: Note) -> None:
    """Store the model in the result of a job that has succeeded, if there is one."""
    if job.status != JobStatus.SUCCEEDED.value or note.result is None:
        return
    identified = extracted_model(job.operation, note.result)
    if identified is None:
        return
    model_id = new_identifier("model")
    insert_model(
        session,
        model_id=model_id,
        owner=job.owner,
        job_id=job.id,
        key_id=job.key_id,
        request=load_request(session, job.id),
        identified=identified,
    )
    session.execute(update(jobs).where(jobs.c.id == job.id).values(model_id=model_id))


def extracted_model(operation: str, result: Document) -> Document | None:
    """Find the identified model in a result, as an object with its ``model`` and its ``fit``.

    None for results that hold none.
    """
    descriptor = next((each for each in OPERATIONS if each.name == operation), None)
    found = None if descriptor is None else descriptor.model_in(result)
    if found is None or found.get("model") is None or not has_flown(found.get("fit")):
        return None
    return found
