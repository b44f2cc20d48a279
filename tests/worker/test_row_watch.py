"""When a worker looks at the rows, and what it makes of the answers."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest
from celery.worker import state
from kombu.asynchronous.semaphore import LaxBoundedSemaphore

from worker import row_watch
from worker.row_watch import ANSWER_WITHIN_S, RowWatch, work_waits


class FakeWorker:
    """A worker with one slot, whose pool records its tasks."""

    use_eventloop = True

    def __init__(self) -> None:
        self.semaphore = LaxBoundedSemaphore(1)
        self.requested: list[dict[str, Callable[[object], None]]] = []
        self.pool = SimpleNamespace(num_processes=1, apply_async=self._apply_async)
        self.consumer = object()
        self.now = 100.0

    def _apply_async(self, target: object, **callbacks: Any) -> None:
        assert target is work_waits
        self.requested.append(callbacks)

    def answer(self, kind: str, value: object) -> None:
        """Answer the last question; the pool gives the slot back, as Celery's does."""
        self.semaphore.release()
        self.requested[-1][kind](value)


@pytest.fixture
def woken(monkeypatch: pytest.MonkeyPatch) -> list[object]:
    """Consumers that were woken."""
    consumers: list[object] = []
    monkeypatch.setattr(row_watch, "wake", consumers.append)
    return consumers


@pytest.fixture
def worker() -> FakeWorker:
    """A worker that is idle."""
    return FakeWorker()


@pytest.fixture
def watch(worker: FakeWorker) -> RowWatch:
    """Its watch."""
    return RowWatch(worker, clock=lambda: worker.now)


def test_waiting_work_wakes_the_worker(worker: FakeWorker, watch: RowWatch, woken: list[object]) -> None:
    """Nothing waits: nothing happens. Something waits: the worker wakes as by a message."""
    watch._look(worker)
    worker.answer("callback", value=False)
    assert woken == []
    watch._look(worker)
    worker.answer("callback", value=True)
    assert woken == [worker.consumer]


def test_a_busy_worker_does_not_look(
    worker: FakeWorker, watch: RowWatch, monkeypatch: pytest.MonkeyPatch
) -> None:
    """While all slots are taken no check is sent, and no answer is pending."""
    monkeypatch.setattr(state, "reserved_requests", {"a request"})
    watch._look(worker)
    worker.now += 3600.0
    assert worker.requested == []
    assert watch.unanswered_s == 0.0


def test_children_that_do_not_answer_are_known(worker: FakeWorker, watch: RowWatch) -> None:
    """One check at a time, another after a while; the time without an answer is reported until one comes."""
    for _ in range(3):
        watch._look(worker)
        worker.now += 1.0
    assert len(worker.requested) == 1
    worker.now += ANSWER_WITHIN_S
    worker.semaphore.release()
    watch._look(worker)
    assert len(worker.requested) == 2
    worker.answer("error_callback", "the child died")
    assert watch.unanswered_s == pytest.approx(3.0 + ANSWER_WITHIN_S)
    watch._look(worker)
    worker.answer("callback", value=False)
    assert watch.unanswered_s == 0.0
