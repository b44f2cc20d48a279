"""The machine: Python, packages, the compiler, cores, memory, files, the data directory."""

from __future__ import annotations

import json
import os
import platform
import re
import resource
import shutil
import subprocess
import sys
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path

from morphid.doctor.findings import Finding, fail, ok, warn
from worker.numerics import share_cores, takes_files, usable_cores

EXTRAS = ("server", "telemetry")  # of the installation; development tools are not examined
CONSTRAINTS = Path(__file__).resolve().parents[2] / "constraints.txt"
COMPILE_WITHIN_S = 120.0
MIN_MEMORY = 2 * 2**30  # bytes; the kernels' compiler alone takes 0.5 GiB
MIN_SPACE, SCARCE_SPACE = 200 * 2**20, 2 * 2**30
MIN_FILES, FEW_FILES = 256, 1024
CGROUP_MEMORY = Path("/sys/fs/cgroup/memory.max")
OCTAL = re.compile(r"\\([0-7]{3})")  # how /proc/mounts writes blanks and other characters
NETWORK_FILE_SYSTEMS = frozenset({"nfs", "nfs4", "cifs", "smb3", "smbfs", "9p", "fuse.sshfs"})
COMPILE = """
import json, numba
from morphcore.simulate.kernels.interpolate import blend
assert numba.njit(lambda x: x + 1)(1) == 2
print(json.dumps({"cache": getattr(blend._cache, "cache_path", None), "numba": numba.__version__}))
"""


def python() -> Iterator[Finding]:
    """Report the Python version; one that is too old cannot load this command."""
    yield ok("python", f"Python {platform.python_version()} at {sys.executable}")


def packages() -> Iterator[Finding]:
    """Check that all required packages are installed, in an accepted and preferably a tested version."""
    from packaging.requirements import Requirement

    wrong: list[str] = []
    for text in metadata.requires("morphid") or []:
        requirement = Requirement(text)
        wanted = requirement.marker is None or any(
            requirement.marker.evaluate({"extra": extra}) for extra in ("", EXTRAS[0])
        )
        if not wanted:
            continue
        found = _version(requirement.name)
        if found is None:
            wrong.append(f"{requirement.name} is missing")
        elif not requirement.specifier.contains(found, prereleases=True):
            wrong.append(f"{requirement.name} {found} is not {requirement.specifier}")
    if wrong:
        yield fail("packages", "; ".join(wrong), "pip install -c constraints.txt 'morphid[server]'")
        return
    yield ok("packages", "all required packages are installed")
    yield from _differing()


def _differing() -> Iterator[Finding]:
    if not CONSTRAINTS.is_file():
        return  # installed without its repository
    from packaging.requirements import Requirement

    lines = [line.partition("#")[0].strip() for line in CONSTRAINTS.read_text("utf-8").splitlines()]
    tested = {each.name: each.specifier for line in lines if line for each in [Requirement(line)]}
    other = {
        name: found
        for name, specifier in tested.items()
        if (found := _version(name)) is not None and not specifier.contains(found, prereleases=True)
    }
    if other:
        shown = ", ".join(
            f"{name} {found} (tested: {str(tested[name]).removeprefix('==')})"
            for name, found in sorted(other.items())[:5]
        )
        more = f" and {len(other) - 5} more" if len(other) > 5 else ""
        yield warn("constraints", shown + more, "pip install -c constraints.txt 'morphid[server]'")
    else:
        yield ok("constraints", "all in the tested versions")


def _version(name: str) -> str | None:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return None


def compiler() -> Iterator[Finding]:
    """Check that numba compiles and that compiled code can be cached."""
    remedy = "pip install -c constraints.txt morphid; the message of the compiler says more"
    try:
        done = subprocess.run(
            [sys.executable, "-P", "-c", COMPILE],
            capture_output=True,
            text=True,
            timeout=COMPILE_WITHIN_S,
            check=False,
        )
    except subprocess.TimeoutExpired:
        yield fail("compiler", f"numba did not compile a line within {COMPILE_WITHIN_S:g} s", remedy)
        return
    if done.returncode != 0:
        last = done.stderr.strip().splitlines()[-1:] or ["no message"]
        yield fail("compiler", f"the kernels cannot be loaded: {last[0]}", remedy)
        return
    answer = json.loads(done.stdout.splitlines()[-1])
    yield ok("compiler", f"numba {answer['numba']} compiles")
    cache = Path(answer["cache"]) if answer["cache"] else None
    if cache is None or not takes_files(cache):
        yield warn(
            "kernel cache",
            f"compiled kernels cannot be kept in {cache}: each start of a worker compiles for minutes",
            "set NUMBA_CACHE_DIR to a folder that the service's user may write",
        )
    else:
        yield ok("kernel cache", f"compiled kernels are kept in {cache}")


