"""The page at `/` on a service that demands keys."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import pytest

from app.keys.service import revoke_key
from app.settings import Settings
from tests.app.key_holders import holder, make_key
from tests.app.request_documents import SIMULATE_RESULT, simulate_document
from tests.app.running_service import DEAD_BROKER, RunningService, running_service

if TYPE_CHECKING:
    from playwright.sync_api import Page

PLOT = b"<svg xmlns='http://www.w3.org/2000/svg' width='9' height='9'/>"


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningService]:
    """A service that demands keys, whose worker is the test."""
    url = f"sqlite:///{tmp_path_factory.mktemp('page') / 'service.sqlite3'}"
    settings = Settings(database_url=url, broker_url=DEAD_BROKER, auth="keys", event_poll_s=0.05)
    with running_service(settings) as running:
        yield running


def enter(page: Page, key: str) -> None:
    """Type a key."""
    page.get_by_label("API key").fill(key)
    page.get_by_role("button", name="Use this key").click()


@pytest.mark.refused_requests
def test_the_page_asks_for_a_key_and_works_with_it(service: RunningService, page: Page) -> None:
    """The key opens list, live progress, plots and files; it stays in this tab, forgotten on request."""
    made = make_key(service.database, "laboratory")
    with holder(service, made.text) as client:
        job = client.post("/simulate", json=simulate_document()).raise_for_status().json()["id"]
    page.goto(service.url)
    page.get_by_role("heading", name="This service needs an API key").wait_for(timeout=10_000)
    enter(page, "mid_nonsense")
    page.get_by_role("heading", name="This key is not valid").wait_for(timeout=10_000)
    enter(page, made.text)
    page.get_by_role("cell", name="rigid model, 2.5 s").wait_for(timeout=10_000)
    page.get_by_text("laboratory").wait_for()
    assert page.evaluate("localStorage.length") == 0
    assert page.context.cookies() == []

    page.goto(f"{service.url}/#/jobs/{job}")
    claim = service.claim(job)
    service.progress(claim, fraction=0.25, message="a quarter")
    page.get_by_text("a quarter").first.wait_for(timeout=10_000)
    files = {"picture.svg": PLOT, "table.csv": b"t\n0\n"}
    service.finish(claim, "succeeded", result=SIMULATE_RESULT, artifacts=files)
    picture = page.locator("img[alt='picture']")
    picture.wait_for(timeout=10_000)
    picture.evaluate("image => image.decode()")  # fails where the file is no picture
    with page.expect_download() as saved:
        page.get_by_role("link", name="table.csv").click()
    assert saved.value.path().read_bytes() == b"t\n0\n"

    page.reload()
    page.locator("img[alt='picture']").wait_for(timeout=10_000)
    page.get_by_role("button", name="Forget the key").click()
    page.get_by_label("API key").wait_for(timeout=10_000)
    assert page.evaluate("sessionStorage.length") == 0


@pytest.mark.refused_requests
def test_a_revoked_key_is_asked_for_anew(service: RunningService, page: Page) -> None:
    """A list that is open when its key is revoked prompts for another."""
    made = make_key(service.database, "leaving")
    page.goto(service.url)
    enter(page, made.text)
    page.get_by_text("No jobs yet").wait_for(timeout=10_000)
    with service.database.write() as session:
        revoke_key(session, made.key.prefix)
    page.get_by_role("heading", name="This key is not valid").wait_for(timeout=15_000)


def test_the_documentation_needs_no_key(service: RunningService, page: Page) -> None:
    """The document is public, and takes a key to try calls with."""
    page.goto(f"{service.url}/docs")
    page.get_by_text("/identify").first.wait_for(timeout=20_000)
    page.get_by_role("button", name="Authorize").first.wait_for(timeout=10_000)
