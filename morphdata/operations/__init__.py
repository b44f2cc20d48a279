"""The operations, one descriptor each: to add one, write its module and list it here.

Its work starts in the function named by the descriptor's ``begin``. Nothing else has to change: calls,
OpenAPI document, worker, command and page are built from this list.
"""

from __future__ import annotations

from typing import Any

from morphdata.operations.descriptor import Operation
from morphdata.operations.export import EXPORT
from morphdata.operations.identify import IDENTIFY
from morphdata.operations.optimize import OPTIMIZE
from morphdata.operations.simulate import SIMULATE
from morphdata.operations.study import STUDY

OPERATIONS: tuple[Operation[Any], ...] = (IDENTIFY, STUDY, SIMULATE, OPTIMIZE, EXPORT)


def operation_named(name: str) -> Operation[Any]:
    """Find an operation by its name.

    Raises
    ------
    LookupError
        There is none of this name.
    """
    for operation in OPERATIONS:
        if operation.name == name:
            return operation
    raise LookupError(f"there is no operation {name!r}, only {', '.join(o.name for o in OPERATIONS)}")
