"""Message brokers of the tests' own: the one of `morphid serve`, and a plain server behind a Redis URL."""

from __future__ import annotations

import contextlib
import random
import socket
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from morphid.broker import LOOPBACK, find_server, free_port, prepare_broker
from morphid.supervisor import ChildSpec


@dataclass(frozen=True)
class BrokerServer:
    """How to run a broker and where it listens.

    Parameters
    ----------
    spec : the process.
    url : its address.
    answers : whether it takes commands.
    """

    spec: ChildSpec
    url: str
    answers: Callable[[], bool]


def quiet_port() -> int:
    """A port that nobody takes while the broker is away: below those that the system gives to connections."""
    return random.randrange(20_000, 30_000)


def embedded(folder: Path) -> BrokerServer:
    """The broker that `morphid serve` runs: a password, a journal on disk."""
    broker = prepare_broker(folder, preferred_port=quiet_port())
    return BrokerServer(broker.spec, broker.url, broker.answers)


def plain(folder: Path) -> BrokerServer:
    """A server as somebody else runs it: no password, nothing on disk; a restart forgets every message."""
    port = free_port(quiet_port())
    folder.mkdir(parents=True, exist_ok=True)
    command = [
        str(find_server()),
        "--port",
        str(port),
        "--bind",
        LOOPBACK,
        "--save",
        "",
        "--dir",
        str(folder),
    ]

    def answers() -> bool:
        with contextlib.suppress(OSError), socket.create_connection((LOOPBACK, port), timeout=0.5) as link:
            link.sendall(b"PING\r\n")
            return link.recv(64).startswith(b"+PONG")
        return False

    return BrokerServer(ChildSpec(name="broker", command=command), f"redis://{LOOPBACK}:{port}/0", answers)
