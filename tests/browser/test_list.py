"""The list of jobs: labels, filters that stand in the address, the way to a job by keyboard."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from playwright.sync_api import expect

from tests.app.request_documents import SIMULATE_RESULT, identify_document, simulate_document
from tests.app.running_service import RunningService
from tests.browser.jobs import ended, failed, posted

if TYPE_CHECKING:
    from playwright.sync_api import Page


def rows(page: Page, count: int) -> list[str]:
    """Wait for so many jobs in the list and give their labels."""
    expect(page.locator("tbody tr")).to_have_count(count, timeout=10_000)
    return [text for text in page.locator("tbody tr td:first-child").all_inner_texts() if "…" not in text]


def test_filters_narrow_the_list_and_stand_in_the_address(service: RunningService, page: Page) -> None:
    """Status (several), operation and label narrow the list; a reload keeps them; clearing shows all."""
    posted(service, "identify", identify_document(), "wing B, third fit")
    failed(service, "simulate", simulate_document(), code="diverged", detail="it does")
    ended(service, "simulate", simulate_document(), SIMULATE_RESULT)
    page.goto(service.url)
    assert rows(page, 3) == ["wing B, third fit"]
    page.get_by_label("Operation").select_option("simulate")
    rows(page, 2)
    page.get_by_label("failed").check()
    rows(page, 1)
    assert page.locator("tbody .pill").all_inner_texts() == ["failed"]
    page.get_by_label("queued").check()
    expect(page).to_have_url(f"{service.url}/#/?status=queued&status=failed&operation=simulate")
    page.reload()
    rows(page, 1)
    assert page.get_by_label("failed").is_checked()
    assert not page.get_by_label("succeeded").is_checked()
    assert page.get_by_label("Operation").input_value() == "simulate"

    page.get_by_role("button", name="Clear filters").click()
    rows(page, 3)
    page.get_by_label("Label").fill("wing B, third fit")
    assert rows(page, 1) == ["wing B, third fit"]
    expect(page).to_have_url(f"{service.url}/#/?label=wing+B%2C+third+fit")
    page.get_by_label("Label").fill("wing B")
    page.get_by_text("No job matches these filters.").wait_for(timeout=10_000)


def test_an_address_with_unknown_filters_shows_the_list(service: RunningService, page: Page) -> None:
    """What the service does not know is left out of the question, and nothing of an address becomes HTML."""
    posted(service, "simulate", simulate_document(), "<img src=x>")
    page.goto(f"{service.url}/#/?status=lost&operation=fly&label=%3Cimg%20src%3Dx%3E")
    assert rows(page, 1) == ["<img src=x>"]
    assert page.get_by_label("Label").input_value() == "<img src=x>"


def test_older_jobs_stay_when_a_new_one_comes(service: RunningService, page: Page) -> None:
    """The list grows by its older jobs, and a new job comes first without pushing any out."""
    for number in range(27):
        posted(service, "simulate", simulate_document(), f"of many {number}")
    page.goto(service.url)
    rows(page, 25)
    page.get_by_role("button", name="Older jobs").click()
    page.get_by_role("link", name="of many 0", exact=True).wait_for(timeout=10_000)
    before = page.locator("tbody tr").count()
    posted(service, "simulate", simulate_document(), "the newest")
    assert rows(page, before + 1)[0] == "the newest"


def test_a_job_is_opened_by_keyboard(service: RunningService, page: Page) -> None:
    """Every job is a link with its label as name, and keeps the focus when the list is read again."""
    job_id = posted(service, "simulate", simulate_document(), "by keyboard")
    page.goto(service.url)
    page.get_by_role("link", name="by keyboard").focus()
    service.progress(service.claim(job_id), fraction=0.5)
    page.get_by_role("progressbar", name="progress").and_(page.locator("[aria-valuenow='50']")).wait_for()
    page.keyboard.press("Enter")
    page.get_by_role("heading", name="simulate: ").wait_for(timeout=10_000)
    assert page.url.endswith(job_id)


def test_help_and_documentation_are_linked(service: RunningService, page: Page) -> None:
    """The page leads to help on its numbers, to the documentation of the API and to its document."""
    page.goto(service.url)
    page.get_by_role("link", name="Help").click()
    page.get_by_role("heading", name="Parameters").wait_for(timeout=10_000)
    for name, path in (("API", "/docs"), ("OpenAPI", "/openapi.json")):
        assert (
            page.get_by_role("navigation").get_by_role("link", name=name, exact=True).get_attribute("href")
            == path
        )
        service.client.get(path).raise_for_status()


def test_every_link_to_help_has_its_place(service: RunningService, page: Page) -> None:
    """A card's link to help opens the part that explains it."""
    page.goto(f"{service.url}/#/jobs/{ended(service, 'simulate', simulate_document(), SIMULATE_RESULT)}")
    page.get_by_role("link", name="Help: Flight").click()
    page.get_by_role("heading", name="Simulated flight", exact=True).wait_for(timeout=10_000)
    assert page.evaluate("scrollY") > 0
    scripts = "".join(
        service.client.get(f"/static/{name}.js").text for name in ("results", "parameters", "chart")
    )
    named = set(page.evaluate("[...document.querySelectorAll('[id^=help-]')].map(part => part.id.slice(5))"))
    assert set(re.findall(r'help: "([a-z]+)"', scripts)) <= named
