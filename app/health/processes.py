"""Which process a name means: numbers of processes are given out again, and containers each count from 1."""

from __future__ import annotations

import os
from pathlib import Path

PROC = Path("/proc")
START_TIME = 19  # place of the start time behind the program's name in /proc/<pid>/stat (proc(5))
ENDED = frozenset("ZXx")


def process_identity(pid: int) -> str | None:
    """Name a process of this machine for good; None where the system does not say.

    The name has four parts: this boot, the space of process numbers (each container has its own), the
    number and the moment of the process's start.
    """
    try:
        return "/".join((*_here(), str(pid), _stat(pid)[START_TIME]))
    except OSError:
        return None


def own_identity() -> str | None:
    """Name this process for good; None where the system does not say."""
    return process_identity(os.getpid())


def is_gone(identity: str | None) -> bool | None:
    """Whether a process has ended; None when it cannot be told from here."""
    try:
        boot, space, pid, started = (identity or "").split("/")
        if (boot, space) != _here():
            return None
        os.kill(int(pid), 0)
    except ProcessLookupError:
        return True
    except PermissionError:
        return False
    except (OSError, ValueError):
        return None
    try:
        stat = _stat(int(pid))
    except OSError:
        return False  # there, and none of our business
    return stat[START_TIME] != started or stat[0] in ENDED


def _here() -> tuple[str, str]:
    boot = (PROC / "sys/kernel/random/boot_id").read_text().strip()
    return boot, str((PROC / "self/ns/pid").readlink())


def _stat(pid: int) -> list[str]:
    return (PROC / str(pid) / "stat").read_text().rpartition(")")[2].split()
