"""Provenance of the figures: versions, machine, and a digest of the code that determines them."""

from __future__ import annotations

import hashlib
import os
import platform
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from morphcore.threads import thread_count

Document = dict[str, Any]

PACKAGES = ("numpy", "scipy", "numba", "pyswarms", "matplotlib")
PACKAGES_OF_OURS = ("morphcore", "morphdata")
PRESENTATION = ("morphcore/export", "morphcore/paper/report")  # presents figures without changing them
UNKNOWN = "unknown"


def versions() -> dict[str, str]:
    """Versions of this project, Python, and the libraries that compute."""
    return {
        "morphid": _version("morphid"),
        "python": platform.python_version(),
        **{name: _version(name) for name in PACKAGES},
    }


def machine() -> Document:
    """Processor, cores, threads used and operating system."""
    return {
        "processor": processor_name(),
        "cores": os.cpu_count(),
        "threads": thread_count(),
        "system": f"{platform.system()} {platform.machine()}",
    }


def code_digest() -> str:
    """A digest of the source that determines the figures: library and documents, not presentation."""
    root = Path(__file__).resolve().parents[2]
    digest = hashlib.sha256()
    for path in sorted(path for package in PACKAGES_OF_OURS for path in (root / package).rglob("*.py")):
        name = path.relative_to(root).as_posix()
        if not name.startswith(PRESENTATION):
            digest.update(f"{name}\n".encode())
            digest.update(path.read_bytes())
    return digest.hexdigest()


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:  # run from a source tree without installation
        return UNKNOWN


def processor_name() -> str:
    """The name of this machine's processor."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or UNKNOWN
    names = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(names, UNKNOWN)