def cores(workers: int) -> Iterator[Finding]:
    """Check that there are enough cores and memory for the workers."""
    here, usable = os.cpu_count() or 1, usable_cores()
    limited = (
        "" if usable == here else f" (of {here}; the rest is excluded by CPU affinity or a container quota)"
    )
    shared = f"{workers} x {share_cores(workers)} threads on {usable} cores{limited}"
    if workers > usable:
        yield warn(
            "cores",
            f"{shared}: jobs compete for cores",
            f"set MORPHID_WORKERS (--workers) to at most {usable}",
        )
    else:
        yield ok("cores", shared)
    memory = _memory_limit()
    if memory < MIN_MEMORY * workers:
        yield warn(
            "memory",
            f"{memory / 2**30:.1f} GiB for {workers} jobs at once",
            f"give {MIN_MEMORY // 2**30} GiB per job that runs at once, or lower MORPHID_WORKERS",
        )
    else:
        yield ok("memory", f"{memory / 2**30:.1f} GiB")


def _memory_limit() -> int:
    installed = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    try:
        return min(installed, int(CGROUP_MEMORY.read_text("ascii")))
    except (OSError, ValueError):
        return installed  # no readable limit


def files() -> Iterator[Finding]:
    """Check that the API may open a file for each of its clients."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    remedy = "raise it: `ulimit -n 65536`, LimitNOFILE= of systemd, `ulimits:` of docker-compose.yml"
    limit = soft if hard == resource.RLIM_INFINITY else hard  # the API raises its own soft limit
    if limit == resource.RLIM_INFINITY:
        yield ok("open files", "any number")
    elif limit < MIN_FILES:
        yield fail("open files", f"at most {limit}", remedy)
    elif limit < FEW_FILES:
        message = f"at most {limit}: that many clients at once, less what the service needs"
        yield warn("open files", message, remedy)
    else:
        yield ok("open files", f"up to {limit}")


def data_dir(home: Path, *, sqlite: bool) -> Iterator[Finding]:
    """Check that the data directory is writable and has free space."""
    folder = home.expanduser().resolve()
    if not takes_files(folder):
        yield fail(
            "data directory",
            f"{folder} cannot be written",
            "give it to the service's user, make room, or choose another: MORPHID_DATA_DIR, --data-dir",
        )
        return
    kind = _file_system(folder)
    if sqlite and kind in NETWORK_FILE_SYSTEMS:
        yield fail(
            "data directory",
            f"{folder} lies on {kind}, where SQLite's locks do not work",
            "use a local disk, or Postgres (MORPHID_DATABASE_URL)",
        )
    else:
        yield ok("data directory", str(folder))
    free = shutil.disk_usage(next(each for each in (folder, *folder.parents) if each.exists())).free
    message = f"{free / 2**30:.1f} GiB free"
    remedy = "delete finished jobs (`morphid jobs`, retention), or grow the disk"
    if free < MIN_SPACE:
        yield fail("disk", message, remedy)
    elif free < SCARCE_SPACE:
        yield warn("disk", message, remedy)
    else:
        yield ok("disk", message)


def _file_system(folder: Path) -> str:
    """Type of the file system of `folder`; empty without /proc."""
    found = ("", "")
    try:
        for line in Path("/proc/mounts").read_text("utf-8", "surrogateescape").splitlines():
            _, place, kind, *_ = line.split()
            mount = OCTAL.sub(lambda found: chr(int(found[1], 8)), place)
            if folder.is_relative_to(mount) and len(mount) >= len(found[0]):
                found = (mount, kind)
    except OSError:
        pass
    return found[1]
