"""A process of the workers (`worker.process`) whose operations are random walks."""

from __future__ import annotations

import sys

import tests.faults.walk_worker  # noqa: F401 - puts the walks in the place of the operations
from worker.process import main

if __name__ == "__main__":
    sys.exit(main())
