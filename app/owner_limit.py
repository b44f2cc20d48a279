"""How many of something one owner may have at once."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from app.errors import ServiceError


class OwnerLimit:
    """Counts what each owner has; used from one thread (the event loop's).

    Parameters
    ----------
    limit : int
        The most that one owner may have.
    refusal
        Makes the error that tells an owner so.
    """

    def __init__(self, limit: int, refusal: Callable[[int], ServiceError]) -> None:
        self._limit = limit
        self._refusal = refusal
        self._held: Counter[str] = Counter()

    def has_room(self, owner: str) -> bool:
        """Whether the owner may have one more."""
        return self._held[owner] < self._limit

    @contextmanager
    def place(self, owner: str) -> Iterator[None]:
        """Have one while the block lasts.

        Raises
        ------
        ServiceError
            The owner has as many as one may have.
        """
        if not self.has_room(owner):
            raise self._refusal(self._limit)
        self._held[owner] += 1
        try:
            yield
        finally:
            self._held[owner] -= 1
            if not self._held[owner]:
                del self._held[owner]
