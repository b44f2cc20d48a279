"""Server-sent events of a job: every row of its history once, then what comes, with signs of life between."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator

from sqlalchemy.exc import SQLAlchemyError

from app.database_errors import trouble_of
from app.documents import json_bytes
from app.errors import JobNotFound
from app.http.context import Service
from app.jobs import service as jobs
from app.jobs.records import Job as StoredJob
from app.jobs.rows import get_job
from app.jobs.schemas import Job, JobEvent, JobEventPage

KEEP_ALIVE = b": keep-alive\n\n"
RETRY = b"retry: 2000\n\n"  # ms until a browser that lost the connection asks again


def formatted(event: JobEvent) -> bytes:
    """Format one event as the HTML standard's event stream wants it."""
    data = {**event.payload, "seq": event.seq, "at": event.at.isoformat()}
    return f"id: {event.seq}\nevent: {event.type}\ndata: {json_bytes(data).decode()}\n\n".encode()


async def stream_events(service: Service, owner: str, job_id: str, after: int) -> AsyncIterator[bytes]:
    """Stream the events after number `after` until the job has ended, is deleted, or the service stops."""

    def read() -> JobEventPage | None:
        try:
            with service.database.read() as session:
                return jobs.event_page(session, owner, job_id, after)
        except JobNotFound:
            return None
        except SQLAlchemyError as error:
            if trouble_of(error) is None:
                raise
            # a browser that is answered 503 never comes back; one whose stream is silent stays
            return JobEventPage(events=[], last_seq=after, finished=False)

    yield RETRY
    with service.watcher.watch(job_id) as subscription:
        while (page := await asyncio.to_thread(read)) is not None:
            for event in page.events:
                yield formatted(event)
            after = page.last_seq
            if page.finished or service.watcher.closed:
                return
            if not page.events:
                # the watcher has looked at the row for everyone: a silent job costs no query of its own
                while not await subscription.wait(after, service.settings.keep_alive_s):
                    yield KEEP_ALIVE


async def wait_for_end(service: Service, owner: str, job_id: str, timeout_s: float) -> Job:
    """Wait until a job has ended, at most `timeout_s`, and show it as it is then."""

    def read() -> StoredJob:
        with service.database.read() as session:
            return get_job(session, owner, job_id)

    def show() -> Job:
        with service.database.read() as session:
            return jobs.shown(session, service.queue, get_job(session, owner, job_id))

    if timeout_s <= 0.0:
        return await asyncio.to_thread(show)
    loop = asyncio.get_running_loop()
    deadline = loop.time() + timeout_s
    with service.watcher.watch(job_id) as subscription:
        while True:
            job = await asyncio.to_thread(read)
            left = deadline - loop.time()
            if job.finished or left <= 0.0 or service.watcher.closed:
                return await asyncio.to_thread(show)
            await subscription.wait(job.event_seq, left)
