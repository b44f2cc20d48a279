"""Laws of quotas, on both databases."""

from __future__ import annotations

import threading
from types import SimpleNamespace
from typing import Any

import pytest
from sqlalchemy import delete, insert, select, update

from app.database import Database, Session, database_time
from app.errors import QuotaExceeded
from app.keys import quota
from app.keys.records import Quota, Usage
from app.leases import Note
from app.tables import jobs, key_usage, trajectories
from tests.app.key_holders import make_key

RACERS = 8
NOTHING = Usage(jobs_in_flight=0, flights_today=0, stored_bytes=0)


def put_job(database: Database, key_id: str, number: int = 0, **values: Any) -> str:
    """Write a job's row as a post does: the charge first."""
    job_id = f"job_{key_id}_{number}"
    row: dict[str, Any] = {"status": "queued", "flights_estimated": 0, "size_bytes": 0, **values}
    zero = dict.fromkeys(("priority", "attempt", "fence", "event_seq"), 0)
    with database.write() as session:
        quota.charge(session, key_id, flights=row["flights_estimated"], size_bytes=row["size_bytes"])
        session.execute(
            insert(jobs).values(
                id=job_id,
                owner="alpha",
                operation="identify",
                summary={},
                max_attempts=3,
                partial=False,
                published_at=database_time(),
                created_at=database_time(),
                updated_at=database_time(),
                key_id=key_id,
                **zero,
                **row,
            )
        )
    return job_id


def used(database: Database, key_id: str) -> Usage:
    """What the key uses."""
    with database.read() as session:
        return quota.usage(session, key_id)


def today(database: Database) -> int:
    """The day that charges of now are counted to."""
    with database.read() as session:
        return quota.usage_day(session.scalar(select(database_time())) or 0.0)


def end_job(session: Session, key_id: str | None, *, estimated: int, flown: int, day: int) -> None:
    """Let a job that was posted on a day end, as far as the quota sees of it."""
    row: Any = SimpleNamespace(
        key_id=key_id, flights_estimated=estimated, flights=flown, created_at=day * quota.DAY_S + 1.0
    )
    quota.settle(session, row, Note("succeeded"))


def test_jobs_in_flight_are_those_that_have_not_ended(database: Database) -> None:
    """At the limit the next post is refused with limit and use; an ended job makes room."""
    key_id = make_key(database, quota=Quota(max_jobs_in_flight=2)).key.id
    first = put_job(database, key_id, 1)
    put_job(database, key_id, 2, status="running")
    with pytest.raises(QuotaExceeded) as refused:
        put_job(database, key_id, 3)
    assert refused.value.members["quota"] == {"name": "jobs_in_flight", "limit": 2, "used": 2, "asked": 1}
    assert int(refused.value.headers["Retry-After"]) > 0
    with database.write() as session:
        session.execute(update(jobs).where(jobs.c.id == first).values(status="succeeded"))
    put_job(database, key_id, 3)


def test_flights_are_charged_by_estimate_and_settled_by_what_was_flown(database: Database) -> None:
    """A job counts its estimate while it runs and its flights afterwards, on the day it was posted."""
    key_id = make_key(database, quota=Quota(max_flights_per_day=1000)).key.id
    put_job(database, key_id, 1, flights_estimated=900)
    with pytest.raises(QuotaExceeded) as refused:
        put_job(database, key_id, 2, flights_estimated=101)
    assert refused.value.members["quota"]["used"] == 900
    assert int(refused.value.headers["Retry-After"]) <= quota.DAY_S
    with database.write() as session:
        end_job(session, key_id, estimated=900, flown=250, day=today(database))
    assert used(database, key_id).flights_today == 250
    put_job(database, key_id, 2, flights_estimated=750)
    with database.write() as session:
        end_job(session, key_id, estimated=750, flown=1200, day=today(database))
    assert used(database, key_id).flights_today == 1450, "what was flown is counted even beyond the limit"
    with pytest.raises(QuotaExceeded):
        put_job(database, key_id, 3, flights_estimated=1)


