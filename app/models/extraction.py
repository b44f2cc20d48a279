"""Model extraction: finds the identified model of a finished job.

It is the model of an identification, or the recommended one of a study. A model that cannot fly the samples
it was fitted to does not count.
"""

from __future__ import annotations

from app.database import Session
from app.documents import Document
from app.jobs.records import JobStatus
from app.leases import LeasedRow, Note
from app.models.repository import insert_model
from morphdata.operations import OPERATIONS
from morphdata.parameters import has_flown


def store_extracted(session: Session, job: LeasedRow, note: Note) -> None:
    """Store the model in the result of a job that has succeeded, if there is one."""
    if job.status == JobStatus.SUCCEEDED.value and note.result is not None:
        identified = extracted_model(job.operation, note.result)
        if identified is not None:
            insert_model(session, job, identified)


def extracted_model(operation: str, result: Document) -> Document | None:
    """Find the identified model in a result: an object with its ``model`` and its ``fit``."""
    descriptor = next((each for each in OPERATIONS if each.name == operation), None)
    found = None if descriptor is None else descriptor.model_in(result)
    if found is None or found.get("model") is None or not has_flown(found.get("fit")):
        return None
    return found
