"""Jobs for tests of the page, with the test playing the worker, and what the page shows of them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from tests.app.calls import post
from tests.app.request_documents import Document
from tests.app.running_service import RunningService

if TYPE_CHECKING:
    from playwright.sync_api import Page

PLOT = b"<svg xmlns='http://www.w3.org/2000/svg' width='9' height='9'/>"


def posted(service: RunningService, operation: str, request: Document, label: str | None = None) -> str:
    """Post a job, give its id."""
    body = request if label is None else {**request, "execution": {"label": label}}
    job: Document = post(service, f"/{operation}", body).raise_for_status().json()
    return str(job["id"])


def ended(
    service: RunningService, operation: str, request: Document, result: Document, *more_files: str
) -> str:
    """Post a job, end it with a result and a plot, give its id."""
    job_id = posted(service, operation, request)
    files = {"picture.svg": PLOT, "table.csv": b"t\n0\n", **dict.fromkeys(more_files, PLOT)}
    service.finish(service.claim(job_id), "succeeded", result=result, artifacts=files)
    return job_id


def failed(service: RunningService, operation: str, request: Document, **error: Any) -> str:
    """Post a job, let it fail, give its id."""
    job_id = posted(service, operation, request)
    service.finish(service.claim(job_id), "failed", error=error)
    return job_id


def shown(page: Page, service: RunningService, job_id: str) -> str:
    """Open the page of a job that `ended`, wait for its result, give its text."""
    page.goto(f"{service.url}/#/jobs/{job_id}")
    page.locator("img[src*='picture.svg']").wait_for(timeout=10_000)
    page.get_by_role("link", name="table.csv").wait_for(timeout=10_000)
    return page.locator("main").inner_text()
