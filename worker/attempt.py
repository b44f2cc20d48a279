"""One attempt at a job, or at one chunk of it; every possible ending has its own branch."""

from __future__ import annotations

import logging
import time
from enum import Enum

from app.database import Session
from app.jobs.chunks import Flown, finish_chunk, flown, give_back_chunk, hand_out
from app.jobs.records import ChunkClaim, Claim, JobStatus, StopReason
from app.jobs.store import finish_job, load_checkpoint, load_request, release_job, save_progress
from morphdata.faults import Interrupted, MorphError
from worker.job_cache import JobCache
from worker.lease import LeaseKeeper, StaleClaim, StorageFull
from worker.numerics import Kernels
from worker.operations import Document, Outcome, SpreadWork, Step, Work
from worker.progress import Pace, rated
from worker.spans import PhaseSpans

log = logging.getLogger(__name__)

# a generation may take milliseconds; two writes a second are enough for the user and gentle on the disk
SAVE_EVERY_S = 0.5


class Ending(Enum):
    """The outcome of one wake-up."""

    NOTHING_QUEUED = "nothing queued"
    SUCCEEDED = "succeeded"
    FAILED = "failed"
    CANCELLED = "cancelled"
    EXPIRED = "expired"
    RELEASED = "released"  # back in the queue with its checkpoint
    ABANDONED = "abandoned"  # another claim holds the job
    HANDED_OUT = "handed out"  # its next generation was split into chunks that any worker may fly
    CHUNK_STORED = "chunk stored"


class Attempt:
    """The work on one claimed job.

    Attributes
    ----------
    handed_out : int
        Number of chunks that the job was split into; publish as many messages.
    """

    def __init__(self, claim: Claim, keeper: LeaseKeeper, kernels: Kernels, cache: JobCache) -> None:
        self._claim = claim
        self._keeper = keeper
        self._kernels = kernels
        self._cache = cache
        self.handed_out = 0
        self._chunks = 0
        self._pace = Pace(time.monotonic)
        self._phases = PhaseSpans()
        self._work: Work | None = None
        self._checkpoint: bytes | None = None
        self._unsaved: Document | None = None  # progress at the last step
        self._saved_at = float("-inf")

    def run(self) -> Ending:
        """Work until the attempt ends, in any way."""
        try:
            return self._run()
        except StaleClaim:
            return Ending.ABANDONED
        except Exception as error:  # noqa: BLE001 - the job fails with it
            return self._fail(error_document(error, self._claim.job_id))
        finally:
            self._phases.close()

    def give_up(self, error: Document) -> Ending:
        """End the job as failed because one of its chunks cannot be done."""
        try:
            self._checkpoint, _ = self._keeper.read(self._load)
            self._begin()
        except StaleClaim:
            return Ending.ABANDONED
        except Exception:
            log.exception("job %s: no result at its last checkpoint", self._claim.job_id)
        return self._fail(error)

    def _run(self) -> Ending:
        self._checkpoint, flown = self._keeper.read(self._load)
        if not self._prepare_kernels():
            return self._stopped()
        work = self._begin()
        if self._chunks:
            self._keeper.look()  # it may have been taken over only to be ended
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
        except Interrupted:
            self._keeper.note_work_ended()
            return self._stopped()
        self._keeper.note_work_ended()
        return self._finish(JobStatus.SUCCEEDED, outcome)

    def _load(self, session: Session) -> tuple[bytes | None, Flown | None]:
        return load_checkpoint(session, self._claim), flown(session, self._claim)

    def _begin(self) -> Work:
        self._work, self._chunks = begin(self._claim, self._keeper, self._cache)
        return self._work

    def _prepare_kernels(self) -> bool:
        if self._kernels.ready:
            return True
        if self._checkpoint is None:  # otherwise the progress so far is more informative
            message = "compiling the numeric kernels (a minute or two at the first start on a machine)"
            self._save({"fraction": 0.0, "phase": "preparing", "message": message}, None)
        return self._kernels.wait(self._keeper.should_stop)

    # a generation spread over several workers

    def _hand_out(self) -> bool:
        """Release the job as chunks if its next step consists of parts that others can fly."""
        if not self._chunks or self._checkpoint is None or not isinstance(self._work, SpreadWork):
            return False
        tasks = self._work.tasks(self._checkpoint, self._chunks)
        if tasks is None or len(tasks) < 2:  # a single part is better flown here
            return False
        checkpoint, progress = self._checkpoint, self._unsaved
        self._keeper.write(lambda session: hand_out(session, self._claim, tasks, checkpoint, progress))
        self._unsaved, self.handed_out = None, len(tasks)
        return True

    def _take_outcomes(self, flown: Flown | None) -> None:
        """Take the step made up of the outcomes of all chunks; without them, hand the chunks out again."""
        if flown is None or self._checkpoint is None or not isinstance(self._work, SpreadWork):
            return
        step = self._work.combine(self._checkpoint, flown.outcomes, flown.elapsed_s)
        self._checkpoint = step.checkpoint
        self._unsaved = rated(step.progress, flown.elapsed_s, flown.before)

    # progress

    def _note(self, step: Step) -> None:
        self._phases.note(step.progress.get("phase"))
        self._checkpoint, self._unsaved = step.checkpoint, self._pace.progress(step)
        if time.monotonic() - self._saved_at >= SAVE_EVERY_S:
            self._save_unsaved()

    def _save_unsaved(self) -> None:
        if self._unsaved is not None:
            self._save(self._unsaved, self._checkpoint)
            self._unsaved, self._saved_at = None, time.monotonic()

    def _save(self, progress: Document, checkpoint: bytes | None) -> None:
        self._keeper.write(lambda session: save_progress(session, self._claim, progress, checkpoint))

    # ends

    def _stopped(self) -> Ending:
        reason = self._keeper.reason
        if reason is StopReason.SHUTDOWN:
            self._save_unsaved()
            self._keeper.write(lambda session: release_job(session, self._claim))
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
            return Ending.ABANDONED  # if there is no room for the error, the reaper tries again later

    def _end(self, status: JobStatus, error: Document | None = None) -> Ending:
        """End early with as much of the best result as space allows: with files, without, or nothing."""
        best = self._best_so_far()
        for outcome in [] if best is None else [best, Outcome(best.document)]:
            try:
                return self._finish(status, outcome, error)
            except StorageFull:
                log.warning("job %s: no space for its artifacts", self._claim.job_id)
        return self._finish(status, error=error, even_if_full=True)

    def _best_so_far(self) -> Outcome | None:
        if self._work is None or self._checkpoint is None:
            return None
        try:
            return self._work.best_so_far(self._checkpoint)
        except Exception:
            # the ending of the job matters more than its files
            log.exception("job %s: no result at its last checkpoint", self._claim.job_id)
            return None

    def _finish(
        self,
        status: JobStatus,
        outcome: Outcome | None = None,
        error: Document | None = None,
        *,
        even_if_full: bool = False,
    ) -> Ending:
        result, artifacts = (None, {}) if outcome is None else (outcome.document, outcome.artifacts)
        self._keeper.write(
            lambda session: finish_job(
                session, self._claim, status, result=result, error=error, artifacts=artifacts
            ),
            even_if_full=even_if_full,
        )
        return Ending[status.name]


