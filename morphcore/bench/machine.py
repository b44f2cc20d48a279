"""The machine that is measured."""

from __future__ import annotations

import os
import platform
from pathlib import Path

import numba
import numpy as np

from morphcore.bench.setting import Figures


def machine() -> Figures:
    """What a figure depends on beside the code."""
    return {
        "processor": processor_name(),
        "cores": os.cpu_count(),
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
        "numpy": np.__version__,
        "numba": numba.__version__,
        # unless 1, linear algebra on threads of its own fights with ours for the cores
        "openblas_num_threads": os.environ.get("OPENBLAS_NUM_THREADS"),
    }


def processor_name() -> str:
    """What this machine calls its processor."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or "unknown"
    return next(
        (line.partition(":")[2].strip() for line in lines if line.startswith("model name")), "unknown"
    )
