"""The page on a phone: nothing is wider than 390 px."""

from __future__ import annotations

import copy
from typing import TYPE_CHECKING

import pytest

from tests.app.request_documents import (
    OPTIMIZE_RESULT,
    RESULT,
    SIMULATE_RESULT,
    STUDY_RESULT,
    Document,
    identify_document,
    optimize_document,
    simulate_document,
    study_document,
)
from tests.app.running_service import RunningService
from tests.browser.jobs import PLOT, failed, posted
from tests.browser.test_identification import UNCERTAINTY, WARNINGS

if TYPE_CHECKING:
    from playwright.sync_api import Page

PHONE = {"width": 390, "height": 844}
LABEL = "measured_flights_of_" + 79 * "x"  # as long as a label can be, and without a place to break
# the document, and every part that could scroll or hide by itself
TOO_WIDE = """() => [document.documentElement,
        ...document.querySelectorAll('main, .card, table, dl, pre, ul')]
    .filter(part => part.scrollWidth > part.clientWidth && part.clientWidth > 0
                    || part.getBoundingClientRect().right > 390)
    .map(part => `${part.tagName}.${part.className} ${part.scrollWidth} > ${part.clientWidth}`)"""


def wide_identification() -> Document:
    """Give a result with long names and long numbers: two wings of their own, three joints, every remark."""
    own = {
        "links_per_wing": 4,
        "division": 2 * [[0.25, 0.25, 0.25, 0.25]],
        "stiffness_nm_rad": 2 * [3 * [[77618.27780998389, 29410.36461889574, 472500000.000000001]]],
        "damping_nms_rad": 2 * [3 * [[7.000000000000004, 859.2222955622997, 2027.1747171912352]]],
    }
    name, other = "wing_1.stiffness_nm_rad.joint_1.", "wing_2.stiffness_nm_rad.joint_1."
    intervals = {
        f"{name}flap": [57000.0, 104000.0],
        f"{name}torsion": [29000.0, 33000.0],
        f"{name}lag": [None, None],
        f"{other}flap": [-1e9, 1e9],
        f"{other}lag": [None, 4.8e8],
    }
    doubts = {**UNCERTAINTY, "interval_95": intervals, "at_bound": [f"{name}flap", "lift_factor"]}
    fit = {**RESULT["fit"][0], "sample": "flight_of_" + 50 * "y", "J_identified": 2.5608950869167485e-06}
    return {
        **RESULT,
        "model": {**RESULT["model"], **own},
        "uncertainty": doubts,
        "warnings": WARNINGS,
        "fit": [fit],
    }


RESULTS = {
    "identify": (identify_document, wide_identification()),
    "study": (study_document, {**STUDY_RESULT, "warnings": WARNINGS}),
    "simulate": (simulate_document, {**SIMULATE_RESULT, "warnings": WARNINGS}),
    "optimize": (optimize_document, OPTIMIZE_RESULT),
}


def named(document: Document) -> Document:
    """Give the aircraft of a request a long name."""
    changed = copy.deepcopy(document)
    changed["aircraft"]["name"] = "aircraft_" + 60 * "z"
    return changed


@pytest.mark.parametrize("operation", RESULTS)
def test_the_page_of_a_job_fits_a_phone(service: RunningService, page: Page, operation: str) -> None:
    """Neither the page of a running job nor that of a finished one scrolls sideways, whatever its names."""
    document, result = RESULTS[operation]
    page.set_viewport_size(PHONE)
    job_id = posted(service, operation, named(document()), LABEL)
    page.goto(f"{service.url}/#/jobs/{job_id}")
    claim = service.claim(job_id)
    for generation in range(3):
        cost = 0.1**generation
        service.progress(claim, fraction=0.1, generation=generation, best_cost=cost, flights=10**7)
    page.locator("svg.chart").wait_for(timeout=10_000)
    assert page.evaluate(TOO_WIDE) == []
    files = {"picture.svg": PLOT, "curves_" + 60 * "c" + ".csv": b"t\n"}
    service.finish(claim, "succeeded", result=result, artifacts=files)
    page.locator("img[src*='picture.svg']").wait_for(timeout=10_000)
    page.get_by_text("History").click()
    assert page.evaluate(TOO_WIDE) == []


def test_a_failed_job_fits_a_phone(service: RunningService, page: Page) -> None:
    """A long pointer breaks."""
    error = {
        "code": "invalid_input",
        "detail": "d" * 90,
        "pointer": "/samples/0/" + 90 * "p",
        "hint": "h" * 90,
    }
    page.set_viewport_size(PHONE)
    page.goto(f"{service.url}/#/jobs/{failed(service, 'simulate', simulate_document(), **error)}")
    page.get_by_role("heading", name="Failed: invalid_input").wait_for(timeout=10_000)
    assert page.evaluate(TOO_WIDE) == []


@pytest.mark.parametrize("place", ["#/", "#/?label=nobody", "#/help"])
def test_list_and_help_fit_a_phone(service: RunningService, page: Page, place: str) -> None:
    """The list, empty or with long labels, and the help do not scroll sideways."""
    posted(service, "identify", named(identify_document()), LABEL)
    page.set_viewport_size(PHONE)
    page.goto(f"{service.url}/{place}")
    page.locator("main .card pre, tbody tr, .empty").first.wait_for(timeout=10_000)
    assert page.evaluate(TOO_WIDE) == []
