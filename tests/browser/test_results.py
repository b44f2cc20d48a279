"""What the page at `/` shows of each operation's result, with the test playing the worker."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tests.app.calls import post
from tests.app.request_documents import (
    OPTIMIZE_RESULT,
    SIMULATE_RESULT,
    STUDY_RESULT,
    optimize_document,
    simulate_document,
    study_document,
)
from tests.app.running_service import RunningService
from tests.browser.jobs import ended, shown

if TYPE_CHECKING:
    from playwright.sync_api import Page


def test_a_study_is_a_table_with_a_recommendation(service: RunningService, page: Page) -> None:
    """One row per number of links, the recommended one marked, its reason, its fit, a link to its model."""
    text = shown(page, service, ended(service, "study", study_document(), STUDY_RESULT))
    assert "1, 2, 3 links, hybrid" in text
    assert STUDY_RESULT["recommended"]["reason"] in text
    assert page.locator("tr.marked td").first.inner_text() == "2 links"
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
    assert "torque" not in text, "unknown values are not shown"
    assert page.get_by_role("heading", name="Duration against variation").is_visible()


def test_a_search_without_a_schedule_shows_none(service: RunningService, page: Page) -> None:
    """A search that was stopped before a schedule flew to its end says so, and shows its warnings."""
    nothing = {name: dict.fromkeys(values) for name, values in OPTIMIZE_RESULT["variation"].items()}
    warning = {"code": "not_flyable", "message": "nothing has flown", "hint": "fly slower", "pointer": ""}
    result = {**OPTIMIZE_RESULT, "schedule": None, "variation": nothing, "warnings": [warning]}
    text = shown(page, service, ended(service, "optimize", optimize_document(), result))
    assert "None was found yet that flies to its end." in text
    assert "1 warning" in text


def test_the_list_tells_operations_apart(service: RunningService, page: Page) -> None:
    """The list shows operation and request, also for waiting jobs."""
    post(service, "/simulate", {**simulate_document(), "duration_s": 1.25}).raise_for_status()
    page.goto(service.url)
    page.get_by_role("cell", name="rigid model, 1.25 s").wait_for(timeout=10_000)
    assert page.get_by_role("cell", name="simulate", exact=True).count() >= 1
