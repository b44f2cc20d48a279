"""Rolling restart: new processes start, then the old ones end, under constant load."""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass, field
from dataclasses import replace as replaced

import httpx
import pytest

from morphid import serve
from morphid.broker import LOOPBACK, free_port
from tests.app.request_documents import simulate_document
from tests.faults.rig import Rig
from tests.faults.walk_length import flight_steps

pytestmark = pytest.mark.faults

FLIGHT_S = 2.5
CLIENTS = 4
ROUNDS = 3


@dataclass
class Proxy:
    """What a proxy before two API processes knows: where to knock."""

    urls: list[str] = field(default_factory=list)


class Load(threading.Thread):
    """Posts flights and polls them, on connections that it keeps, until stopped.

    Every unexpected response is a failure, except a refused connection: no byte was sent, and any proxy tries
    the next one.
    """

    def __init__(self, rig: Rig, proxy: Proxy) -> None:
        super().__init__(daemon=True)
        self.rig, self.proxy = rig, proxy
        self.over = threading.Event()
        self.served = 0
        self.failures: list[str] = []
        self._clients: dict[str, httpx.Client] = {}

    def run(self) -> None:
        """Post and poll."""
        try:
            self._work()
        finally:
            for client in self._clients.values():
                client.close()

    def _work(self) -> None:
        jobs: list[str] = []
        while not self.over.is_set():
            answer = self._ask("POST", "/simulate", {**simulate_document(), "duration_s": FLIGHT_S})
            if answer is not None and answer.status_code == 202:
                jobs.append(answer.json()["id"])
                self.rig.ledger.accept(jobs[-1], flight_steps(FLIGHT_S))
            elif answer is not None:
                self.failures.append(f"POST: {answer.status_code} {answer.text[:200]}")
            for job in jobs[-5:]:
                answer = self._ask("GET", f"/jobs/{job}")
                if answer is not None and answer.status_code != 200:
                    self.failures.append(f"GET: {answer.status_code} {answer.text[:200]}")
            time.sleep(0.05)

    def _ask(self, method: str, path: str, body: object = None) -> httpx.Response | None:
        for url in list(self.proxy.urls):
            client = self._clients.setdefault(url, httpx.Client(base_url=url, timeout=30.0))
            try:
                answer = client.request(method, path, json=body)
            except httpx.ConnectError:
                continue
            except httpx.HTTPError as error:
                self.failures.append(f"{method} {path}: {type(error).__name__} {error}")
                return None
            self.served += 1
            return answer
        self.failures.append("nobody opened")
        return None


def start_api(rig: Rig, name: str) -> str:
    """Start one more API process; return its address once it responds."""
    port = free_port(0)
    spec = serve.api_process({**rig._environment, "MORPHID_PORT": str(port)}, LOOPBACK, port)
    child = rig.supervisor.start(replaced(spec, name=name))
    rig.url = f"http://{LOOPBACK}:{port}"
    assert rig.supervisor.wait_until(child, rig.api_answers, 30.0), child.last_words(40)
    return rig.url


def test_a_rolling_restart_loses_nothing(rig: Rig) -> None:
    """API and worker exchanged three times under posts and polls: no failed request, no lost job."""
    proxy = Proxy([start_api(rig, "api-0")])
    rig.start_worker("worker-0")
    loads = [Load(rig, proxy) for _ in range(CLIENTS)]
    for load in loads:
        load.start()
    for number in range(1, ROUNDS + 1):
        new = start_api(rig, f"api-{number}")
        proxy.urls.insert(0, new)
        rig.start_worker(f"worker-{number}")
        time.sleep(2.0)  # both serve
        began = time.monotonic()
        rig.take_away(f"api-{number - 1}")
        api_s = time.monotonic() - began
        rig.take_away(f"worker-{number - 1}")
        print(f"round {number}: API ended in {api_s:.1f} s, both in {time.monotonic() - began:.1f} s")
        del proxy.urls[1:]
        time.sleep(1.0)
    for load in loads:
        load.over.set()
    for load in loads:
        load.join(60.0)
    print(f"{sum(load.served for load in loads)} requests, {len(rig.ledger.promises)} jobs")
    assert [failure for load in loads for failure in load.failures] == []
    assert len(rig.ledger.promises) > 4 * ROUNDS
