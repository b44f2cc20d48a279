"""Limits of a parser process: memory and time; no files to write, no network."""

from __future__ import annotations

import contextlib
import os
import resource
import signal
from dataclasses import dataclass

MIB = 2**20
LIBRARIES_BYTES = 2**30  # address space for code and what allocators reserve without using it
OPEN_FILES = 64
GRACE_S = 5  # s beyond the parent's limit: a parser whose parent died ends by itself
NICE = 5  # niceness: responding to requests comes first


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits of one parser process."""

    memory_bytes: int = 512 * MIB  # data of the process, including those of libraries
    cpu_s: int = 10
    wall_s: int = 20  # until the parent gives up


def confine_time(limits: Limits) -> None:
    """Limit the time of this process, even if its parent dies; call it before anything else."""
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    signal.alarm(limits.wall_s + GRACE_S)
    _limit("RLIMIT_CPU", limits.cpu_s)
    _limit("RLIMIT_CORE", 0)
    with contextlib.suppress(OSError):
        os.nice(NICE)


def confine(limits: Limits) -> None:
    """Apply the limits, after the libraries are loaded and before any input is read."""
    # data counts what is used; address space is the rough limit where the kernel does not count data
    _limit("RLIMIT_DATA", limits.memory_bytes)
    _limit("RLIMIT_AS", limits.memory_bytes + LIBRARIES_BYTES)
    _limit("RLIMIT_FSIZE", 0)
    _limit("RLIMIT_NOFILE", OPEN_FILES)
    _limit("RLIMIT_NPROC", 0)  # no child, no thread (root is exempt: do not run the service as root)


def _limit(name: str, value: int) -> None:
    number = getattr(resource, name, None)
    if number is None:  # not on this system
        return
    _, hard = resource.getrlimit(number)
    if hard != resource.RLIM_INFINITY:
        value = min(value, hard)
    with contextlib.suppress(ValueError, OSError):  # some systems refuse some limits; the others hold
        resource.setrlimit(number, (value, value))
