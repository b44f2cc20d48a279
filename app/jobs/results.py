"""What the result of a job can be: one form per operation."""

from __future__ import annotations

from app.identify.schemas import IdentifyResult
from app.optimize.schemas import OptimizeResult
from app.simulate.schemas import SimulateResult
from app.study.schemas import StudyResult

JobResult = IdentifyResult | StudyResult | SimulateResult | OptimizeResult
