"""Laws of the log."""

from __future__ import annotations

import contextvars
import io
import json
import logging
import threading
from collections.abc import Iterator
from datetime import datetime
from typing import Any

import httpx
import pytest

from app.observability.context import bound
from app.observability.logs import MAX_MESSAGE, make_handler
from tests.app.running_service import RunningService
from tests.waiting import until


class Written:
    """A logger of its own and what it wrote."""

    def __init__(self, kind: str) -> None:
        self.stream = io.StringIO()
        self.logger = logging.Logger("test.logger")  # noqa: LOG001 - nobody else shall find it
        self.logger.addHandler(make_handler(kind, self.stream))

    @property
    def text(self) -> str:
        """Everything written."""
        return self.stream.getvalue()

    @property
    def lines(self) -> list[dict[str, Any]]:
        """Each line as JSON."""
        return [json.loads(line) for line in self.text.splitlines()]

    def wait_for(self, count: int) -> list[dict[str, Any]]:
        """Wait until so many lines are there: a request's is written after its answer went out."""
        until(lambda: len(self.lines) >= count, seen=lambda: self.text)
        return self.lines


@pytest.fixture
def as_json() -> Written:
    """A log for machines."""
    return Written("json")


@pytest.fixture
def as_text() -> Written:
    """A log for eyes."""
    return Written("text")


def test_an_event_is_one_line_of_json(as_json: Written) -> None:
    """Whatever it holds, an event is one line: time in UTC, level, logger, message, facts, exception."""
    try:
        int("two\nlines")
    except ValueError:
        as_json.logger.exception("it\nfailed: %s", "\u2028\ud800")
    as_json.logger.info("fine", extra={"facts": {"number": float("nan"), "route": "/x"}})
    first, second = as_json.lines
    assert (first["level"], first["logger"]) == ("error", "test.logger")
    assert first["message"].startswith("it\nfailed")
    assert first["exception"].endswith(r"'two\nlines'")
    assert datetime.fromisoformat(first["time"]).utcoffset().total_seconds() == 0.0  # type: ignore[union-attr]
    assert (second["number"], second["route"]) == (None, "/x")
    assert "exception" not in second


def test_lines_carry_what_their_work_has_in_common(as_json: Written) -> None:
    """Lines within a block carry its facts and those of blocks around it, in threads too; then no more."""
    with bound(request_id="req_1", job_id=None), bound(job_id="job_1"):
        as_json.logger.info("inside")
        thread = threading.Thread(target=contextvars.copy_context().run, args=(as_json.logger.info, "beside"))
        thread.start()
        thread.join()
    as_json.logger.info("outside")
    inside, beside, outside = as_json.lines
    assert (inside["request_id"], inside["job_id"]) == (beside["request_id"], beside["job_id"])
    assert (inside["request_id"], inside["job_id"]) == ("req_1", "job_1")
    assert not {"request_id", "job_id"} & set(outside)


@pytest.mark.parametrize(
    ("message", "secret"),
    [
        ("key mid_abc123_s3cr3t-Part was refused", "s3cr3t-Part"),
        ("headers: Authorization: Bearer abc.def", "abc.def"),
        ("connecting to redis://:hunter2@broker:6379/0", "hunter2"),
        ("postgresql://morphid:p%40ss@db/morphid does not answer", "p%40ss"),
        ("signed with whsec_c2VjcmV0c2VjcmV0", "c2VjcmV0c2VjcmV0"),
    ],
)
def test_secrets_are_masked(message: str, secret: str) -> None:
    """Secrets that slip into a message or an exception do not reach the log."""
    for kind in ("json", "text"):
        log = Written(kind)
        try:
            int(message)
        except ValueError:
            log.logger.exception("failed: %s", message)
        assert secret not in log.text
        assert "***" in log.text


def test_nobody_forges_a_line(as_text: Written) -> None:
    """What comes from outside neither begins a line of its own nor moves the cursor."""
    as_text.logger.info("GET %s", "/a\n2026-01-01T00:00:00Z info forged: yes\x1b[2J")
    as_text.logger.info("requested", extra={"facts": {"path": "/a\nforged\x1b[2J"}})
    assert "\x1b" not in as_text.text
    assert not any(line.startswith(("2026-01-01", "forged")) for line in as_text.text.splitlines())


def test_a_line_has_an_end(as_json: Written) -> None:
    """A message of a megabyte is cut; one with the wrong arguments is logged all the same."""
    as_json.logger.info("x" * 1_000_000)
    as_json.logger.info("%d apples", "three")
    long, wrong = as_json.lines
    assert len(long["message"]) == MAX_MESSAGE
    assert "apples" in wrong["message"]


@pytest.fixture
def access() -> Iterator[Written]:
    """The access log of the services in this process."""
    written = Written("json")
    logger = logging.getLogger("morphid.access")
    handler = written.logger.handlers[0]
    former, logger.level = logger.level, logging.INFO
    logger.addHandler(handler)
    yield written
    logger.removeHandler(handler)
    logger.setLevel(former)


def test_each_request_leaves_a_line(service: RunningService, access: Written) -> None:
    """Route, status, time and owner; no query, and no lines for probes."""
    service.client.get("/jobs/job_none?token=hush", headers={"X-Request-ID": "mine"})
    service.client.get("/livez")
    service.client.get("/jobs")
    first, second = access.wait_for(2)
    assert first["request_id"] == "mine"
    assert (first["route"], first["path"], first["status"]) == ("/jobs/{job_id}", "/jobs/job_none", 404)
    assert first["owner"] == "local"
    assert 0.0 < first["answered_s"] <= first["duration_s"]
    assert second["route"] == "/jobs"
    assert "hush" not in access.text


def test_a_client_that_goes_away_is_logged(service: RunningService, access: Written) -> None:
    """A client that did not wait for its answer leaves a line too."""
    job = service.client.post("/identify", json=_document()).json()["id"]
    with pytest.raises(httpx.ReadTimeout):
        httpx.get(f"{service.url}/jobs/{job}", headers={"Prefer": "wait=1"}, timeout=0.2)
    assert access.wait_for(2)[-1]["route"] == "/jobs/{job_id}"


def _document() -> Any:
    from tests.app.request_documents import identify_document

    return identify_document()
