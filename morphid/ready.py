"""May work begin? For health checks of containers and for scripts that wait for a service."""

from __future__ import annotations

import socket
import time
from pathlib import Path
from typing import TYPE_CHECKING

from morphid.configured import settings_for
from morphid.exits import CommandError, Exit

if TYPE_CHECKING:
    from app.settings import Settings

POLL_S = 0.5


def wait_until_ready(data_dir: Path | None, *, worker_here: bool, within_s: float) -> str:
    """Look until all is well or time is up.

    Parameters
    ----------
    worker_here : look only for a worker of this machine (or container) that takes jobs.

    Returns
    -------
    What was seen, as a sentence.

    Raises
    ------
    CommandError : not ready in time; says which part.
    """
    settings = settings_for(data_dir=data_dir)
    deadline = time.monotonic() + within_s
    while True:
        ready, sentence = _look(settings, worker_here=worker_here)
        if ready:
            return sentence
        if time.monotonic() >= deadline:
            raise CommandError(
                sentence, code=Exit.ENVIRONMENT, hint="`morphid doctor` says more, and the logs of its parts"
            )
        time.sleep(POLL_S)


def _look(settings: Settings, *, worker_here: bool) -> tuple[bool, str]:
    from app.database import Database
    from app.health.broker import BROKER_GOOD, broker_state
    from app.health.service import database_state

    host = socket.gethostname() if worker_here else None
    store = Database(settings.database_url)
    try:
        database, workers = database_state(store, settings.worker_seen_every_s, host=host)
    finally:
        store.dispose()
    told = f"database {database}, workers {workers.status} ({workers.alive} alive, {workers.stalled} stalled)"
    if worker_here:
        return workers.status == "ok" and not workers.stalled, told
    broker = broker_state(settings.broker_url)
    return database == "ok" and workers.status == "ok" and broker in BROKER_GOOD, f"{told}, broker {broker}"
