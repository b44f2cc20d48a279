"""The law that tests talk to this machine alone, and how it is enforced.

In the process of the tests an audit hook sees every connection, datagram and look-up of the interpreter, in
whatever thread or event loop it is made; libpq, which makes its own, is watched at psycopg's one way to it.
Started processes get an environment that leads nowhere else and lets webhooks go to this machine only.
"""

from __future__ import annotations

import ipaddress
import os
import socket
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

HERE = ("127.0.0.1", "localhost", "[::1]")
DIAL_ONLY = "MORPHID_WEBHOOK_DIAL_ONLY"
LEAD_ELSEWHERE = ("MORPHID_URL", "MORPHID_DATABASE_URL", "MORPHID_BROKER_URL", "MORPHID_TRACES")
LEAD_ELSEWHERE_PREFIXES = ("OTEL_", "PG")
PROXIES = ("http_proxy", "https_proxy", "all_proxy", "ftp_proxy")
LOCAL_FAMILIES = (socket.AF_UNIX, getattr(socket, "AF_NETLINK", socket.AF_UNIX))

TO_AN_ADDRESS = ("socket.connect", "socket.sendto", "socket.sendmsg")
OF_A_NAME = ("socket.getaddrinfo", "socket.gethostbyname", "socket.gethostbyaddr")

refused: list[str] = []  # also those that the program under test took for a failed connection


class BeyondThisMachine(RuntimeError):
    """A test wanted to talk to another machine."""


def is_here(host: str | bytes | None) -> bool:
    """Whether a name or an address reaches this machine only."""
    name = (host.decode("ascii", "replace") if isinstance(host, bytes) else host or "").strip("[]").lower()
    if name in {"", "localhost"}:
        return True
    try:
        address = ipaddress.ip_address(name)
    except ValueError:
        return False
    inner = getattr(address, "ipv4_mapped", None) or address
    return bool(inner.is_loopback or inner.is_unspecified)


def _refuse(what: str) -> None:
    refused.append(what)
    raise BeyondThisMachine(f"tests talk to this machine alone: {what}")


def _watch(event: str, arguments: tuple[Any, ...]) -> None:
    if event in TO_AN_ADDRESS:
        link, address = arguments
        if address is None or link.family in LOCAL_FAMILIES:
            return
        if link.family not in {socket.AF_INET, socket.AF_INET6} or not is_here(address[0]):
            _refuse(f"{event} {address}")
    elif event in OF_A_NAME:
        if not is_here(arguments[0]):
            _refuse(f"{event} {arguments[0]!r}")
    elif event == "socket.getnameinfo" and not is_here(arguments[0][0]):
        _refuse(f"{event} {arguments[0]}")


def _watch_libpq() -> None:
    """Look at the address before psycopg hands it to libpq, which no audit hook sees into."""
    try:
        from psycopg import generators
        from psycopg.conninfo import conninfo_to_dict
    except ImportError:
        return
    inner = generators.connect

    def connect(conninfo: str) -> Any:
        reported = conninfo_to_dict(conninfo)
        hosts = [part for name in ("host", "hostaddr") for part in str(reported.get(name) or "").split(",")]
        for host in hosts:
            if not host.startswith(("/", "@")) and not is_here(host):  # those are sockets in the file system
                _refuse(f"libpq {host}")
        return inner(conninfo)

    generators.connect = connect


def stay_here() -> None:
    """Enforce the law from now on, for this process and what it starts."""
    for name in list(os.environ):
        if name in LEAD_ELSEWHERE or name.startswith(LEAD_ELSEWHERE_PREFIXES) or name.lower() in PROXIES:
            del os.environ[name]
    os.environ[DIAL_ONLY] = ",".join(HERE)
    _watch_libpq()
    sys.addaudithook(_watch)


@contextmanager
def refusals() -> Iterator[list[str]]:
    """Give what is refused in the block, and do not hold it against the test."""
    before = len(refused)
    seen: list[str] = []
    try:
        yield seen
    finally:
        seen += refused[before:]
        del refused[before:]
