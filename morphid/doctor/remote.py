"""Checks of a service from outside, as clients see it."""

from __future__ import annotations

import time
from collections.abc import Iterator
from email.utils import parsedate_to_datetime
from typing import TYPE_CHECKING, Any

from morphid.connections import client_for
from morphid.doctor.findings import Finding, fail, ok, warn
from morphid.exits import CommandError

if TYPE_CHECKING:
    import httpx

TIMEOUT_S = 5.0
SLOW_S = 1.0
SKEW_S = 5.0  # the Date header has whole seconds


def served_version(client: httpx.Client) -> str | None:
    """Version of the service at a client's address; None if there is none."""
    import httpx

    try:
        answer = client.get("/livez").json()
    except (httpx.HTTPError, ValueError):
        return None
    return str(answer["version"]) if isinstance(answer, dict) and answer.get("status") == "alive" else None


def service(url: str, api_key: str | None) -> Iterator[Finding]:
    """Check that the service is alive and ready, and that our key and clock fit."""
    import httpx

    try:
        client = client_for(url, timeout=TIMEOUT_S)
    except CommandError as error:
        yield fail("service", error.message, error.hint)
        return
    with client:
        try:
            yield from _service(client, url, api_key)
        except httpx.HTTPError as error:
            remedy = "start it with `morphid serve`, or correct --url"
            yield fail("service", f"{url} does not answer: {type(error).__name__} {error}", remedy)


def _service(client: httpx.Client, url: str, api_key: str | None) -> Iterator[Finding]:
    import httpx

    from morphdata.version import VERSION

    began = time.monotonic()
    alive = client.get("/livez")
    took_s = time.monotonic() - began
    version = served_version(client)
    if version is None:
        yield fail("service", f"{url} answers {alive.status_code}, but is not MorphID", "correct --url")
        return
    if version != VERSION:
        yield warn(
            "service", f"{url} has version {version}, this is {VERSION}", "use the same version for both"
        )
    elif took_s > SLOW_S:
        yield warn("service", f"{url} took {took_s:.1f} s to answer", "the machine or the network is busy")
    else:
        yield ok("service", f"MorphID {version} at {url}")
    yield from _clock(alive)
    yield from _readiness(client.get("/readyz").json())
    headers = {"Authorization": f"Bearer {api_key}"} if api_key else {}
    listed = client.get("/jobs", params={"limit": 1}, headers=headers)
    if listed.status_code == httpx.codes.OK:
        yield ok("access", "jobs can be listed")
    else:
        problem = listed.json()
        remedy = problem.get("hint") or "set MORPHID_API_KEY"
        yield fail("access", f"{listed.status_code}: {problem.get('detail', '')}", remedy)


def _clock(answer: Any) -> Iterator[Finding]:
    if "date" not in answer.headers:
        return
    skew_s = parsedate_to_datetime(answer.headers["date"]).timestamp() - time.time()
    if abs(skew_s) > SKEW_S:
        yield warn(
            "clock", f"the service's clock is {skew_s:+.0f} s off this machine's", "synchronise both by NTP"
        )


def _readiness(ready: dict[str, Any]) -> Iterator[Finding]:
    remedies = {
        "database": "see MORPHID_DATABASE_URL, `morphid db upgrade`",
        "broker": "start it, or correct MORPHID_BROKER_URL; jobs wait until it is back",
    }
    for part, remedy in remedies.items():
        state = ready[part]
        yield ok(part, state) if state in {"ok", "not checked (no Redis)"} else fail(part, state, remedy)
    workers = ready["workers"]
    counts = "{alive} take jobs, {stalled} no longer do, {busy} of {slots} slots busy".format(**workers)
    message = f"{workers['status']}: {counts}"
    if workers["stalled"]:
        yield fail("workers", message, "restart the stalled ones; their logs say what they wait for")
    elif workers["status"] == "ok":
        yield ok("workers", message)
    else:
        yield warn("workers", message, "start a worker: jobs wait")
