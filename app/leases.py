"""Leased work: rows that one holder may change while its lease lasts.

Jobs, chunks of spread jobs and webhook deliveries are each a `LeasedTable`. A claim is a compare-and-set that
raises the row's fence and sets the end of its lease by the database's clock. All writes of a holder are
conditional on its fence, so a holder that was asleep, cut off or declared dead changes nothing. Every method
takes a `Session`, leaves the commit to its caller, and returns None when the row was not as the caller
believed.

Further actions on a change or end of a row subscribe here and run in the same transaction.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

from sqlalchemy import Column, ColumnElement, Row, Table, update

from app.database import Session, database_time
from app.documents import Document

Key = tuple[str | int, ...]
LeasedRow = Row[*tuple[Any, ...]]


class Held(Protocol):
    """A claim."""

    @property
    def key(self) -> Key:
        """Values of the table's key columns."""

    @property
    def fence(self) -> int:
        """The row's fence as long as the claim holds."""


@dataclass(frozen=True, slots=True)
class Note:
    """The meaning of a change, for its subscribers."""

    event: str  # type of the event in the row's history
    payload: Mapping[str, Any] | None = None  # content of the event
    result: Document | None = None  # the document that the row ends with


Subscriber = Callable[[Session, LeasedRow, Note], None]


@dataclass(eq=False)
class LeasedTable:
    """A table of leased work; it has the columns ``status``, ``fence`` and ``attempt``."""

    table: Table
    key: Sequence[Column[Any]]
    lease: Column[Any]  # until when the claim holds, s since 1970 UTC
    waiting: str  # status of a row that may be claimed
    held: Sequence[str]  # statuses while a claim holds; a claim sets the first
    ends: Collection[str]  # statuses that a row never leaves
    returning: Sequence[Column[Any]]  # columns that the methods return
    unheld: Mapping[str, Any] = field(default_factory=dict)  # columns and values while the row has no holder
    dated: Mapping[str, Any] = field(default_factory=dict)  # columns that every change sets
    noted: Mapping[str, Any] = field(default_factory=dict)  # columns that every change with a `Note` sets
    on_change: list[Subscriber] = field(default_factory=list)  # called after every change with a note
    # Called, in this order, after every change with a note to one of `ends`. None until the subscribers are
    # known (`app.on_end`); no row can end before.
    on_end: Sequence[Subscriber] | None = ()

    def at(self, key: Key) -> tuple[ColumnElement[bool], ...]:
        """Conditions that select one row."""
        return tuple(column == value for column, value in zip(self.key, key, strict=True))

    def held_by(self, claim: Held, *statuses: str) -> tuple[ColumnElement[bool], ...]:
        """Conditions that select the row of a claim as long as the claim holds.

        ``statuses`` take the place of the table's own `held`.
        """
        columns = self.table.c
        holds = columns.fence == claim.fence, columns.status.in_(statuses or self.held)
        return (*self.at(claim.key), *holds)

    def lost(self, now: ColumnElement[float]) -> ColumnElement[bool]:
        """Whether a row's lease ran out before its holder released it."""
        return self.table.c.status.in_(self.held) & (self.lease < now)

    def change(
        self, session: Session, *conditions: ColumnElement[bool], note: Note | None = None, **values: Any
    ) -> LeasedRow | None:
        """Set columns of the row that the conditions select, and return the row as it is now (`returning`).

        Subscribers are called only for a change with a `note`.
        """
        more = {**self.dated, **(self.noted if note is not None else {})}
        row = session.execute(
            update(self.table).where(*conditions).values({**more, **values}).returning(*self.returning)
        ).one_or_none()
        if row is not None and note is not None:
            for subscriber in self.on_change:
                subscriber(session, row, note)
            if row.status in self.ends:
                if self.on_end is None:
                    raise RuntimeError(f"no subscribers for ends of {self.table.name}: import app.on_end")
                for subscriber in self.on_end:
                    subscriber(session, row, note)
        return row

    def take(
        self, session: Session, *conditions: ColumnElement[bool], lease_until: Any, **values: Any
    ) -> LeasedRow | None:
        """Take over a row that the conditions select: only its fence and its lease change by that."""
        leased = {"fence": self.table.c.fence + 1, self.lease.name: lease_until}
        return self.change(session, *conditions, **{**leased, **values})

    def claim(
        self, session: Session, key: Key, *conditions: ColumnElement[bool], lease_until: Any, **values: Any
    ) -> LeasedRow | None:
        """Claim a waiting row; its attempt is counted."""
        columns = self.table.c
        return self.take(
            session,
            *self.at(key),
            columns.status == self.waiting,
            *conditions,
            lease_until=lease_until,
            **{"status": self.held[0], "attempt": columns.attempt + 1, **values},
        )

    def renew(self, session: Session, claim: Held, lease_s: float) -> None:
        """Extend the lease of a claim to `lease_s` from now, unless the claim is stale."""
        lease = {self.lease.name: database_time() + lease_s}
        session.execute(update(self.table).where(*self.held_by(claim)).values(lease))

    def settle(self, session: Session, claim: Held, *statuses: str, **values: Any) -> LeasedRow | None:
        """Change the row of a valid claim, see `held_by`."""
        return self.change(session, *self.held_by(claim, *statuses), **values)

    def give_back(self, session: Session, claim: Held, **values: Any) -> LeasedRow | None:
        """Release the row for other claims; the attempt is not counted."""
        freed = {"status": self.waiting, "attempt": self.table.c.attempt - 1, **self.unheld}
        return self.settle(session, claim, **{**freed, **values})

    def reap(
        self, session: Session, key: Key, fence: int, *conditions: ColumnElement[bool], **values: Any
    ) -> LeasedRow | None:
        """Take a row from a lost holder, with the fence as the reaper saw it.

        Later writes of the holder have no effect; any number of reapers may run at once.
        """
        columns = self.table.c
        freed = {"fence": columns.fence + 1, **self.unheld}
        return self.change(session, *self.at(key), columns.fence == fence, *conditions, **{**freed, **values})
