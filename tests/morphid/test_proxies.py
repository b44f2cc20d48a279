"""A service on this machine is reached directly, whatever proxies the environment names."""

from __future__ import annotations

import json
import socket
import subprocess
import sys
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from urllib.request import getproxies

import httpx
import pytest
import yaml
from typer.testing import CliRunner

from app.observability import tracing
from morphid.connections import client_for
from morphid.exits import CommandError, Exit
from morphid.main import app
from morphid.serve import _alive

RUNNER = CliRunner()
NAMES = ("http_proxy", "https_proxy", "all_proxy", "no_proxy")
EVERY_NAME = (*NAMES, *map(str.upper, NAMES))


class Answering(BaseHTTPRequestHandler):
    """Says that it lives, and no more."""

    def do_GET(self) -> None:
        """Answer."""
        body = json.dumps({"status": "alive", "version": "0", "jobs": []}).encode()
        self.send_response(200)
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    do_POST = do_GET

    def log_message(self, *_: object) -> None:
        """Say nothing."""


@pytest.fixture
def here() -> Iterator[str]:
    """The address of something that answers on this machine."""
    server = ThreadingHTTPServer(("127.0.0.1", 0), Answering)
    Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}"
    server.shutdown()
    server.server_close()


@pytest.fixture
def dead_port() -> Iterator[int]:
    """A port where nobody answers for as long as the test runs."""
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        yield int(taken.getsockname()[1])


@pytest.fixture(params=["http_proxy", "HTTP_PROXY", "all_proxy", "ALL_PROXY", "socks", "SOCKS", "unknown"])
def proxied(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch, dead_port: int) -> None:
    """An environment whose proxy is dead, needs a package that is missing, or is of no known kind."""
    for name in EVERY_NAME:
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setitem(sys.modules, "socksio", None)  # not installed
    scheme = {"socks": "socks5", "SOCKS": "socks5h", "unknown": "gopher"}.get(request.param, "http")
    name = {"socks": "all_proxy", "SOCKS": "ALL_PROXY", "unknown": "all_proxy"}.get(
        request.param, request.param
    )
    monkeypatch.setenv(name, f"{scheme}://127.0.0.1:{dead_port}")
    assert getproxies()


@pytest.mark.usefixtures("proxied")
def test_the_command_s_clients_reach_this_machine(here: str) -> None:
    """`jobs`, `doctor`, the readiness that `serve` waits for, and the client scripts."""
    ended = RUNNER.invoke(app, ["jobs", "ls", "--json", "--url", here])
    assert (ended.exit_code, json.loads(ended.stdout)) == (Exit.OK, []), ended.output
    reported = json.loads(RUNNER.invoke(app, ["doctor", "--json", "--url", here]).stdout)["findings"]
    assert "has version 0" in reported[0]["message"]
    assert _alive("127.0.0.1", int(here.rpartition(":")[2]))
    with client_for(here.replace("127.0.0.1", "localhost")) as client:
        assert client.get("/livez").status_code == httpx.codes.OK


@pytest.mark.usefixtures("proxied")
def test_the_example_clients_reach_this_machine(
    here: str, examples: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What users copy from does not hand a local key to a proxy either."""
    monkeypatch.syspath_prepend(examples / "clients")
    import job

    with job.service_at(here) as client:
        assert client.get("/livez").json()["status"] == "alive"


@pytest.mark.parametrize("kind", ["socks5", "socks5h", "gopher"])
@pytest.mark.parametrize("words", [["jobs", "ls"], ["doctor"]])
def test_a_proxy_that_cannot_be_used_is_a_sentence(
    kind: str, words: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """To another machine there is a way through a proxy; where it is barred, no traceback says so."""
    for name in EVERY_NAME:
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setitem(sys.modules, "socksio", None)
    monkeypatch.setenv("ALL_PROXY", f"{kind}://127.0.0.1:9")
    ended = RUNNER.invoke(app, [*words, "--url", "http://morphid.example"])
    assert ended.exit_code == Exit.ENVIRONMENT
    assert "ALL_PROXY" in ended.output
    assert "proxy" in ended.output
    monkeypatch.setenv("NO_PROXY", "morphid.example")
    client_for("http://morphid.example").close()  # the way round that the sentence names


@pytest.mark.parametrize("url", ["http://[::1", "http://127.0.0.1:eighty", "http://127.0.0.1:99999"])
def test_an_address_that_is_none_is_a_sentence(url: str) -> None:
    """A misspelt address is wrong usage."""
    with pytest.raises(CommandError, match="address") as caught:
        client_for(url)
    assert caught.value.code is Exit.USAGE


@pytest.mark.usefixtures("proxied")
def test_a_collector_on_this_machine_is_reached_directly(here: str) -> None:
    """Traces go to a loopback collector without a proxy, and elsewhere as the environment says."""
    session = tracing._session_for(here)
    assert session is not None
    assert session.post(f"{here}/v1/traces", data=b"x", timeout=5.0).ok
    session.close()
    assert tracing._session_for("http://collector:4318") is None


@pytest.mark.usefixtures("proxied")
def test_the_container_s_health_check_is_direct(here: str, root: Path) -> None:
    """Docker hands its own proxy settings on to containers."""
    services = yaml.safe_load((root / "docker-compose.yml").read_text("utf-8"))["services"]
    _, _, option, program = services["api"]["healthcheck"]["test"]
    program = program.replace("http://127.0.0.1:8000", here)
    assert subprocess.run([sys.executable, option, program], check=False).returncode == 0
