"""Identify a model with a client generated from the service's OpenAPI document (made on first use).

Usage: generated_client.py [URL] [FOLDER]. The package itself is not committed; see generate_client.sh.
"""

from __future__ import annotations

import csv
import json
import os
import subprocess
import sys
from pathlib import Path
from urllib.parse import urlsplit

HERE = Path(__file__).resolve().parent
EXAMPLES = HERE.parent
COLUMNS = {
    "time_s": "t",
    "sweep_left_rad": "sweep_left",
    "sweep_right_rad": "sweep_right",
    "phi_rad": "phi",
    "theta_rad": "theta",
    "psi_rad": "psi",
}


def generate(url: str) -> None:
    """Generate the client unless it is there, and make it importable."""
    if not (HERE / "generated" / "morphid_client" / "client.py").exists():
        beside_python = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
        subprocess.run(
            [str(HERE / "generate_client.sh"), url], check=True, env={**os.environ, "PATH": beside_python}
        )
    sys.path.insert(0, str(HERE / "generated"))


def sample(name: str) -> dict[str, object]:
    """Read a sample flight as it stands in a request (s, rad)."""
    with (EXAMPLES / f"{name}.csv").open(newline="", encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    series = {key: [float(row[column]) for row in rows] for key, column in COLUMNS.items()}
    return {"name": name, "role": "train", **series}


def main(url: str = "http://127.0.0.1:8000", folder: str = "client-output") -> int:
    """Post the request with typed calls, wait for the end, save the result."""
    generate(url)
    from morphid_client import Client
    from morphid_client.api.identify import identify
    from morphid_client.api.jobs import get_job, get_job_result
    from morphid_client.models import IdentifyRequest, IdentifyResult, Job, JobStatus

    request = IdentifyRequest.from_dict(
        {
            "aircraft": json.loads((EXAMPLES / "aircraft.json").read_text("utf-8")),
            "flight": json.loads((EXAMPLES / "flight.json").read_text("utf-8")),
            "samples": [sample("train_rate_0.8")],
            "model": {"links_per_wing": 3},
            "search": json.loads(os.environ.get("MORPHID_SEARCH", "{}")),
        }
    )
    key = os.environ.get("MORPHID_API_KEY")
    headers = {"Authorization": f"Bearer {key}"} if key else {}
    # a service on this machine is never reached through a proxy, whatever http_proxy and ALL_PROXY say
    here = urlsplit(url).hostname in {"127.0.0.1", "localhost", "::1"}
    options = {"trust_env": not here}
    with Client(base_url=url, timeout=60.0, headers=headers, httpx_args=options) as service:
        job = identify.sync(client=service, body=request)
        while isinstance(job, Job) and job.status in {
            JobStatus.QUEUED,
            JobStatus.RUNNING,
            JobStatus.CANCELLING,
        }:
            job = get_job.sync(job.id, client=service, prefer="wait=20")  # answers early when the job ends
        if not isinstance(job, Job) or job.status is not JobStatus.SUCCEEDED:
            print(json.dumps(job.to_dict() if job is not None else None, indent=1))
            return 1
        result = get_job_result.sync(job.id, client=service)
    if not isinstance(result, IdentifyResult):
        print("the service gave no result")
        return 1
    Path(folder).mkdir(parents=True, exist_ok=True)
    (Path(folder) / "result.json").write_text(json.dumps(result.to_dict(), indent=1), "utf-8")
    for row in result.fit:
        print(f"{row.sample:<16} J {row.j_rigid:.3g} -> {row.j_identified:.3g} rad^2")
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:3]))
