"""Laws of the threads that kernels run in."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import pytest

from morphcore.stopping import one_at_a_time, stoppable
from morphcore.threads import in_threads, thread_count, use_threads


@pytest.fixture
def two_threads() -> Iterator[None]:
    """Two threads within the test."""
    before = thread_count()
    use_threads(2)
    yield
    use_threads(before)


@pytest.mark.usefixtures("two_threads")
def test_work_inside_of_work_is_done_by_its_own_thread() -> None:
    """A pool whose threads waited for the pool would wait forever; inside it, there is one thread."""
    done: list[tuple[int, int, int, str]] = []

    def outer(i: int) -> None:
        in_threads(lambda j: done.append((i, j, thread_count(), threading.current_thread().name)), 3)

    in_threads(outer, 4)
    assert sorted((i, j) for i, j, _, _ in done) == [(i, j) for i in range(4) for j in range(3)]
    assert {count for _, _, count, _ in done} == {1}
    for i in range(4):
        assert len({name for k, _, _, name in done if k == i}) == 1
    assert thread_count() == 2


@pytest.mark.usefixtures("two_threads")
def test_threads_ask_what_surrounds_their_caller() -> None:
    """A stop that surrounds the caller is shared by the pool's threads, which call it one at a time."""
    asking, requested = threading.Lock(), []

    def surrounding() -> bool:
        assert asking.acquire(blocking=False)
        requested.append(threading.current_thread().name)
        asking.release()
        return len(requested) >= 50

    with stoppable(surrounding):
        stop = one_at_a_time()
    in_threads(lambda _: [stop() for _ in range(30)] and None, 2)
    assert len(requested) == 60
    assert stop()
    assert not one_at_a_time(lambda: False)()
