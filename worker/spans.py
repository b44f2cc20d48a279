"""Spans and log context of an attempt at a job or a chunk."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

from app.jobs.records import ChunkClaim, Claim
from app.observability.context import bound
from app.observability.tracing import past_span, span


@contextmanager
def attempt_span(claim: Claim) -> Iterator[None]:
    """Trace an attempt as part of the request's trace; log lines within the block carry the job."""
    chunk = isinstance(claim, ChunkClaim)
    with bound(job_id=claim.job_id, request_id=claim.request_id, attempt=claim.attempt, worker=claim.worker):
        if not chunk and claim.fence == 1:  # a job that was handed back starts attempt 1 again
            past_span("wait in the queue", seconds=claim.waited_s, traceparent=claim.traceparent)
        with span(
            f"{'chunk' if chunk else 'attempt'} {claim.operation}",
            kind="consumer",
            traceparent=claim.traceparent,
            attributes={
                "morphid.job_id": claim.job_id,
                "morphid.attempt": claim.attempt,
                "morphid.worker": claim.worker,
            },
        ):
            yield


class PhaseSpans:
    """Spans of the phases of a search; a phase begins when the last step of the previous one ends."""

    def __init__(self) -> None:
        self._phase: str | None = None
        self._began = self._last = time.monotonic()

    def note(self, phase: str | None) -> None:
        """Note the phase of a step that has just ended."""
        if phase != self._phase:
            self.close()
            self._phase, self._began = phase, self._last
        self._last = time.monotonic()

    def close(self) -> None:
        """End the current phase."""
        if self._phase is not None:
            now = time.monotonic()
            past_span(self._phase, seconds=self._last - self._began, ago_s=now - self._last)
        self._phase = None
