"""One attempt at one job: work step by step with checkpoints; every way it can end has its own branch."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from enum import Enum

from app.database import Database, Session
from app.jobs.chunks import Flown, flown, hand_out
from app.jobs.records import Claim, JobStatus
from app.jobs.store import finish_job, load_checkpoint, release_job, save_progress
from worker.job_cache import JobCache
from worker.lease import LeaseKeeper, StopReason
from worker.numerics import Kernels
from worker.operations import (
    Begin,
    Document,
    Outcome,
    SpreadWork,
    Step,
    UnknownOperation,
    Work,
    WorkInterrupted,
    WorkRefused,
)
from worker.progress import Pace, rated
from worker.retry import Retry, StaleClaim, StorageFull
from worker.spans import PhaseSpans

log = logging.getLogger(__name__)

# a generation may take milliseconds; two writes a second serve the user's eye and the disk
SAVE_EVERY_S = 0.5


class Ending(Enum):
    """What became of one wake-up."""

    NOTHING_QUEUED = "nothing queued"
    SUCCEEDED = "succeeded"
    FAILED = "failed"
    CANCELLED = "cancelled"
    EXPIRED = "expired"
    RELEASED = "released"  # back in the queue with its checkpoint
    ABANDONED = "abandoned"  # another claim holds the job
    HANDED_OUT = "handed out"  # its next generation lies in chunks that any worker may fly
    CHUNK_STORED = "chunk stored"


ENDINGS = {
    JobStatus.SUCCEEDED: Ending.SUCCEEDED,
    JobStatus.FAILED: Ending.FAILED,
    JobStatus.CANCELLED: Ending.CANCELLED,
    JobStatus.EXPIRED: Ending.EXPIRED,
}


class Attempt:
    """The work on one claimed job.

    Parameters
    ----------
    database : Database
        The job store.
    claim : Claim
        The right to write to the job.
    keeper : LeaseKeeper
        Keeps the claim alive and knows when to stop.
    kernels : Kernels
        The compiled kernels of this process.
    cache : JobCache
        The work of the jobs that this process saw last.
    clock : callable
        Seconds that only rise.
    sleep : callable
        Waits a number of seconds.

    Attributes
    ----------
    handed_out : int
        Number of chunks that the job was given up for; publish as many messages.
    """

    def __init__(
        self,
        database: Database,
        claim: Claim,
        keeper: LeaseKeeper,
        kernels: Kernels,
        cache: JobCache | None = None,
        *,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self._claim = claim
        self._keeper = keeper
        self._kernels = kernels
        self._cache = cache or JobCache()
        self._clock = clock
        self._store = Retry(database, keeper, clock=clock, sleep=sleep)
        self.handed_out = 0
        self._chunks = 0
        self._pace = Pace(clock)
        self._phases = PhaseSpans(clock=clock)
        self._work: Work | None = None
        self._checkpoint: bytes | None = None
        self._unsaved: Document | None = None  # progress of the last step
        self._saved_at = float("-inf")

    def run(self, find_operation: Callable[[str], Begin]) -> Ending:
        """Work to an end, whatever it is."""
        try:
            return self._run(find_operation)
        except StaleClaim:
            return Ending.ABANDONED
        except Exception as error:  # noqa: BLE001 - whatever it is, the job says so
            return self._fail(error_document(error, self._claim.job_id))
        finally:
            self._phases.close()

    def give_up(self, find_operation: Callable[[str], Begin], error: Document) -> Ending:
        """End the job as failed: a chunk of it has shown that it cannot be done."""
        try:
            self._checkpoint, _ = self._store.read(self._load)
            self._begin(find_operation)
        except StaleClaim:
            return Ending.ABANDONED
        except Exception:
            log.exception("job %s: no result at its last checkpoint", self._claim.job_id)
        return self._fail(error)

    def _run(self, find_operation: Callable[[str], Begin]) -> Ending:
        self._checkpoint, flown = self._store.read(self._load)
        if not self._prepare_kernels():
            return self._stopped()
        work = self._begin(find_operation)
        if self._chunks:
            self._keeper.look()  # it may have been taken over to end
            if self._keeper.should_stop():
                return self._stopped()
            self._take_outcomes(flown)
        try:
            if self._hand_out():
                return Ending.HANDED_OUT
            for step in work.steps(self._checkpoint, self._keeper.should_stop):
                self._note(step)
                if self._hand_out():
                    return Ending.HANDED_OUT
            if self._checkpoint is None:
                raise RuntimeError(f"operation {self._claim.operation!r} ended without a step")
            self._save_unsaved()
            outcome = work.outcome(self._checkpoint)
        except WorkInterrupted:
            self._keeper.note_work_ended()
            return self._stopped()
        self._keeper.note_work_ended()
        return self._finish(JobStatus.SUCCEEDED, outcome=outcome)

    def _load(self, session: Session) -> tuple[bytes | None, Flown | None]:
        return load_checkpoint(session, self._claim), flown(session, self._claim)

    def _begin(self, find_operation: Callable[[str], Begin]) -> Work:
        self._work, self._chunks = self._cache.prepared(
            self._claim, self._store, find_operation, self._kernels.threads
        )
        return self._work

    def _prepare_kernels(self) -> bool:
        if self._kernels.ready:
            return True
        if self._checkpoint is None:  # what has come further shows how far
            message = "compiling the numeric kernels (a minute or two at the first start on a machine)"
            self._save({"fraction": 0.0, "phase": "preparing", "message": message}, None)
        return self._kernels.wait(self._keeper.should_stop)

    # a generation over several workers

    def _hand_out(self) -> bool:
        """Give the job up for chunks if its next step is made of parts that others can fly."""
        if not self._chunks or self._checkpoint is None or not isinstance(self._work, SpreadWork):
            return False
        tasks = self._work.tasks(self._checkpoint, self._chunks)
        if tasks is None or len(tasks) < 2:  # one part is flown as well here
            return False
        checkpoint, progress = self._checkpoint, self._unsaved
        self._store.write(lambda session: hand_out(session, self._claim, tasks, checkpoint, progress))
        self._unsaved, self.handed_out = None, len(tasks)
        return True

    def _take_outcomes(self, flown: Flown | None) -> None:
        """Take the step that the outcomes of all chunks make; without them the chunks are handed out anew."""
        if flown is None or self._checkpoint is None or not isinstance(self._work, SpreadWork):
            return
        step = self._work.told(self._checkpoint, flown.outcomes, flown.elapsed_s)
        before = flown.before
        self._checkpoint = step.checkpoint
        self._unsaved = rated(
            step, flown.elapsed_s, before.get("flights"), float(before.get("fraction") or 0.0)
        )

    # progress

    def _note(self, step: Step) -> None:
        self._phases.note(step.progress.get("phase"))
        self._checkpoint, self._unsaved = step.checkpoint, self._pace.progress(step)
        if self._clock() - self._saved_at >= SAVE_EVERY_S:
            self._save_unsaved()

    def _save_unsaved(self) -> None:
        if self._unsaved is not None:
            self._save(self._unsaved, self._checkpoint)
            self._unsaved, self._saved_at = None, self._clock()

    def _save(self, progress: Document, checkpoint: bytes | None) -> None:
        self._store.write(lambda session: save_progress(session, self._claim, progress, checkpoint))

    # ends

    def _stopped(self) -> Ending:
        reason = self._keeper.reason
        if reason is StopReason.SHUTDOWN:
            self._save_unsaved()
            self._store.write(lambda session: release_job(session, self._claim))
            return Ending.RELEASED
        if reason is StopReason.CANCEL:
            return self._end(JobStatus.CANCELLED)
        if reason is StopReason.DEADLINE:
            hint = (
                "raise search.max_seconds, or reduce the request: fewer particles, generations or links, "
                "a shorter flight"
            )
            error = _error("deadline_exceeded", "the job did not end before its deadline", hint=hint)
            return self._end(JobStatus.EXPIRED, error)
        raise StaleClaim

    def _fail(self, error: Document) -> Ending:
        log.warning("job %s failed: %s", self._claim.job_id, error)
        self._keeper.note_work_ended()
        try:
            return self._end(JobStatus.FAILED, error)
        except (StaleClaim, StorageFull):
            return Ending.ABANDONED  # without room for a sentence the reaper tries it later

    def _end(self, status: JobStatus, error: Document | None = None) -> Ending:
        """End early, with as much of the best so far as there is room for: with its files, without, nothing.

        Raises
        ------
        StorageFull : there is no room for the end itself, not even the job store's reserve.
        """
        best = self._best_so_far()
        for outcome in [] if best is None else [best, Outcome(best.document)]:
            try:
                return self._finish(status, outcome=outcome, error=error)
            except StorageFull:
                log.warning("job %s: no space for its artifacts", self._claim.job_id)
        return self._finish(status, error=error, even_if_full=True)

    def _best_so_far(self) -> Outcome | None:
        if self._work is None or self._checkpoint is None:
            return None
        try:
            return self._work.best_so_far(self._checkpoint)
        except Exception:
            # how the job ended matters more than what it leaves behind
            log.exception("job %s: no result at its last checkpoint", self._claim.job_id)
            return None

    def _finish(
        self,
        status: JobStatus,
        *,
        outcome: Outcome | None = None,
        error: Document | None = None,
        even_if_full: bool = False,
    ) -> Ending:
        self._store.write(
            lambda session: finish_job(
                session,
                self._claim,
                status,
                result=None if outcome is None else outcome.document,
                error=error,
                artifacts={} if outcome is None else dict(outcome.artifacts),
            ),
            even_if_full=even_if_full,
        )
        return ENDINGS[status]


def error_document(error: Exception, job_id: str) -> Document:
    """Return what the user is shown of an error."""
    if isinstance(error, WorkRefused):
        return _error(error.code, error.detail, hint=error.hint, pointer=error.pointer)
    if isinstance(error, MemoryError):
        hint = "use fewer particles, fewer or shorter samples, or a machine with more memory"
        return _error("out_of_memory", "the job needs more memory than there is", hint=hint)
    if isinstance(error, StorageFull):
        hint = "make room (delete finished jobs, or grow the disk) and submit the job again"
        return _error("storage_full", "the job store has no room for what the job wrote", hint=hint)
    if isinstance(error, UnknownOperation):
        return _error("unknown_operation", str(error), hint="update the workers")
    log.error("job %s: unforeseen", job_id, exc_info=error)
    hint = f"the worker's log tells more about {job_id}; please report it"
    return _error("internal_error", "unexpected error in the worker", hint=hint)


def _error(code: str, detail: str, *, hint: str = "", pointer: str = "") -> Document:
    error = {"code": code, "detail": detail, "hint": hint, "pointer": pointer}
    return {key: value for key, value in error.items() if value}
