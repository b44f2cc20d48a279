"""What the result of a job can be: one form per operation."""

from __future__ import annotations

from morphdata.identify import IdentifyResult
from morphdata.optimize import OptimizeResult
from morphdata.simulate import SimulateResult
from morphdata.study import StudyResult

JobResult = IdentifyResult | StudyResult | SimulateResult | OptimizeResult
