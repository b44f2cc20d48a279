"""SQL of uploaded trajectories; every read is filtered by owner."""

from __future__ import annotations

from collections.abc import Iterable

from sqlalchemy import delete, insert, select

from app.database import Session, database_time
from app.documents import unpacked_json
from app.errors import TrajectoryNotFound
from app.identifiers import new_identifier
from app.pages import read_page
from app.tables import trajectories
from app.trajectories.schemas import TrajectoryPage, TrajectorySummary, TrajectoryUpload

SUMMARY_COLUMNS = (
    trajectories.c.id,
    trajectories.c.name,
    trajectories.c.rows,
    trajectories.c.duration_s,
    trajectories.c.created_at,
)


def insert_trajectory(
    session: Session, owner: str, key_id: str | None, flight: TrajectoryUpload, document: bytes
) -> TrajectorySummary:
    """Store a flight whose columns were checked; `document` is their stored form."""
    time_s = flight.time_s
    row = session.execute(
        insert(trajectories)
        .values(
            id=new_identifier("traj"),
            owner=owner,
            key_id=key_id,
            name=flight.name,
            rows=len(time_s),
            duration_s=time_s[-1] - time_s[0],
            document=document,
            size_bytes=len(document),
            created_at=database_time(),
        )
        .returning(*SUMMARY_COLUMNS)
    ).one()
    return TrajectorySummary.model_validate(row)


def list_trajectories(session: Session, owner: str, *, cursor: str | None, limit: int) -> TrajectoryPage:
    """One page of the owner's flights."""
    query = select(*SUMMARY_COLUMNS).where(trajectories.c.owner == owner)
    rows, next_cursor = read_page(session, query, trajectories.c.id, cursor=cursor, limit=limit)
    flights = [TrajectorySummary.model_validate(row) for row in rows]
    return TrajectoryPage(trajectories=flights, next_cursor=next_cursor)


def delete_trajectory(session: Session, owner: str, trajectory_id: str) -> None:
    """Delete one flight; jobs that were started with it have copies of their own."""
    deleted = session.execute(
        delete(trajectories)
        .where(trajectories.c.id == trajectory_id, trajectories.c.owner == owner)
        .returning(trajectories.c.id)
    ).one_or_none()
    if deleted is None:
        raise TrajectoryNotFound(trajectory_id)


def row_counts(session: Session, owner: str, ids: Iterable[str]) -> dict[str, int]:
    """Rows of each of the trajectories that `owner` has, without reading them."""
    found = session.execute(
        select(trajectories.c.id, trajectories.c.rows).where(
            trajectories.c.owner == owner, trajectories.c.id.in_(set(ids))
        )
    )
    return {row.id: row.rows for row in found}


def get_trajectory(session: Session, owner: str, trajectory_id: str) -> tuple[TrajectorySummary, bytes]:
    """Read one flight with its rows as the stored JSON text; raise `TrajectoryNotFound` without one."""
    row = session.execute(
        select(trajectories).where(trajectories.c.id == trajectory_id, trajectories.c.owner == owner)
    ).one_or_none()
    if row is None:
        raise TrajectoryNotFound(trajectory_id)
    return TrajectorySummary.model_validate(row), unpacked_json(row.document)
