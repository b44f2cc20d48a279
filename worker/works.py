"""The work of the spread jobs seen last: model, plans and tables are made once for all chunks of a job."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass

from worker.operations import Begin, Document, Work

MOST_KEPT = 2  # a swarm's tables take some megabytes; a worker goes to and fro between few jobs
DEFAULT_CHUNKS = 16


@dataclass(frozen=True)
class Prepared:
    """Work that has begun.

    Parameters
    ----------
    work : the work.
    chunks : into how many parts a generation is cut; 0 for work that one worker does alone.
    """

    work: Work
    chunks: int = 0


class Works:
    """Begins work, and keeps that of spread jobs, whose chunks come one after the other."""

    def __init__(self) -> None:
        self._kept: OrderedDict[str, Prepared] = OrderedDict()

    def prepared(
        self, job_id: str, find: Callable[[], Begin], load: Callable[[], Document], threads: int
    ) -> Prepared:
        """Give a job's work: what was kept of it, or begun from its request.

        Parameters
        ----------
        find : the operation.
        load : the request.
        threads : numeric threads of one job.
        """
        if job_id in self._kept:
            self._kept.move_to_end(job_id)
            return self._kept[job_id]
        request = load()
        prepared = Prepared(find()(request, threads), chunks_of(request))
        if prepared.chunks:
            self._kept[job_id] = prepared
            while len(self._kept) > MOST_KEPT:
                self._kept.popitem(last=False)
        return prepared


def chunks_of(request: Document) -> int:
    """Into how many chunks a request wants its generations cut; 0 for one worker alone."""
    execution = request.get("execution") or {}
    return int(execution.get("chunks", DEFAULT_CHUNKS)) if execution.get("mode") == "distributed" else 0
