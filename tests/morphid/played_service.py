"""A service that a test plays, in the place of the network."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

import httpx


class PlayedService:
    """Answers like a service: a job that ends after two looks, in the way that the test wants.

    Parameters
    ----------
    operation : the only one that it knows.
    result : of the job.
    ending : final status.
    files : what the job leaves behind.
    request : the request with which the job was posted.
    """

    def __init__(
        self,
        operation: str,
        result: dict[str, Any],
        ending: str = "succeeded",
        *,
        files: Mapping[str, bytes] = MappingProxyType({"convergence.svg": b"<svg/>"}),
        request: Mapping[str, Any] = MappingProxyType({}),
    ) -> None:
        self.files = files
        self.request = dict(request)
        self.operation = operation
        self.result = result
        self.ending = ending
        self.requested: list[str] = []
        self.body: dict[str, Any] = {}

    def __call__(self, request: httpx.Request) -> httpx.Response:
        """Answer one request."""
        call = f"{request.method} {request.url.path}"
        self.requested.append(call)
        if call == f"POST /{self.operation}":
            self.body = json.loads(request.content)
        status = "running" if self.requested.count(call) < 2 else self.ending
        answers = {
            "POST /trajectories": httpx.Response(201, json={"id": f"traj_{self.requested.count(call)}"}),
            f"POST /{self.operation}": httpx.Response(202, json=self.job("queued")),
            "GET /jobs/job_1": httpx.Response(200, json=self.job(status)),
            "GET /jobs/job_1/request": httpx.Response(200, json=self.request),
            "GET /jobs/job_1/result": httpx.Response(200, json=self.result),
            "GET /jobs/job_1/artifacts": httpx.Response(
                200, json={"artifacts": [{"name": name} for name in self.files]}
            ),
        }
        answers |= {
            f"GET /jobs/job_1/artifacts/{name}": httpx.Response(200, content=content)
            for name, content in self.files.items()
        }
        return answers.get(call) or httpx.Response(404, json={"title": "Not found"})

    def job(self, status: str) -> dict[str, Any]:
        """Give the job as it is."""
        error = (
            {"code": "diverged", "detail": "it flew apart", "hint": "stiffen it"}
            if status == "failed"
            else None
        )
        return {
            "id": "job_1",
            "operation": self.operation,
            "status": status,
            "progress": {"fraction": 0.5},
            "partial": False,
            "error": error,
        }


Play = Callable[[PlayedService], PlayedService]
