"""Cache of the most recent spread jobs: model, plans and tables are made once for all chunks of a job."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable

from app.jobs.records import Claim
from worker.operations import Begin, Document, Work

JOBS_KEPT = 2  # a swarm's tables take some megabytes; a worker alternates between few jobs
DEFAULT_CHUNKS = 16


class JobCache:
    """Starts work, and caches that of spread jobs, whose chunks come one after the other.

    ``find_operation(name)`` returns the function that starts the work; each job uses ``threads`` numeric
    threads.
    """

    def __init__(self, find_operation: Callable[[str], Begin], threads: int) -> None:
        self._find_operation = find_operation
        self._threads = threads
        self._kept: OrderedDict[str, tuple[Work, int]] = OrderedDict()

    def prepared(self, claim: Claim, load_request: Callable[[], Document]) -> tuple[Work, int]:
        """Return a job's work and the number of chunks per generation.

        The number is 0 for work that one worker does alone.
        """
        if claim.job_id in self._kept:
            self._kept.move_to_end(claim.job_id)
            return self._kept[claim.job_id]
        request = load_request()
        work, chunks = self._find_operation(claim.operation)(request, self._threads), _chunks(request)
        if chunks:
            self._kept[claim.job_id] = work, chunks
            if len(self._kept) > JOBS_KEPT:
                self._kept.popitem(last=False)
        return work, chunks


def _chunks(request: Document) -> int:
    execution = request.get("execution") or {}
    return int(execution.get("chunks", DEFAULT_CHUNKS)) if execution.get("mode") == "distributed" else 0
