"""A worker's claim on a job or a chunk: renewed, watched, and used for guarded writes."""

from __future__ import annotations

import logging
import os
import signal
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from contextvars import copy_context
from types import TracebackType
from typing import Self, TypeVar

from sqlalchemy.exc import SQLAlchemyError

from app.database import Database, Session
from app.database_errors import DatabaseTrouble, trouble_of
from app.jobs.records import Claim, StopReason
from app.jobs.store import look_at_lease, renew_lease
from morphdata.faults import MorphError

log = logging.getLogger(__name__)
Answer = TypeVar("Answer")

STUCK_AFTER_S = 120.0  # work checks its stop signal every second; otherwise a kernel has not returned
# a cancelled job must end within two seconds: one for a chunk of work, one for its result
LOOK_EVERY_S = 0.25
FIRST_PAUSE_S = 0.5  # before the job store is tried again; doubles
MAX_PAUSE_S = 4.0
FULL_TRIES = 4  # space may be freed meanwhile; after that the job fails with `storage_full`
SHUTDOWN_PATIENCE_S = (
    5.0  # a worker that shuts down waits this long for the job store; then the reaper does the rest
)


class StaleClaim(Exception):
    """The store refused a write: the job is someone else's now."""


class StorageFull(MorphError):
    """The job store has no room for the write; earlier contents are unchanged."""

    code = "storage_full"


def end_process() -> None:
    """End this process at once: a kernel that never returns ignores signals. The reaper does the rest."""
    os.kill(os.getpid(), signal.SIGKILL)


class LeaseKeeper:
    """Keeps one claim alive in a thread while kernels run (they release the GIL).

    Use as a context manager around the work, and hand `should_stop` to it. Transactions are repeated while
    the job store is unreachable: no other worker can take the job meanwhile, and if only this worker is cut
    off, the fence rejects its later writes.

    Parameters
    ----------
    lease_s, heartbeat_s : float
        Duration of each renewal, and the time between two, s.
    shutting_down : callable
        Returns whether a shutdown of this worker was requested.
    look_every_s : float
        Time between two checks of the row, s.
    on_stuck : callable
        Called when the work has ignored its stop signal for `stuck_after_s`.
    """

    def __init__(
        self,
        database: Database,
        claim: Claim,
        *,
        lease_s: float,
        heartbeat_s: float,
        shutting_down: Callable[[], bool],
        look_every_s: float = LOOK_EVERY_S,
        on_stuck: Callable[[], None] = end_process,
        stuck_after_s: float = STUCK_AFTER_S,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self._database = database
        self._claim = claim
        self._lease_s = lease_s
        self._heartbeat_s = heartbeat_s
        self._shutting_down = shutting_down
        self._look_every_s = min(look_every_s, heartbeat_s)
        self._on_stuck = on_stuck
        self._stuck_after_s = stuck_after_s
        self._sleep = sleep
        self._work_ended = False
        self._over = threading.Event()
        self._reason: StopReason | None = None
        self._thread = threading.Thread(
            target=copy_context().run,  # its log lines name the job
            args=(self._watch,),
            name=f"lease-{claim.job_id}",
            daemon=True,
        )

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._over.set()
        self._thread.join()

    @property
    def reason(self) -> StopReason | None:
        """Why the work should stop; None while it should continue."""
        return self._reason

    def should_stop(self) -> bool:
        """Whether the work should stop; cheap enough to call between chunks."""
        return self._reason is not None

    def note_work_ended(self) -> None:
        """Note that the work itself has stopped; its end is written as soon as the store is available."""
        self._work_ended = True

    def look(self) -> None:
        """Check the row at once, in the caller's thread; if the store is away, the thread does it later."""
        with suppress(SQLAlchemyError), self._database.read() as session:
            self._judge(look_at_lease(session, self._claim))

    def read(self, load: Callable[[Session], Answer]) -> Answer:
        """Read in a separate transaction, repeated while the store is unreachable."""

        def once() -> Answer:
            with self._database.read() as session:
                return load(session)

        return self._retried(once)

    def write(self, write: Callable[[Session], bool], *, even_if_full: bool = False) -> None:
        """Write in a separate transaction, repeated while the store is unreachable.

        Parameters
        ----------
        write : callable
            Returns False when the claim is stale.
        even_if_full : bool
            Use the job store's reserve of disk space, for a few rows that must be written.

        Raises
        ------
        StaleClaim
            The store refused the write, or this worker shuts down before the store is back.
        StorageFull
            There is no room.
        """

        def once() -> bool:
            if even_if_full:
                return self._database.write_even_if_full(write)
            with self._database.write() as session:
                return write(session)

        if not self._retried(once):
            raise StaleClaim

    def _retried(self, transaction: Callable[[], Answer]) -> Answer:
        pause_s, tries, shutdown_at = FIRST_PAUSE_S, 0, None
        while True:
            try:
                return transaction()
            except SQLAlchemyError as error:
                trouble, tries = trouble_of(error), tries + 1
                if trouble is None:
                    raise
                if trouble is DatabaseTrouble.FULL and tries == FULL_TRIES:
                    hint = "make room (delete finished jobs, or grow the disk) and submit the job again"
                    message = "the job store has no room for the job's data"
                    raise StorageFull(message, hint=hint) from error
                log.warning("the job store is %s, trying again", trouble.value)
            if self._reason is StopReason.LOST:
                raise StaleClaim
            if self._reason is StopReason.SHUTDOWN:
                shutdown_at = time.monotonic() if shutdown_at is None else shutdown_at
                if time.monotonic() - shutdown_at > SHUTDOWN_PATIENCE_S:
                    raise StaleClaim
            self._sleep(min(pause_s, 1.0) if shutdown_at is not None else pause_s)
            pause_s = min(2.0 * pause_s, MAX_PAUSE_S)

    def _watch(self) -> None:
        renewed_at = time.monotonic()  # the claim itself started the lease
        requested_at: float | None = None
        while not self._over.wait(self._look_every_s):
            now = time.monotonic()
            try:
                if now - renewed_at >= self._heartbeat_s:
                    with self._database.write() as session:
                        found = renew_lease(session, self._claim, self._lease_s)
                    renewed_at = now
                else:
                    with self._database.read() as session:
                        found = look_at_lease(session, self._claim)
                self._judge(found)
            except SQLAlchemyError as error:
                # The claim is not lost: no worker can take the job while the job store is unreachable for
                # all, and if it is unreachable only for us, the fence rejects our writes.
                log.warning("job %s: lease not renewed: %s", self._claim.job_id, type(error).__name__)
            if self._reason is None and self._shutting_down():
                self._reason = StopReason.SHUTDOWN
            if self._reason is StopReason.LOST:
                break
            if self._reason is not None and not self._work_ended:
                requested_at = now if requested_at is None else requested_at
                if now - requested_at > self._stuck_after_s:
                    break
        patience_s = self._stuck_after_s if self._reason is StopReason.LOST else 0.0
        if not self._over.wait(patience_s):
            log.critical("job %s ignores its stop signal; ending this process", self._claim.job_id)
            self._on_stuck()

    def _judge(self, found: StopReason | None) -> None:
        if self._reason is None or found is StopReason.LOST:
            self._reason = found
