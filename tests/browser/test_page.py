"""The page at `/` in a real browser."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from cli.service import Service
from tests.identification_request import identification
from tests.live import LiveService

if TYPE_CHECKING:
    from playwright.sync_api import Page

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
FLAGS = [
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]

pytestmark = [
    pytest.mark.skipif(CHROMIUM is None, reason="needs Chromium"),
    pytest.mark.timeout(600),  # the first identification on a machine also compiles the kernels
]


@pytest.fixture
def page(tmp_path: Path) -> Iterator[Page]:
    """A page of a fresh browser; what it complains about fails the test."""
    from playwright.sync_api import sync_playwright

    complaints: list[str] = []
    with sync_playwright() as playwright:
        root_flags = ["--no-sandbox"] if os.getuid() == 0 else []  # Chromium's sandbox refuses root
        context = playwright.chromium.launch_persistent_context(
            tmp_path / "profile", executable_path=CHROMIUM, headless=True, args=[*FLAGS, *root_flags]
        )
        page = context.new_page()
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on(
            "console", lambda message: complaints.append(message.text) if message.type == "error" else None
        )
        yield page
        context.close()
    assert complaints == []


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
