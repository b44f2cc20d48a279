"""A toy operation, whole in one module: what it takes, what comes out, what it costs, and its work."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Annotated, Any

from pydantic import BaseModel, Field

from morphdata.execution import Request
from morphdata.faults import Fault
from morphdata.operations.descriptor import Operation
from morphdata.options import MODEL, Option
from worker.operations import Outcome, Step, Stop


class ToyRequest(Request):
    """A number to count to."""

    count_to: Annotated[int, Option("--count-to", MODEL)] = Field(ge=1, le=9, description="Where to stop.")

    def faults(self) -> Iterator[Fault]:
        """Check that the number is lucky."""
        if self.count_to == 4:
            yield Fault("unlucky", "Four is unlucky.", "/count_to", "Give another number.")


class ToyResult(BaseModel):
    """What was counted."""

    counted: list[int]


class ToyCost(BaseModel):
    """What counting would take."""

    core_s: float


class ToyWork:
    """Counting, a number a step."""

    def __init__(self, count_to: int) -> None:
        self._count_to = count_to

    def steps(self, checkpoint: bytes | None, stop: Stop) -> Iterator[Step]:
        """Count on."""
        del stop
        for number in range(int(checkpoint or b"0") + 1, self._count_to + 1):
            yield Step({"fraction": number / self._count_to, "phase": "counting"}, str(number).encode())

    def outcome(self, checkpoint: bytes, *, files: bool = True) -> Outcome:
        """Give the numbers, and a file with them."""
        document = {"counted": list(range(1, int(checkpoint) + 1))}
        return Outcome(document, {"result.json": json.dumps(document).encode()} if files else {})

    def best_so_far(self, checkpoint: bytes) -> Outcome:
        """Give the numbers so far."""
        return self.outcome(checkpoint)


def begin(request: dict[str, Any], threads: int) -> ToyWork:
    """Begin to count."""
    del threads
    return ToyWork(ToyRequest.parse(request).count_to)


TOY = Operation(
    name="count",
    noun="a count",
    title="Count to a number",
    subject="Numbers in their order.",
    help="Counts to a number.",
    description="The numbers are whole.",
    request=ToyRequest,
    result=ToyResult,
    cost_model=ToyCost,
    cost=lambda request: ToyCost(core_s=1e-3 * request.count_to),
    summary=lambda request: {"count_to": request.count_to},
    begin="tests.house.toy_operation:begin",
)
