"""The measured machine."""

from __future__ import annotations

import os
import platform

import numba
import numpy as np

from benchmarks.setting import Figures
from morphcore.paper.provenance import processor_name


def machine() -> Figures:
    """What a figure depends on besides the code."""
    return {
        "processor": processor_name(),
        "cores": os.cpu_count(),
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
        "numpy": np.__version__,
        "numba": numba.__version__,
        # unless 1, the threads of linear algebra compete with ours for the cores
        "openblas_num_threads": os.environ.get("OPENBLAS_NUM_THREADS"),
    }
