"""Files of jobs: plain names only, fixed media types, nothing that runs with the service's rights."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.jobs.artifacts import artifact_headers, is_plain, media_type, store_artifacts
from tests.app.request_documents import identify_document
from tests.app.running_service import RunningService
from tests.morphid.test_files import NASTY_NAMES

STATIC = Path(__file__).resolve().parents[3] / "app" / "web" / "static"
SCRIPT = b'<svg xmlns="http://www.w3.org/2000/svg"><script>alert(1)</script></svg>'
# where a text becomes markup or code
SINKS = re.compile(r"innerHTML|outerHTML|insertAdjacentHTML|document\.write|\beval\(|new Function|srcdoc")


@pytest.fixture(scope="module")
def finished(service: RunningService) -> str:
    """A finished job that left files of several kinds."""
    job_id: str = service.client.post("/identify", json=identify_document()).json()["id"]
    files = dict.fromkeys(("a.svg", "report.html", "a.js", "a.xhtml", "a", "b.csv"), SCRIPT)
    service.finish(service.claim(job_id), "succeeded", result={}, artifacts=files)
    return job_id


@pytest.mark.parametrize("name", NASTY_NAMES)
def test_nasty_names_are_not_stored(service: RunningService, finished: str, name: str) -> None:
    """A worker that stores such a name fails; the database never sees it."""
    with service.database.write() as session, pytest.raises(ValueError, match="plain file name"):
        store_artifacts(session, finished, {name: b"x"})


@pytest.mark.parametrize(
    ("name", "kind", "shown"),
    [
        ("a.svg", "image/svg+xml", "inline"),
        ("report.html", "text/html; charset=utf-8", "inline"),
        ("b.csv", "text/csv; charset=utf-8", "inline"),
        ("a.js", "application/octet-stream", "attachment"),
        ("a.xhtml", "application/octet-stream", "attachment"),
        ("a", "application/octet-stream", "attachment"),
    ],
)
def test_files_are_shown_in_a_sandbox(
    service: RunningService, finished: str, name: str, kind: str, shown: str
) -> None:
    """Media types come from a fixed list, nothing is guessed, no script runs, unknown kinds are saved."""
    answer = service.client.get(f"/jobs/{finished}/artifacts/{name}")
    assert (answer.status_code, answer.content) == (200, SCRIPT)
    assert answer.headers["content-type"] == kind
    assert answer.headers["content-disposition"] == f'{shown}; filename="{name}"'
    assert answer.headers["x-content-type-options"] == "nosniff"
    policy = answer.headers["content-security-policy"]
    assert "sandbox" in policy
    assert "default-src 'none'" in policy
    assert "script" not in policy


@given(st.text(max_size=30) | st.from_regex(r"[\w.\\/%\x00-\x20-]{1,30}"))
def test_headers_hold_no_surprise(name: str) -> None:
    """A name that passes needs no quoting: one header, one line, one pair of quotes."""
    if is_plain(name):
        value = artifact_headers(name)["Content-Disposition"]
        assert value.isascii()
        assert value.isprintable()
        assert value.count('"') == 2
        assert media_type(name)


@pytest.mark.parametrize("path", sorted(STATIC.rglob("*.js")), ids=lambda path: path.name)
def test_the_page_makes_no_markup_of_texts(path: Path) -> None:
    """Names of aircraft and samples reach the page as text nodes only."""
    assert SINKS.findall(path.read_text(encoding="utf-8")) == []
