"""Clients of the API that keep count: every 202 goes into the ledger, every other answer has to be honest."""

from __future__ import annotations

import threading
import time
import uuid
from dataclasses import dataclass, field
from typing import Any

import httpx

from tests.app.request_documents import simulate_document
from tests.faults.rig import Rig
from tests.faults.walk_length import flight_steps
from tests.plain_http import CERTIFICATES

ANSWER_S = 30.0  # a client's patience with one answer


@dataclass(frozen=True)
class Answer:
    """One answer, or none: status (None: the connection broke), when it came, how long it took, s."""

    status: int | None
    at: float
    took_s: float
    retry_after: str | None = None
    problem: dict[str, Any] | None = None


@dataclass
class Client:
    """Posts flights, and again with the same key until they are accepted.

    Parameters
    ----------
    rig : whose API is called.
    patience_s : how long one flight is posted again.
    """

    rig: Rig
    patience_s: float = 60.0
    answers: list[Answer] = field(default_factory=list)

    def post(self, *, duration_s: float = 2.5, ends: frozenset[str] = frozenset({"succeeded"})) -> str:
        """Post one flight until it is accepted; give its job."""
        document = {**simulate_document(), "duration_s": duration_s}
        headers = {"Idempotency-Key": str(uuid.uuid4())}
        deadline = time.monotonic() + self.patience_s
        while time.monotonic() < deadline:
            answer, job = self._once(document, headers)
            self.answers.append(answer)
            if answer.status == 202 and job is not None:
                self.rig.ledger.accept(job["id"], flight_steps(duration_s), ends)
                job_id: str = job["id"]
                return job_id
            time.sleep(0.1)
        raise AssertionError(f"not accepted in {self.patience_s} s: {self.answers[-1]}")

    def _once(self, document: Any, headers: dict[str, str]) -> tuple[Answer, dict[str, Any] | None]:
        began = time.monotonic()
        try:
            answer = httpx.post(
                f"{self.rig.url}/simulate",
                json=document,
                headers=headers,
                timeout=ANSWER_S,
                verify=CERTIFICATES,
            )
        except httpx.TransportError:
            return Answer(None, time.monotonic(), time.monotonic() - began), None
        took_s = time.monotonic() - began
        body = answer.json()
        retry_after = answer.headers.get("Retry-After")
        problem = None if answer.status_code == 202 else body
        return Answer(answer.status_code, time.monotonic(), took_s, retry_after, problem), body

    def assert_honest(self, *, may_break: bool) -> None:
        """Every answer was a 202, or a 503 with code and Retry-After; none came late or not at all."""
        for answer in self.answers:
            if answer.status is None:
                assert may_break, "a connection broke"
            elif answer.status != 202:
                assert answer.problem is not None
                assert answer.status == 503, answer
                assert answer.problem["code"] == "database_unavailable"
                assert answer.retry_after is not None

    def took_s(self, *statuses: int | None) -> list[float]:
        """How long the answers of these statuses took, s, shortest first."""
        return sorted(answer.took_s for answer in self.answers if answer.status in statuses)


class Posting(threading.Thread):
    """Posts flights in the background, a given number or until stopped.

    Parameters
    ----------
    client : who posts.
    durations_s : of the flights, one after the other.
    pause_s : between two.
    """

    def __init__(self, client: Client, durations_s: list[float], pause_s: float) -> None:
        super().__init__(daemon=True)
        self.client = client
        self._durations_s = durations_s
        self._pause_s = pause_s
        self.failure: BaseException | None = None

    def run(self) -> None:
        """Post them all."""
        try:
            for duration_s in self._durations_s:
                self.client.post(duration_s=duration_s)
                time.sleep(self._pause_s)
        except BaseException as error:  # noqa: BLE001 - raised again in the test's own thread
            self.failure = error

    def finish(self, within_s: float = 120.0) -> None:
        """Wait for the last answer."""
        self.join(within_s)
        assert not self.is_alive(), "still posting"
        if self.failure is not None:
            raise self.failure


def percentile(sorted_values: list[float], fraction: float) -> float:
    """Value below which the fraction lies; the largest one for the last."""
    return sorted_values[min(len(sorted_values) - 1, int(fraction * len(sorted_values)))]
