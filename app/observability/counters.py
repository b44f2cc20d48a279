"""Persistent counters: rows that are incremented in the transaction of the counted event.

Workers that end jobs simultaneously must not wait for each other's commit, so each counter is spread over
`SHARDS` rows and a process writes to one of them; readers add them up.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass

from sqlalchemy import select, text

from app.database import Session
from app.tables import counters

SHARDS = 16
SHARD_MARK = "#"
Labels = Mapping[str, str]

# valid in both databases; the dialects' own INSERT would have to be imported first
RISE = text(
    "INSERT INTO counters (name, value) VALUES (:name, :by) "
    "ON CONFLICT (name) DO UPDATE SET value = counters.value + excluded.value"
)


@dataclass(frozen=True, slots=True)
class Counted:
    """One counter with its labels, summed over its shards."""

    name: str
    labels: Labels
    value: int


def written(name: str, labels: Labels | None = None) -> str:
    """Write a counter as named in its rows: ``jobs_finished{operation=identify,status=failed}``."""
    if not labels:
        return name
    return name + "{" + ",".join(f"{key}={value}" for key, value in sorted(labels.items())) + "}"


def count(session: Session, name: str, labels: Labels | None = None, by: int = 1) -> None:
    """Increment one counter, in the caller's transaction."""
    count_all(session, {written(name, labels): by})


def count_all(session: Session, rises: Mapping[str, int]) -> None:
    """Increment several counters, always in the same order, so that transactions cannot deadlock.

    Parameters
    ----------
    rises : how much by name as `written`.
    """
    shard = f"{SHARD_MARK}{os.getpid() % SHARDS}"
    rows = [{"name": name + shard, "by": by} for name, by in sorted(rises.items()) if by]
    if rows:
        session.execute(RISE, rows)


def read_counters(session: Session) -> list[Counted]:
    """Return every counter, its shards summed, in order of name."""
    sums: dict[str, int] = {}
    for name, value in session.execute(select(counters.c.name, counters.c.value)):
        whole, _, _ = name.rpartition(SHARD_MARK)
        sums[whole or name] = sums.get(whole or name, 0) + int(value)
    return [Counted(*_parsed(name), value) for name, value in sorted(sums.items())]


def _parsed(name: str) -> tuple[str, dict[str, str]]:
    bare, _, rest = name.partition("{")
    pairs = (pair.partition("=") for pair in rest.removesuffix("}").split(",") if pair)
    return bare, {key: value for key, _, value in pairs}
