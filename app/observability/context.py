"""Facts attached to every log line of a piece of work: request id, job id, attempt ..."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_facts: ContextVar[dict[str, str | int]] = ContextVar("morphid_facts")


@contextmanager
def bound(**facts: str | int | None) -> Iterator[dict[str, str | int]]:
    """Attach `facts` to every line logged within the block (None values are omitted).

    Threads started within the block need ``contextvars.copy_context().run`` to inherit them; tasks of asyncio
    and the framework's thread pool do so by themselves.
    """
    token = _facts.set(current_facts() | {name: fact for name, fact in facts.items() if fact is not None})
    try:
        yield _facts.get()
    finally:
        _facts.reset(token)


def current_facts() -> dict[str, str | int]:
    """Return a copy of the facts attached here."""
    return dict(_facts.get({}))


def current_request_id() -> str:
    """Id of the current request; empty outside requests."""
    return str(_facts.get({}).get("request_id", ""))