def fly_chunk(
    chunk: ChunkClaim, keeper: LeaseKeeper, kernels: Kernels, cache: JobCache
) -> tuple[Ending, Document | None]:
    """Fly one chunk and store its outcome exactly once; also return why the whole job cannot be done."""
    try:
        outcome = _outcome(chunk, keeper, kernels, cache)
        keeper.note_work_ended()
        keeper.write(lambda session: finish_chunk(session, chunk, outcome))
    except Interrupted:
        keeper.note_work_ended()
        return _leave(chunk, keeper), None
    except StaleClaim:
        return Ending.ABANDONED, None
    except Exception as error:  # noqa: BLE001 - the job fails with it
        return Ending.FAILED, error_document(error, chunk.job_id)
    return Ending.CHUNK_STORED, None


def _outcome(chunk: ChunkClaim, keeper: LeaseKeeper, kernels: Kernels, cache: JobCache) -> bytes:
    if not kernels.wait(keeper.should_stop):
        raise Interrupted
    work, _ = begin(chunk, keeper, cache)
    if not isinstance(work, SpreadWork):
        raise TypeError(f"operation {chunk.operation!r} cannot be distributed")
    return work.fly(chunk.task, keeper.should_stop)


def _leave(chunk: ChunkClaim, keeper: LeaseKeeper) -> Ending:
    """Return the chunk for the next worker, or leave it if its job is ending."""
    if keeper.reason is not StopReason.SHUTDOWN:
        return Ending.ABANDONED
    try:
        keeper.write(lambda session: give_back_chunk(session, chunk))
    except StaleClaim:
        return Ending.ABANDONED
    return Ending.RELEASED


def begin(claim: Claim, keeper: LeaseKeeper, cache: JobCache) -> tuple[Work, int]:
    """Start the work of a job, or find it in the cache, and return it with the number of its chunks."""
    return cache.prepared(claim, lambda: keeper.read(lambda session: load_request(session, claim.job_id)))


def error_document(error: Exception, job_id: str) -> Document:
    """Return the error document shown to the user."""
    if isinstance(error, MorphError):
        return _error(error.code, error.message, hint=error.hint, pointer=error.pointer)
    if isinstance(error, MemoryError):
        hint = "use fewer particles, fewer or shorter samples, or a machine with more memory"
        return _error("out_of_memory", "the job needs more memory than is available", hint=hint)
    log.error("job %s: unforeseen", job_id, exc_info=error)
    hint = f"see the worker's log for {job_id}, and please report it"
    return _error("internal_error", "unexpected error in the worker", hint=hint)


def _error(code: str, detail: str, *, hint: str = "", pointer: str = "") -> Document:
    error = {"code": code, "detail": detail, "hint": hint, "pointer": pointer}
    return {key: value for key, value in error.items() if value}
