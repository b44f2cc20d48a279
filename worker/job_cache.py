"""The work of the spread jobs seen last: model, plans and tables are made once for all chunks of a job."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from typing import NamedTuple

from worker.operations import Document, Work

JOBS_KEPT = 2  # a swarm's tables take some megabytes; a worker alternates between few jobs
DEFAULT_CHUNKS = 16


class Prepared(NamedTuple):
    """Work that has begun.

    Attributes
    ----------
    work : Work
    chunks : int
        Number of parts that a generation is cut into; 0 for work that one worker does alone.
    """

    work: Work
    chunks: int


class JobCache:
    """Begins work, and keeps that of spread jobs, whose chunks come one after the other."""

    def __init__(self) -> None:
        self._kept: OrderedDict[str, Prepared] = OrderedDict()

    def prepared(
        self, job_id: str, load: Callable[[], Document], begin: Callable[[Document], Work]
    ) -> Prepared:
        """Return a job's work: what was kept of it, or begun from its request.

        Parameters
        ----------
        load : callable
            Loads the request.
        begin : callable
            Begins the work of a request.
        """
        if job_id in self._kept:
            self._kept.move_to_end(job_id)
            return self._kept[job_id]
        request = load()
        prepared = Prepared(begin(request), chunks_of(request))
        if prepared.chunks:
            self._kept[job_id] = prepared
            if len(self._kept) > JOBS_KEPT:
                self._kept.popitem(last=False)
        return prepared


def chunks_of(request: Document) -> int:
    """Number of chunks that a request wants its generations cut into; 0 for one worker alone."""
    execution = request.get("execution") or {}
    return int(execution.get("chunks", DEFAULT_CHUNKS)) if execution.get("mode") == "distributed" else 0
