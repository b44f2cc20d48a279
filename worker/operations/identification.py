"""The operation ``identify``: an equivalent model from sample flights."""

from __future__ import annotations

import io
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from morphcore.export.curves import curve_tables
from morphcore.export.plots import identification_plots
from morphcore.identify import (
    Identification,
    IdentifyResult,
    identification_from_request,
)
from morphcore.search.checkpoint import UnreadableCheckpoint
from morphdata.identify import IdentifyRequest
from worker.operations import Document, Step, Stop
from worker.operations.library_work import SearchWork, shown

Array = NDArray[np.float64]

POSTERIOR_FILE = "posterior.npz"


class IdentificationWork(SearchWork):
    """An identification whose generations can be flown in parts by several workers."""

    def __init__(self, run: Identification) -> None:
        super().__init__(run, _files)
        self._identification = run

    def tasks(self, checkpoint: bytes, max_parts: int) -> list[bytes] | None:
        """Divide the next step's search points; None if the step needs more than their costs."""
        try:
            task = self._identification.task(checkpoint)
        except UnreadableCheckpoint:  # `steps` begins again
            return None
        return None if task is None else [_packed(part) for part in task.parts(max_parts)]

    def fly(self, task: bytes, stop: Stop) -> bytes:
        """Return the costs of some search points."""
        return _packed(self._identification.task_costs(_unpacked(task), stop))

    def combine(self, checkpoint: bytes, outcomes: Sequence[bytes], elapsed_s: float) -> Step:
        """Continue the search with the costs of all parts; restart it if the checkpoint is unreadable."""
        costs = np.concatenate([_unpacked(outcome) for outcome in outcomes])
        try:
            return shown(self._identification.tell(checkpoint, costs, wall_s=elapsed_s))
        except UnreadableCheckpoint:
            return next(self.steps(checkpoint, self._stop))


def begin(request: Document, threads: int) -> SearchWork:
    """Check the request and prepare the search; one that chooses the number of links is not divided."""
    run = identification_from_request(IdentifyRequest.parse(request), threads)
    return IdentificationWork(run) if isinstance(run, Identification) else SearchWork(run, _files)


def _files(result: IdentifyResult, document: Document) -> dict[str, bytes]:
    curves = result.curves()
    drawn = {} if result.posterior is None else {POSTERIOR_FILE: result.posterior.to_file()}
    return {**identification_plots(document, curves), **curve_tables(curves), **drawn}


def _packed(values: Array) -> bytes:
    stream = io.BytesIO()
    np.save(stream, values, allow_pickle=False)
    return stream.getvalue()


def _unpacked(data: bytes) -> Array:
    return np.asarray(np.load(io.BytesIO(data), allow_pickle=False), dtype=np.float64)
