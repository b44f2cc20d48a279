"""Keep the lease of a claim on a job or a chunk, and learn soon that its work should stop."""

from __future__ import annotations

import logging
import os
import signal
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from contextvars import copy_context
from enum import Enum
from types import TracebackType
from typing import Self

from sqlalchemy.exc import SQLAlchemyError

from app.database import Database
from app.jobs.records import ChunkClaim, Claim, LeaseState
from app.jobs.store import look_at_lease, renew_lease

log = logging.getLogger(__name__)

STUCK_AFTER_S = 120.0  # work looks at its stop signal every second; if not, a kernel never returned
# a cancelled job must end within two seconds: one for a chunk of work, one for its result
LOOK_EVERY_S = 0.25


class StopReason(Enum):
    """Why running work was asked to stop."""

    CANCEL = "cancel"  # the user wants no more of it
    DEADLINE = "deadline"  # its time is over
    SHUTDOWN = "shutdown"  # this worker ends; another will go on from the checkpoint
    LOST = "lost"  # another claim holds the job now; nothing we write counts


def end_process() -> None:
    """End this process at once: a kernel that never returns hears no signal. The reaper does the rest."""
    os.kill(os.getpid(), signal.SIGKILL)


class LeaseKeeper:
    """A thread that keeps one claim alive while kernels run (they release the GIL).

    Use as a context manager around the work, and hand `should_stop` to it.

    Parameters
    ----------
    database : Database
        The job store.
    claim : Claim or ChunkClaim
        What to keep alive.
    lease_s, heartbeat_s : float
        How long each renewal lasts, and the time between two, s.
    shutting_down : callable
        Whether this worker was asked to end.
    look_every_s : float
        Time between two looks at the row, s.
    on_stuck : callable
        Called when the work has ignored its stop signal for `stuck_after_s`.
    stuck_after_s : float
        Patience with work that was asked to stop, s.
    """

    def __init__(
        self,
        database: Database,
        claim: Claim | ChunkClaim,
        *,
        lease_s: float,
        heartbeat_s: float,
        shutting_down: Callable[[], bool],
        look_every_s: float = LOOK_EVERY_S,
        on_stuck: Callable[[], None] = end_process,
        stuck_after_s: float = STUCK_AFTER_S,
    ) -> None:
        self._database = database
        self._claim = claim
        self._lease_s = lease_s
        self._heartbeat_s = heartbeat_s
        self._shutting_down = shutting_down
        self._look_every_s = min(look_every_s, heartbeat_s)
        self._on_stuck = on_stuck
        self._stuck_after_s = stuck_after_s
        self._work_ended = False
        self._over = threading.Event()
        self._reason: StopReason | None = None
        self._thread = threading.Thread(
            target=copy_context().run,  # its lines say whose job it is
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
        """Why the work should stop, None while it should go on."""
        return self._reason

    def should_stop(self) -> bool:
        """Whether the work should stop; cheap enough to ask between chunks."""
        return self._reason is not None

    def note_work_ended(self) -> None:
        """Note that the work itself has stopped: its end is written as soon as the store lets it."""
        self._work_ended = True

    def look(self) -> None:
        """Look at once, in the caller's thread; what cannot be looked at is looked at later."""
        with suppress(SQLAlchemyError):
            self._judge(self._look())

    def _watch(self) -> None:
        renewed_at = time.monotonic()  # the claim itself began the lease
        asked_at: float | None = None
        while not self._over.wait(self._look_every_s):
            now = time.monotonic()
            try:
                if now - renewed_at >= self._heartbeat_s:
                    self._judge(self._renew())
                    renewed_at = now
                else:
                    self._judge(self._look())
            except SQLAlchemyError as error:
                # The claim is not lost by that: nobody can take the job while the job store is away for all,
                # and if it is away only for us, the fence keeps our writes out.
                log.warning("job %s: lease not renewed: %s", self._claim.job_id, type(error).__name__)
            if self._reason is None and self._shutting_down():
                self._reason = StopReason.SHUTDOWN
            if self._reason is StopReason.LOST:
                break
            if self._reason is not None and not self._work_ended:
                asked_at = now if asked_at is None else asked_at
                if now - asked_at > self._stuck_after_s:
                    break
        patience_s = self._stuck_after_s if self._reason is StopReason.LOST else 0.0
        if not self._over.wait(patience_s):
            log.critical("job %s ignores its stop signal; ending this process", self._claim.job_id)
            self._on_stuck()

    def _look(self) -> LeaseState:
        with self._database.read() as session:
            return look_at_lease(session, self._claim)

    def _renew(self) -> LeaseState:
        with self._database.write() as session:
            return renew_lease(session, self._claim, self._lease_s)

    def _judge(self, state: LeaseState) -> None:
        if not state.held:
            self._reason = StopReason.LOST
        elif self._reason is None and state.cancel_requested:
            self._reason = StopReason.CANCEL
        elif self._reason is None and state.deadline_passed:
            self._reason = StopReason.DEADLINE
