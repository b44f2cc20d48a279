"""``morphid ready``: readiness check for containers, and for scripts that wait for a service."""

from __future__ import annotations

import socket
import time
from typing import TYPE_CHECKING, Annotated

import typer

from morphid.commands import options
from morphid.configured import settings_for
from morphid.exits import CommandError, Exit
from morphid.screen import reports_errors, stdout

if TYPE_CHECKING:
    from app.settings import Settings

POLL_S = 0.5


@reports_errors
def ready(
    worker: Annotated[bool, typer.Option("--worker", help="Check only this machine's worker.")] = False,
    wait: Annotated[float, typer.Option(min=0.0, help="Keep trying for this long, s.")] = 0.0,
    data_dir: options.DataDir = None,
) -> None:
    """Exit with 0 if jobs submitted now will run, otherwise with 6."""
    settings = settings_for(data_dir=data_dir)
    deadline = time.monotonic() + wait
    while True:
        is_ready, sentence = _look(settings, worker_here=worker)
        if is_ready:
            stdout().print(sentence, soft_wrap=True)
            return
        if time.monotonic() >= deadline:
            hint = "see `morphid doctor` and the logs of the service's processes"
            raise CommandError(sentence, code=Exit.ENVIRONMENT, hint=hint)
        time.sleep(POLL_S)


def _look(settings: Settings, *, worker_here: bool) -> tuple[bool, str]:
    """Return whether all is well (with `worker_here`, only a worker of this machine), and a description."""
    from app.database import Database
    from app.health.broker import BROKER_GOOD, broker_state
    from app.health.service import database_state

    host = socket.gethostname() if worker_here else None
    store = Database(settings.database_url)
    try:
        database, workers = database_state(store, settings.worker_seen_every_s, host=host)
    finally:
        store.dispose()
    seen = f"database {database}, workers {workers.status} ({workers.alive} alive, {workers.stalled} stalled)"
    if worker_here:
        return workers.status == "ok" and not workers.stalled, seen
    broker = broker_state(settings.broker_url)
    return database == "ok" and workers.status == "ok" and broker in BROKER_GOOD, f"{seen}, broker {broker}"
