"""Laws of the page: it comes whole from this service."""

from __future__ import annotations

import re

import pytest

from app.web.endpoints import STATIC
from tests.app.running_service import RunningService


@pytest.mark.parametrize("path", ["/", "/docs"])
def test_pages_load_nothing_from_elsewhere(service: RunningService, path: str) -> None:
    """Every script, style and picture of a page is served here."""
    page = service.client.get(path)
    assert page.status_code == 200
    parts = re.findall(r"(?:src|href)=\"([^\"#]+)\"", page.text)
    assert parts
    for part in parts:
        assert part.startswith("/")
        assert service.client.get(part).status_code == 200


def test_page_builds_no_html_from_text() -> None:
    """Nothing that a client sent can become markup: the scripts use text nodes only."""
    for script in STATIC.glob("*.js"):
        assert not re.search(
            r"innerHTML|outerHTML|insertAdjacentHTML|document\.write|eval\(", script.read_text()
        )


def test_page_forbids_foreign_scripts(service: RunningService) -> None:
    """The page's policy lets in no inline script and no other host."""
    policy = service.client.get("/").headers["content-security-policy"]
    assert "script-src 'self'" in policy
    assert "unsafe" not in policy
