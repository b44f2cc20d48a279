"""The operation ``study`` and its cost estimate."""

from __future__ import annotations

from typing import Any

from morphdata.identified import CostEstimate
from morphdata.operations import identify
from morphdata.operations.descriptor import Operation, after_budget
from morphdata.study import StudyRequest, StudyResult

REPORT_TIME_S = 300.0  # uncertainty and timing of up to eight models


def _summary(request: StudyRequest) -> dict[str, Any]:
    return {**identify.samples_summary(request), "compared_links": request.model.links_per_wing}


def _recommended(result: dict[str, Any]) -> dict[str, Any] | None:
    links = (result.get("recommended") or {}).get("links_per_wing")
    rows = (row for row in result.get("rows") or () if links is not None and row["links_per_wing"] == links)
    return next(rows, None)


STUDY = Operation(
    name="study",
    subject="How many links a model should have.",
    help="Does so for several numbers of links per wing and recommends one.",
    noun="a study",
    title="Compare models of several sizes",
    description="A model is identified for every number of links per wing from the same samples; accuracy "
    "and cost of each are reported, and one is recommended. The recommended model becomes one of yours: see "
    "`model_id` of the job.",
    request=StudyRequest,
    result=StudyResult,
    cost_model=CostEstimate,
    cost=identify.cost,
    summary=_summary,
    begin="worker.operations.study:begin",
    files=("result.json", "study.*"),
    deadline_s=after_budget(REPORT_TIME_S),
    model_in=_recommended,
)
