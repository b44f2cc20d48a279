"""Server-sent events of a job: its history once, then new events, with signs of life in between."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from typing import TypeVar

from fastapi.responses import StreamingResponse
from sqlalchemy.exc import SQLAlchemyError
from starlette.types import Receive, Scope, Send

from app.database_errors import trouble_of
from app.documents import json_bytes
from app.errors import JobNotFound, Unauthorized
from app.http.context import Caller, Service
from app.jobs import repository
from app.jobs.records import Job as StoredJob
from app.jobs.rows import get_job
from app.jobs.schemas import Job, JobEvent, JobEventPage
from app.jobs.watch import Subscription

KEEP_ALIVE = b": keep-alive\n\n"
RETRY = b"retry: 2000\n\n"  # ms until a browser that lost the connection reconnects

Found = TypeVar("Found")


class EventStream(StreamingResponse):
    """The response that follows one of the caller's jobs after event number `after`.

    It counts as one of its owner's streams while it lasts.
    """

    def __init__(self, service: Service, caller: Caller, job_id: str, after: int) -> None:
        super().__init__(
            stream_events(service, caller, job_id, after),
            media_type="text/event-stream",
            headers={"Cache-Control": "no-cache", "X-Accel-Buffering": "no"},
        )
        self._place = service.streams.place(caller.owner)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Respond, or raise `TooManyStreams`."""
        with self._place:
            await super().__call__(scope, receive, send)


def formatted(event: JobEvent) -> bytes:
    """Format one event for the HTML standard's event stream."""
    data = {**event.payload, "seq": event.seq, "at": event.at.isoformat()}
    return f"id: {event.seq}\nevent: {event.type}\ndata: {json_bytes(data).decode()}\n\n".encode()


async def read_in_turn(service: Service, owner: str, read: Callable[[], Found]) -> Found:
    """Read from the database in a thread; the owners of clients that follow jobs take turns."""
    async with service.reads.turn(owner):
        return await asyncio.to_thread(read)


async def stream_events(service: Service, caller: Caller, job_id: str, after: int) -> AsyncIterator[bytes]:
    """Stream the events after number `after`.

    The stream ends when the job has ended or is deleted, when the caller's key is no longer valid, and when
    the service stops.
    """

    def read() -> JobEventPage | None:
        try:
            with service.database.read() as session:
                return repository.event_page(session, caller.owner, job_id, after)
        except JobNotFound:
            return None
        except SQLAlchemyError as error:
            if trouble_of(error) is None:
                raise
            # a browser that gets a 503 does not reconnect; one with a silent stream stays
            return JobEventPage(events=[], last_seq=after, finished=False)

    yield RETRY
    with service.watcher.watch(job_id) as subscription:
        while (page := await read_in_turn(service, caller.owner, read)) is not None:
            for event in page.events:
                yield formatted(event)
            after = page.last_seq
            if page.finished or service.watcher.closed or caller.key.lost:
                return
            if not page.events:
                # the watcher checks the row for all clients: a silent job costs no separate query
                while not await _news(subscription, caller, after, service.settings.keep_alive_s):
                    yield KEEP_ALIVE


async def _news(subscription: Subscription, caller: Caller, seen: int, timeout_s: float) -> bool:
    """Wait for news, or for the end of the caller's permission; False after `timeout_s`."""
    try:
        async with caller.key.while_valid():
            return await subscription.wait(seen, timeout_s)
    except Unauthorized:
        return True


async def wait_for_end(
    service: Service, caller: Caller, job_id: str, timeout_s: float, accepted: StoredJob | None = None
) -> Job:
    """Wait until a job has ended, at most `timeout_s`, and return its state at that time.

    If a job that was just `accepted` is deleted meanwhile, it is returned as last seen, because the post was
    accepted.
    """

    def read() -> StoredJob:
        with service.database.read() as session:
            return get_job(session, caller.owner, job_id)

    def show() -> Job:
        with service.database.read() as session:
            job = get_job(session, caller.owner, job_id)
            return Job.of(job, service.queue.place(session, job))

    try:
        if timeout_s > 0.0:
            loop = asyncio.get_running_loop()
            deadline = loop.time() + timeout_s
            with service.waits.place(caller.owner), service.watcher.watch(job_id) as subscription:
                while True:
                    job = await read_in_turn(service, caller.owner, read)
                    accepted = job if accepted is not None else None
                    left = deadline - loop.time()
                    if job.finished or left <= 0.0 or service.watcher.closed:
                        break
                    async with caller.key.while_valid():
                        await subscription.wait(job.event_seq, left)
        return await read_in_turn(service, caller.owner, show)
    except JobNotFound:
        if accepted is None:
            raise
        return Job.of(accepted)
