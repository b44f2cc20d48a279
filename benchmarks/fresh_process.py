"""Measurements that need a process of their own: its memory, its first minutes."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Mapping
from typing import Any

from benchmarks.setting import Figures
from morphcore.stopping import check_stop


def in_fresh_process(function: str, *arguments: Any, environment: Mapping[str, str] | None = None) -> Figures:
    """Call ``module:function`` with JSON-able arguments in a new interpreter; gives the JSON that it returns.

    Raises
    ------
    RuntimeError : the process failed; with the end of what it said.
    Interrupted : it failed and the surrounding `stoppable` block requests a stop.
    """
    module, _, name = function.partition(":")
    program = (
        f"import json, sys; from {module} import {name}; print(json.dumps({name}(*json.loads(sys.argv[1]))))"
    )
    done = subprocess.run(
        [sys.executable, "-P", "-c", program, json.dumps(arguments)],
        env={
            **os.environ,
            "PYTHONPATH": os.pathsep.join(sys.path),
            "OPENBLAS_NUM_THREADS": "1",
            **(environment or {}),
        },
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        check_stop()  # Ctrl-C reaches that process too
        raise RuntimeError(f"{function} ended with {done.returncode}: {done.stderr[-2000:]}")
    found: Figures = json.loads(done.stdout.splitlines()[-1])
    return found
