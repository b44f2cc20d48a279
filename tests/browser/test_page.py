"""The page at `/` in a real browser."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from morphid.service import Service
from tests.identification_request import identification
from tests.live import LiveService

if TYPE_CHECKING:
    from playwright.sync_api import Page

pytestmark = pytest.mark.timeout(600)  # the first identification on a machine also compiles the kernels


def test_an_identification_is_shown_live(live_service: LiveService, page: Page) -> None:
    """A job posted by a program appears on the page, and its fit and plots are shown when it has ended."""
    page.goto(live_service.url)
    with Service(live_service.url) as service:
        job = service.submit("identify", identification("train_rate_0.8", links=1))
        page.goto(f"{live_service.url}/#/jobs/{job['id']}")
        page.get_by_text(job["id"]).first.wait_for(timeout=10_000)
        *_, ended = service.watch(job["id"])
    assert ended["status"] == "succeeded", ended["error"]
    page.get_by_text("succeeded").first.wait_for(timeout=20_000)
    page.get_by_role("heading", name="Fit").wait_for(timeout=20_000)
    page.get_by_role("cell", name="train_rate_0.8").first.wait_for(timeout=10_000)
    page.locator("img[src*='attitude_train_rate_0.8']").first.wait_for(timeout=20_000)


def test_the_documentation_needs_no_network(live_service: LiveService, page: Page) -> None:
    """The interactive documentation is served from this installation."""
    foreign: list[str] = []
    page.on(
        "request",
        lambda request: None if request.url.startswith(live_service.url) else foreign.append(request.url),
    )
    page.goto(f"{live_service.url}/docs")
    page.get_by_text("/identify").first.wait_for(timeout=20_000)
    assert [url for url in foreign if not url.startswith(("data:", "blob:"))] == []
