"""Identify a model with httpx: post, poll, fetch. Usage: identify_httpx.py [URL] [FOLDER]."""

from __future__ import annotations

import csv
import json
import os
import sys
import time
from pathlib import Path

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


def sample(name: str, role: str) -> dict[str, object]:
    """Read a sample flight as it stands in a request (s, rad)."""
    with (EXAMPLES / f"{name}.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    series = {key: [float(row[column]) for row in rows] for key, column in COLUMNS.items()}
    return {"name": name, "role": role, **series}


def main(url: str = "http://127.0.0.1:8000", folder: str = "client-output") -> int:
    """Post the request, poll the job, save the result."""
    body = {
        "aircraft": json.loads((EXAMPLES / "aircraft.json").read_text()),
        "flight": json.loads((EXAMPLES / "flight.json").read_text()),
        "samples": [sample("train_rate_0.5", "train"), sample("train_rate_0.8", "held_out")],
        "model": {"links_per_wing": 3},
        "search": json.loads(os.environ.get("MORPHID_SEARCH", "{}")),
    }
    with httpx.Client(base_url=url, timeout=30.0) as service:
        answer = service.post("/identify", json=body)
        if answer.is_error:
            print(answer.text)
            return 1
        place = answer.headers["Location"]
        job = answer.json()
        while job["status"] in {"queued", "running", "cancelling"}:
            time.sleep(0.5)
            job = service.get(place).raise_for_status().json()
            print(f"{job['status']:<10} {100 * ((job.get('progress') or {}).get('fraction') or 0.0):5.1f} %")
        if job["status"] != "succeeded":
            print(json.dumps(job.get("error")))
            return 1
        result = service.get(f"{place}/result").raise_for_status().json()
    Path(folder).mkdir(parents=True, exist_ok=True)
    (Path(folder) / "result.json").write_text(json.dumps(result, indent=1))
    for row in result["fit"]:
        print(
            f"{row['sample']:<16} {row['role']:<9} J {row['J_rigid']:.3g} -> {row['J_identified']:.3g} rad^2"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:3]))
