"""Facts that every log line of a piece of work carries: request id, job id, attempt ..."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_facts: ContextVar[dict[str, str | int]] = ContextVar("morphid_facts")


@contextmanager
def bound(**facts: str | int | None) -> Iterator[dict[str, str | int]]:
    """Let every line that is logged within the block carry `facts` (None is left out).

    Threads that begin within the block need ``contextvars.copy_context().run`` to carry them too; tasks of
    asyncio and the framework's thread pool do so by themselves.
    """
    token = _facts.set(current_facts() | {name: fact for name, fact in facts.items() if fact is not None})
    try:
        yield _facts.get()
    finally:
        _facts.reset(token)


def current_facts() -> dict[str, str | int]:
    """What the lines that are logged here carry; a copy."""
    return dict(_facts.get({}))


def current_request_id() -> str:
    """Id of the request that is being served here; empty outside of requests."""
    return str(_facts.get({}).get("request_id", ""))
