"""Endpoints of simulation."""

from __future__ import annotations

from typing import Literal

from app.http.context import CallerDep, ServiceDep
from app.jobs.schemas import Job, Validation
from app.jobs.submission import OperationRouter, SubmissionDep, validated
from app.simulate import service
from morphdata.simulate import FlightCost, SimulateRequest

router = OperationRouter("simulate")


class SimulateValidation(Validation):
    """The request is valid."""

    operation: Literal["simulate"] = "simulate"
    cost: FlightCost


@router.submission("Fly a model through a morph")
async def simulate(body: SimulateRequest, submission: SubmissionDep) -> Job:
    """Start a simulation and return its job.

    With `Prefer: wait=30` the job of a rigid or an equivalent model has usually ended when the answer comes.
    A flight keeps no checkpoint: where its worker is lost, another flies it again from the start.
    """
    return await submission.accept(service.prepare, body)


@router.validation("Check a request for a simulation")
def validate_simulate(body: SimulateRequest, app: ServiceDep, caller: CallerDep) -> SimulateValidation:
    """Make the checks of `POST /simulate` and start nothing; tell the cost and how long it would wait."""
    return validated(app, caller, service.prepare, body, SimulateValidation)