def test_days_are_counted_apart(database: Database) -> None:
    """Yesterday's flights do not fill today's quota; a late end corrects the day of the post."""
    key_id = make_key(database, quota=Quota(max_flights_per_day=10)).key.id
    day = today(database)
    with database.write() as session:
        session.execute(insert(key_usage).values(key_id=key_id, day=day - 1, flights=10))
    put_job(database, key_id, 1, flights_estimated=10)
    with database.write() as session:
        end_job(session, key_id, estimated=10, flown=4, day=day - 1)
        end_job(session, key_id, estimated=100, flown=0, day=day - 2)  # nothing was charged there
    with database.read() as session:
        rows = session.execute(select(key_usage.c.day, key_usage.c.flights).order_by(key_usage.c.day))
        assert [tuple(row) for row in rows] == [(day - 1, 4), (day, 10)]


def test_a_correction_never_gives_credit(database: Database) -> None:
    """Settling more than was charged ends at nothing, not below."""
    key_id = make_key(database).key.id
    put_job(database, key_id, 1, flights_estimated=5)
    with database.write() as session:
        end_job(session, key_id, estimated=50, flown=0, day=today(database))
    assert used(database, key_id).flights_today == 0


def test_stored_bytes_are_those_of_jobs_and_flights(database: Database) -> None:
    """Both kinds of rows count; what is deleted makes room."""
    key_id = make_key(database, quota=Quota(max_stored_bytes=100)).key.id
    job_id = put_job(database, key_id, 1, size_bytes=60)
    with database.write() as session:
        quota.charge_bytes(session, key_id, 40)
        session.execute(
            insert(trajectories).values(
                id="traj_1",
                owner="alpha",
                name="a",
                rows=2,
                duration_s=1.0,
                document=b"",
                created_at=database_time(),
                key_id=key_id,
                size_bytes=40,
            )
        )
    assert used(database, key_id).stored_bytes == 100
    with pytest.raises(QuotaExceeded, match="stored bytes"), database.write() as session:
        quota.charge_bytes(session, key_id, 1)
    with database.write() as session:
        session.execute(delete(jobs).where(jobs.c.id == job_id))
    assert used(database, key_id).stored_bytes == 40
    put_job(database, key_id, 2, size_bytes=60)


def test_a_refused_charge_leaves_no_trace(database: Database) -> None:
    """The refusal rolls back with its transaction."""
    key_id = make_key(database, quota=Quota(max_jobs_in_flight=0)).key.id
    with pytest.raises(QuotaExceeded):
        put_job(database, key_id, 1, flights_estimated=7, size_bytes=7)
    assert used(database, key_id) == NOTHING


def test_keys_do_not_pay_for_one_another(database: Database) -> None:
    """Quotas are a key's, not its owner's; without a key nothing is counted or refused."""
    full = make_key(database, quota=Quota(max_jobs_in_flight=1)).key.id
    other = make_key(database, quota=Quota(max_jobs_in_flight=1)).key.id
    put_job(database, full, 1)
    put_job(database, other, 1)
    assert used(database, full).jobs_in_flight == used(database, other).jobs_in_flight == 1
    with database.write() as session:
        quota.charge(session, None, flights=10**9, size_bytes=10**12)
        end_job(session, None, estimated=10**9, flown=0, day=0)


@pytest.mark.parametrize(
    ("limits", "row"),
    [
        (Quota(max_jobs_in_flight=3), {}),
        (Quota(max_flights_per_day=30), {"flights_estimated": 10}),
        (Quota(max_stored_bytes=30), {"size_bytes": 10}),
    ],
)
def test_posts_that_race_for_the_last_place_do_not_share_it(
    database: Database, limits: Quota, row: dict[str, int]
) -> None:
    """Of many posts at once exactly as many pass as there is room for."""
    key_id = make_key(database, quota=limits).key.id
    together = threading.Barrier(RACERS)
    passed: list[int] = []

    def post(number: int) -> None:
        together.wait()
        try:
            put_job(database, key_id, number, **row)
        except QuotaExceeded:
            return
        passed.append(number)

    racers = [threading.Thread(target=post, args=(number,)) for number in range(RACERS)]
    for racer in racers:
        racer.start()
    for racer in racers:
        racer.join()
    assert len(passed) == 3
    assert used(database, key_id).jobs_in_flight == 3


def test_charges_add_up(database: Database) -> None:
    """No charge is lost when keys without a limit are charged at once."""
    key_id = make_key(database).key.id
    racers = [
        threading.Thread(target=put_job, args=(database, key_id, number), kwargs={"flights_estimated": 11})
        for number in range(RACERS)
    ]
    for racer in racers:
        racer.start()
    for racer in racers:
        racer.join()
    assert used(database, key_id).flights_today == 11 * RACERS
