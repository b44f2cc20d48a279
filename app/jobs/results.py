"""What the result of a job can be: one form per operation."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Union

from morphdata.operations import OPERATIONS

if TYPE_CHECKING:
    JobResult = Any
else:
    JobResult = Union[tuple(operation.result for operation in OPERATIONS)]  # noqa: UP007 - of a list
