"""What the page at `/` shows of each operation's result, with the test playing the worker."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import pytest

from app.settings import Settings
from tests.app.calls import post
from tests.app.request_documents import (
    OPTIMIZE_RESULT,
    SIMULATE_RESULT,
    STUDY_RESULT,
    Document,
    optimize_document,
    simulate_document,
    study_document,
)
from tests.app.running_service import DEAD_BROKER, RunningService, running_service

if TYPE_CHECKING:
    from playwright.sync_api import Page

PLOT = b"<svg xmlns='http://www.w3.org/2000/svg' width='9' height='9'/>"


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningService]:
    """A service whose worker is the test."""
    url = f"sqlite:///{tmp_path_factory.mktemp('page') / 'service.sqlite3'}"
    with running_service(Settings(database_url=url, broker_url=DEAD_BROKER, event_poll_s=0.05)) as running:
        yield running


def ended(service: RunningService, operation: str, request: Document, result: Document) -> str:
    """Post a job, end it with a result and a plot, give its id."""
    job_id: str = post(service, f"/{operation}", request).raise_for_status().json()["id"]
    files = {"picture.svg": PLOT, "table.csv": b"t\n0\n"}
    service.finish(service.claim(job_id), "succeeded", result=result, artifacts=files)
    return job_id


def shown(page: Page, service: RunningService, job_id: str) -> str:
    """Open a job's view, wait for its result, give its text."""
    page.goto(f"{service.url}/#/jobs/{job_id}")
    page.locator("img[src*='picture.svg']").wait_for(timeout=10_000)
    page.get_by_role("link", name="table.csv").wait_for(timeout=10_000)
    return page.locator("main").inner_text()


def test_a_study_is_a_table_with_a_recommendation(service: RunningService, page: Page) -> None:
    """One row per number of links, the recommended one marked, its reason, its fit, a link to its model."""
    text = shown(page, service, ended(service, "study", study_document(), STUDY_RESULT))
    assert "1, 2, 3 links, hybrid" in text
    assert STUDY_RESULT["recommended"]["reason"] in text
    assert page.locator("tr.marked td").first.inner_text() == "2"
    assert "Fit with 2 links per wing" in text
    page.get_by_role("link", name="identified model").wait_for()


def test_a_flight_is_summed_up(service: RunningService, page: Page) -> None:
    """Model, start, largest departures and speed of a simulated flight."""
    text = shown(page, service, ended(service, "simulate", simulate_document(), SIMULATE_RESULT))
    assert "rigid model, 2.5 s" in text
    assert "Largest departure of θ, mrad\n20.0" in text
    assert "Left tip at the start, m up\n0.27" in text
    assert "Generation" not in text, "a flight has no search"


def test_schedules_are_compared(service: RunningService, page: Page) -> None:
    """Each schedule in each model, the optimum marked, what it gains, and its knots."""
    front = [{"duration_s": 1.5, "variation_rad2": 0.9, "constant_rad2": 1.1}]
    reached = {"optimum": {"max_rate_rad_s": 0.98, "max_accel_rad_s2": 3.0, "max_hinge_torque_nm": None}}
    result = {**OPTIMIZE_RESULT, "reached": reached, "reduction_model": "equivalent", "pareto": front}
    text = shown(page, service, ended(service, "optimize", optimize_document(), result))
    assert "to 1 rad in 2 s, 2 links, hybrid" in text
    assert page.locator("tr.marked td").all_inner_texts() == ["optimum", "0.72", "0.6", "–"]
    assert "25 per cent less than the constant rate, flown in the equivalent model" in text
    assert "Largest rate, rad/s\n0.98 of 1\n" in text
    assert "Largest acceleration, rad/s²\n3\n" in text
    assert "torque" not in text, "nothing is told that is not known"
    assert page.get_by_role("heading", name="Duration against variation").is_visible()


def test_the_list_tells_operations_apart(service: RunningService, page: Page) -> None:
    """The list names operation and what was asked for, for jobs that wait too."""
    post(service, "/simulate", {**simulate_document(), "duration_s": 1.25}).raise_for_status()
    page.goto(service.url)
    page.get_by_role("cell", name="rigid model, 1.25 s").wait_for(timeout=10_000)
    assert page.get_by_role("cell", name="simulate", exact=True).count() >= 1
