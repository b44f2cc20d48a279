"""The API process: ``uvicorn --factory app.main:create_app`` (or ``app.main:app``)."""

from __future__ import annotations

import asyncio
import signal
import threading
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager
from functools import partial
from types import FrameType
from typing import Any

from fastapi import FastAPI

from app import on_end  # noqa: F401 - the API ends jobs: by cancelling, and by its reaper
from app.background_writer import BackgroundWriter
from app.database import Database, upgrade
from app.errors import TooManyStreams
from app.health.endpoints import router as health
from app.health.service import Health
from app.http.body_limit import BodyLimit
from app.http.context import Service
from app.http.gate import Gate
from app.http.middleware import HeadAsGet, RequestId, SecurityHeaders
from app.http.observed import Observed
from app.http.problems import install_problem_handlers
from app.jobs.endpoints import router as jobs
from app.jobs.queue import Publisher
from app.jobs.upkeep import Upkeep
from app.jobs.waiting import QueueView
from app.jobs.watch import JobWatcher
from app.keys.endpoints import router as keys
from app.keys.keyring import KeyRing
from app.keys.watch import KeyWatch
from app.models.endpoints import router as models
from app.observability.logs import configure_logging
from app.observability.tracing import start_tracing, stop_tracing
from app.openapi import openapi_document
from app.operations.endpoints import router as operations
from app.owner_turns import OwnerLimit, OwnerTurns
from app.parsing.confinement import Limits
from app.parsing.pool import ParserPool
from app.settings import Settings, load_settings
from app.trajectories.endpoints import router as trajectories
from app.web.endpoints import mount_static
from app.web.endpoints import router as web
from app.webhooks.addresses import AddressPolicy
from app.webhooks.endpoints import router as webhooks
from app.webhooks.sender import SenderSettings, WebhookSender
from morphdata.version import VERSION

READS_AT_ONCE = 4  # of the event loop's threads, of which there are five or more; the watchers need some too


def routed_app() -> FastAPI:
    """Return the application with its routes, without settings, database or broker."""
    app = FastAPI(title="MorphID", version=VERSION, docs_url=None, redoc_url=None)
    data = (trajectories, models, webhooks, keys)
    for router in (operations, jobs, *data, health, web):
        app.include_router(router)
    mount_static(app)
    app.openapi = lambda: openapi_document(app)  # type: ignore[method-assign]  # FastAPI's documented way
    return app


def create_app(settings: Settings | None = None, *, sending: SenderSettings | None = None) -> FastAPI:
    """Build the service; database and messages are opened when it starts.

    Without `settings` they are read from the environment; they also determine whether webhooks are sent.
    """
    chosen = settings or load_settings()
    if settings is None:  # in its own process, not embedded in another application
        configure_logging(chosen.log_format, chosen.log_level)
    app = routed_app()
    app.router.lifespan_context = partial(
        _running, settings=chosen, sending=sending or _sender_settings(chosen)
    )
    install_problem_handlers(app)
    app.add_middleware(HeadAsGet)
    app.add_middleware(BodyLimit, settings=chosen)
    app.add_middleware(Gate, settings=chosen)  # added last, it runs first: no body is read for strangers
    # these see every response, including those to unexpected errors, which the framework sends outside its
    # middleware
    inner = app.build_middleware_stack
    app.build_middleware_stack = lambda: RequestId(Observed(SecurityHeaders(inner())))  # type: ignore[method-assign]
    return app


def _sender_settings(settings: Settings) -> SenderSettings:
    return SenderSettings(
        AddressPolicy(allow_private=settings.webhook_allow_private, dial_only=settings.webhook_hosts)
    )


def _turns(settings: Settings, at_once: int) -> OwnerTurns:
    """Slots of which each owner leaves one to the others, unless there is only one owner."""
    return OwnerTurns(at_once, max(1, at_once - 1) if settings.demands_keys else at_once)


def _service(settings: Settings, database: Database, sending: SenderSettings) -> Service:
    background = BackgroundWriter(database)
    keys = KeyRing(database, background)
    return Service(
        settings=settings,
        database=database,
        publisher=Publisher(settings.broker_url),
        watcher=JobWatcher(database, settings.event_poll_s),
        queue=QueueView(),
        keys=keys,
        key_watch=KeyWatch(database, on_lost=keys.forget),
        background=background,
        parsers=ParserPool(_turns(settings, settings.parsers), Limits(settings.parser_memory_bytes)),
        reads=_turns(settings, READS_AT_ONCE),
        streams=OwnerLimit(settings.max_streams_per_owner, TooManyStreams.of_streams),
        waits=OwnerLimit(settings.max_streams_per_owner, TooManyStreams.of_waits),
        webhook_policy=sending.policy,
        health=Health(database, settings),
    )


@asynccontextmanager
async def _running(app: FastAPI, settings: Settings, sending: SenderSettings) -> AsyncIterator[None]:
    """Start the parts of the process, and stop them when the block ends."""
    start_tracing("morphid-api", settings.traces)
    await asyncio.to_thread(upgrade, settings.database_url)
    database = Database(settings.database_url)
    service = app.state.service = _service(settings, database, sending)
    sender = WebhookSender(database, sending)
    upkeep = Upkeep(database, service.publisher, settings)
    service.background.start()
    service.publisher.start()
    service.watcher.start()
    service.key_watch.start()
    sender.start()
    upkeep.start()
    try:
        with _streams_end_with_the_process(service.watcher):
            yield
    finally:
        await service.watcher.stop()
        await service.key_watch.stop()
        for stop in (upkeep.stop, sender.stop, service.publisher.stop, service.background.stop):
            await asyncio.to_thread(stop)
        database.dispose()
        await asyncio.to_thread(stop_tracing)


@contextmanager
def _streams_end_with_the_process(watcher: JobWatcher) -> Iterator[None]:
    """End event streams on SIGTERM and SIGINT: the server waits for open responses before it stops."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    loop = asyncio.get_running_loop()
    former = {number: signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGINT)}

    def on_signal(number: int, frame: FrameType | None) -> None:
        loop.call_soon_threadsafe(watcher.close)
        handler = former[signal.Signals(number)]
        if callable(handler):
            handler(number, frame)

    for number, handler in former.items():
        if callable(handler):  # leave the defaults alone: something else then ends the process
            signal.signal(number, on_signal)
    try:
        yield
    finally:
        for number, handler in former.items():
            if callable(handler):
                signal.signal(number, handler)


def __getattr__(name: str) -> Any:
    """Build ``app.main:app`` when a server looks it up, not on import."""
    if name == "app":
        return create_app()
    raise AttributeError(name)
