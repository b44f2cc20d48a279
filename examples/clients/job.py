"""Functions shared by all clients: post a request, poll its job, fetch the result."""

from __future__ import annotations

import csv
import json
import os
import time
from pathlib import Path
from typing import Any

import httpx

EXAMPLES = Path(__file__).resolve().parent.parent
COLUMNS = {
    "time_s": "t",
    "sweep_left_rad": "sweep_left",
    "sweep_right_rad": "sweep_right",
    "phi_rad": "phi",
    "theta_rad": "theta",
    "psi_rad": "psi",
}


def service_at(url: str) -> httpx.Client:
    """Open a client, with the key in MORPHID_API_KEY for a service that requires keys."""
    key = os.environ.get("MORPHID_API_KEY")
    headers = {"Authorization": f"Bearer {key}"} if key else {}
    # a service on this machine is never reached through a proxy, whatever http_proxy and ALL_PROXY say
    here = httpx.URL(url).host in {"127.0.0.1", "localhost", "::1"}
    return httpx.Client(base_url=url, timeout=30.0, headers=headers, trust_env=not here)


def vehicle() -> dict[str, Any]:
    """Read the example aircraft and flight condition."""
    return {
        name: json.loads((EXAMPLES / f"{name}.json").read_text("utf-8")) for name in ("aircraft", "flight")
    }


def sample(name: str, role: str) -> dict[str, Any]:
    """Read a sample flight as it stands in a request (s, rad)."""
    with (EXAMPLES / f"{name}.csv").open(newline="", encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    series = {key: [float(row[column]) for row in rows] for key, column in COLUMNS.items()}
    return {"name": name, "role": role, **series}


def run(service: httpx.Client, operation: str, body: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Start an operation and wait for its end; return the job and its result.

    Raises
    ------
    SystemExit : the request is refused or the job does not succeed; with the reason.
    """
    answer = service.post(f"/{operation}", json=body)
    if answer.is_error:
        raise SystemExit(answer.text)
    place = answer.headers["Location"]
    job = answer.json()
    while job["status"] in {"queued", "running", "cancelling"}:
        time.sleep(0.5)
        job = service.get(place).raise_for_status().json()
        print(f"{job['status']:<10} {100 * ((job.get('progress') or {}).get('fraction') or 0.0):5.1f} %")
    if job["status"] != "succeeded":
        raise SystemExit(json.dumps(job.get("error")))
    return job, service.get(f"{place}/result").raise_for_status().json()


def save(result: dict[str, Any], folder: str) -> None:
    """Write a result into a folder."""
    Path(folder).mkdir(parents=True, exist_ok=True)
    (Path(folder) / "result.json").write_text(json.dumps(result, indent=1), "utf-8")
