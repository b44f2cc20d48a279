"""A real server with the application in a thread of the test, so that tests can play the worker."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import httpx
import uvicorn

from app.database import Database
from app.http.server import KEEP_ALIVE_S, GuardedConfig
from app.jobs import store
from app.jobs.records import Claim
from app.main import create_app
from app.settings import Settings
from app.webhooks.sender import SenderSettings
from tests.app.webhooks.receiver import TO_LOOPBACK
from tests.plain_http import CERTIFICATES

DEAD_BROKER = "redis://127.0.0.1:1/0"  # nothing listens there: every test runs with the broker away
NOTHING_IS_SENT = SenderSettings(
    TO_LOOPBACK, poll_s=3600.0
)  # addresses are checked, as if loopback were public
START_S = 60.0  # in vain, on a machine that has other things to do
# a kept connection is used again well before the server may close it, or a request meets its end
KEPT = httpx.Limits(keepalive_expiry=KEEP_ALIVE_S / 5)


@dataclass(frozen=True)
class RunningService:
    """One server, a client of it, and its database."""

    url: str
    client: httpx.Client
    database: Database
    settings: Settings

    def claim(self, job_id: str) -> Claim:
        """Play a worker that takes up the job."""
        with self.database.write() as session:
            claim = store.claim_job(session, job_id, "a test")
        assert claim is not None
        return claim

    def progress(self, claim: Claim, **progress: Any) -> None:
        """Play a worker that reports progress."""
        with self.database.write() as session:
            assert store.save_progress(session, claim, progress, b"state")

    def finish(self, claim: Claim, status: str, **end: Any) -> None:
        """Play a worker that ends the job."""
        with self.database.write() as session:
            assert store.finish_job(session, claim, status, **end)


@contextmanager
def running_service(
    settings: Settings, sending: SenderSettings | None = NOTHING_IS_SENT
) -> Iterator[RunningService]:
    """Serve until the block ends.

    Parameters
    ----------
    sending : how webhooks are sent; as the settings say when None, and not at all when left out.
    """
    app = create_app(settings, sending=sending)
    config = GuardedConfig(app, settings, port=0, log_level="error", timeout_graceful_shutdown=2)
    server = uvicorn.Server(config)
    thread = threading.Thread(target=server.run, daemon=True)
    thread.start()
    deadline = time.monotonic() + START_S
    while not server.started:
        assert thread.is_alive(), "the server did not start"
        assert time.monotonic() < deadline, "the server takes too long to start"
        time.sleep(0.01)
    port = server.servers[0].sockets[0].getsockname()[1]
    url = f"http://127.0.0.1:{port}"
    database = Database(settings.database_url)
    try:
        with httpx.Client(base_url=url, timeout=30.0, limits=KEPT, verify=CERTIFICATES) as client:
            yield RunningService(url, client, database, settings)
    finally:
        server.should_exit = True
        thread.join(10.0)
        database.dispose()
