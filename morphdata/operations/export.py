"""The operation ``export`` and its cost estimate."""

from __future__ import annotations

from typing import Any

from morphdata.export import ExportCost, ExportRequest, ExportResult
from morphdata.formats import FORMATS
from morphdata.operations.descriptor import Operation

TRIM_CORE_S = 1.0  # s for the lattice at the reference shape and its trim, to an order of magnitude


def _summary(request: ExportRequest) -> dict[str, Any]:
    known = request.model.known
    return {
        "aircraft": request.aircraft.name,
        "links_per_wing": None if known is None else known.links_per_wing,
        "format": request.format,
    }


EXPORT = Operation(
    name="export",
    subject="Identified models as files for other programs.",
    help="Writes an identified model as a file for other programs.",
    noun="an export",
    title="Export an identified model as a file",
    description="The file is an artifact of the job. `GET /models/{model_id}/export` creates this job for an "
    "identified model and returns the file.",
    request=ExportRequest,
    result=ExportResult,
    cost_model=ExportCost,
    cost=lambda _request: ExportCost(core_s=TRIM_CORE_S),
    summary=_summary,
    begin="worker.operations.export:begin",
    files=("result.json", *(each.file for each in FORMATS)),
)
