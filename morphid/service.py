"""Client of a running MorphID service: short methods over httpx, with errors as messages."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import httpx

from morphid.connections import client_for
from morphid.exits import CommandError, Exit

Document = dict[str, Any]
FINISHED = frozenset({"succeeded", "failed", "cancelled", "expired"})
POLL_S = 0.25
PATIENCE_S = 30.0  # s in which a restarting service comes back


class Service:
    """One MorphID service.

    Parameters
    ----------
    url : base address, such as ``http://127.0.0.1:8000``.
    api_key : for services that require one.
    transport : handed in by tests.
    """

    def __init__(
        self, url: str, api_key: str | None = None, *, transport: httpx.BaseTransport | None = None
    ) -> None:
        self.url = url.rstrip("/")
        headers = {"Authorization": f"Bearer {_sendable(api_key)}"} if api_key else {}
        self._http = client_for(self.url, timeout=30.0, headers=headers, transport=transport)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._http.close()

    def submit(self, operation: str, body: Document, *, idempotency_key: str | None = None) -> Document:
        """Post a job and return its representation."""
        headers = {"Idempotency-Key": idempotency_key} if idempotency_key else {}
        return self._document("POST", f"/{operation}", json=body, headers=headers)

    def upload(self, path: Path, said: Mapping[str, Any] | None = None) -> Document:
        """Upload a sample file and give its representation, with an ``id``.

        Parameters
        ----------
        said : what is declared about the file: texts, or what goes into the form as JSON.
        """
        parts = {
            name: value if isinstance(value, str) else json.dumps(value)
            for name, value in (said or {}).items()
        }
        with path.open("rb") as stream:
            return self._document("POST", "/trajectories", files={"file": (path.name, stream)}, data=parts)

    def jobs(self, *, status: str | None = None, limit: int = 20) -> Sequence[Document]:
        """List jobs, the newest first."""
        query: dict[str, str | int] = {"limit": limit}
        if status:
            query["status"] = status
        found: Sequence[Document] = self._document("GET", "/jobs", params=query)["jobs"]
        return found

    def job(self, job_id: str) -> Document:
        """Return one job."""
        return self._document("GET", f"/jobs/{job_id}")

    def cancel(self, job_id: str) -> Document:
        """Request the cancellation of a job."""
        return self._document("POST", f"/jobs/{job_id}/cancel")

    def result(self, job_id: str) -> Document:
        """Return the result of a finished job."""
        return self._document("GET", f"/jobs/{job_id}/result")

    def request(self, job_id: str) -> Document:
        """Return the request of a job."""
        return self._document("GET", f"/jobs/{job_id}/request")

    def watch(self, job_id: str, *, poll_s: float = POLL_S) -> Iterator[Document]:
        """Yield the job repeatedly until it is finished; wait for a service that restarts meanwhile."""
        patience_until = time.monotonic() + PATIENCE_S
        while True:
            try:
                job = self.job(job_id)
            except CommandError as error:
                if error.code is not Exit.UNREACHABLE or time.monotonic() > patience_until:
                    raise
            else:
                patience_until = time.monotonic() + PATIENCE_S
                yield job
                if job["status"] in FINISHED:
                    return
            time.sleep(poll_s)

    def artifacts(self, job_id: str) -> dict[str, bytes]:
        """Return all files of a job, by name."""
        found = self._document("GET", f"/jobs/{job_id}/artifacts")["artifacts"]
        names = [str(item["name"]) for item in found]
        return {name: self._request("GET", f"/jobs/{job_id}/artifacts/{name}").content for name in names}

    def _document(self, method: str, path: str, **kwargs: Any) -> Document:
        document: Document = self._request(method, path, **kwargs).json()
        return document

    def _request(self, method: str, path: str, **kwargs: Any) -> httpx.Response:
        try:
            answer = self._http.request(method, path, **kwargs)
        except httpx.TransportError as error:
            raise CommandError(
                f"no MorphID service answers at {self.url} ({type(error).__name__})",
                code=Exit.UNREACHABLE,
                hint="start one with `morphid serve`, or name its address with --url or MORPHID_URL",
            ) from None
        if answer.is_error:
            raise _refusal(answer)
        return answer


def _sendable(api_key: str) -> str:
    """Return the key without surrounding white space from copying."""
    key = api_key.strip()
    if not key.isascii() or not key.isprintable() or " " in key:
        raise CommandError(
            "the API key is no key", code=Exit.USAGE, hint="keys look like mid_4k7m2x9q_...: copy it whole"
        )
    return key


def _refusal(answer: httpx.Response) -> CommandError:
    """Convert a problem document (RFC 9457) to a message."""
    try:
        problem = answer.json()
    except ValueError:
        problem = {}
    if not isinstance(problem, dict):
        problem = {}
    code = Exit.INVALID_INPUT if 400 <= answer.status_code < 500 else Exit.FAILED
    return CommandError(
        str(problem.get("detail") or problem.get("title") or f"the service answered {answer.status_code}"),
        code=code,
        hint="\n".join([str(problem.get("hint") or ""), *_further_faults(problem)]).strip(),
        pointer=str(problem.get("pointer") or ""),
    )


def _further_faults(problem: Document) -> Iterator[str]:
    """Return the further faults of the request, one per line; the first one is the problem's own."""
    for fault in (problem.get("errors") or [])[1:]:
        hint = f" ({fault['hint']})" if fault.get("hint") else ""
        yield f"{fault.get('pointer', '')}: {fault.get('detail', '')}{hint}"
