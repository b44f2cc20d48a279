"""The broker that comes with `morphid serve`."""

from __future__ import annotations

import socket
from pathlib import Path

import pytest
import redis

from morphid import broker
from morphid.exits import CommandError, Exit
from morphid.supervisor import Supervisor


def test_a_taken_port_is_stepped_around() -> None:
    """The preferred port when it is free, another one when it is not."""
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        assert broker.free_port(port) != port
    assert broker.free_port(port) == port


def test_a_missing_server_gives_a_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without any server program the error says what to install."""
    monkeypatch.setattr(broker.shutil, "which", lambda _name: None)
    monkeypatch.setattr(broker.importlib.util, "find_spec", lambda _name: None)
    with pytest.raises(CommandError) as caught:
        broker.find_server()
    assert caught.value.code is Exit.ENVIRONMENT
    assert "redis-server" in caught.value.hint


def test_a_server_on_path_is_preferred(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The system's own server wins over the bundled one."""
    own = tmp_path / "valkey-server"
    own.touch(mode=0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    assert broker.find_server() == own


def test_the_queue_survives_a_restart_and_asks_for_a_password(tmp_path: Path) -> None:
    """What was queued is there after a kill of the broker; strangers on this machine get nothing."""
    queue = broker.prepare_broker(tmp_path)
    overseer = Supervisor(tmp_path / "logs", report=lambda _sentence: None)
    child = overseer.start(queue.spec)
    assert overseer.wait_until(child, queue.answers, 10.0), child.last_words()
    with redis.Redis.from_url(queue.url) as client:
        client.rpush("morphid", "hint")
        client.config_set("appendfsync", "always")
        client.rpush("morphid", "hint")
    child.stop()
    child.start()
    assert overseer.wait_until(child, queue.answers, 10.0), child.last_words()
    with redis.Redis.from_url(queue.url) as client:
        assert client.llen("morphid") == 2
    with redis.Redis(port=queue.port) as stranger, pytest.raises(redis.AuthenticationError):
        stranger.llen("morphid")
    overseer.stop()
    assert not queue.answers()
