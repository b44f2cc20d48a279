"""The whole way: start the service, post the example flights, watch the job, save and show what comes out.

Run by ``make demo``. Everything it writes is in ``demo-output/``.
"""

from __future__ import annotations

import csv
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from cli.broker import free_port
from cli.exits import CommandError
from cli.screen import fit_table, meter, model_table, stdout
from cli.service import Service

EXAMPLES = Path(__file__).resolve().parent
OUTPUT = EXAMPLES.parent / "demo-output"
SAMPLES = ("train_rate_0.2", "train_rate_0.5", "train_rate_0.8")
ANGLES = ("phi", "theta", "psi")


def sample(name: str) -> dict[str, Any]:
    """Read a sample flight as it stands in a request (s, rad)."""
    with (EXAMPLES / f"{name}.csv").open(newline="", encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    columns = {"time_s": "t", "sweep_left_rad": "sweep_left", "sweep_right_rad": "sweep_right"}
    columns |= {f"{angle}_rad": angle for angle in ANGLES}
    series = {key: [float(row[column]) for row in rows] for key, column in columns.items()}
    return {"name": name, "role": "train", **series}


def request() -> dict[str, Any]:
    """Ask for an equivalent model with three links per wing that repeats the three example flights."""
    return {
        "aircraft": json.loads((EXAMPLES / "aircraft.json").read_text("utf-8")),
        "flight": json.loads((EXAMPLES / "flight.json").read_text("utf-8")),
        "samples": [sample(name) for name in SAMPLES],
        "model": {"links_per_wing": 3},
        "search": {"seed": 1},
    }


@contextmanager
def service() -> Iterator[str]:
    """Run ``morphid serve`` on a free port while the block runs; give its address."""
    command = [sys.executable, "-m", "cli.main", "serve", "--json", "--port", str(free_port(8000))]
    process = subprocess.Popen(
        [*command, "--data-dir", str(OUTPUT / "service")],
        env={**os.environ, "MORPHID_WEBHOOK_DIAL_ONLY": "127.0.0.1"},  # a demonstration calls nobody
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        assert process.stdout is not None  # noqa: S101 - for the type checker
        for line in process.stdout:
            event = json.loads(line)
            if event["event"] == "ready":
                yield event["url"]
                break
        else:
            raise SystemExit("the service did not start; it said above why")
    finally:
        process.send_signal(signal.SIGINT)
        process.communicate()


def main() -> int:
    """Run the demonstration; 0 when a model was identified."""
    begun = time.monotonic()
    shutil.rmtree(OUTPUT, ignore_errors=True)
    console = stdout()
    with service() as url, Service(url) as client:
        console.print(f"The service runs at {url} ({time.monotonic() - begun:.1f} s).")
        job = client.submit("identify", request())
        console.print(f"POST /identify -> 202, job {job['id']}: {', '.join(SAMPLES)}, three links per wing")
        with meter() as bar:
            for seen in client.watch(job["id"]):
                bar.show(seen.get("progress"), seen["status"])
                job = seen
        if job["status"] != "succeeded":
            console.print(
                f"The job {job['status']}: {json.dumps(job.get('error'))}", style="red", markup=False
            )
            return 1
        result, files = client.result(job["id"]), client.artifacts(job["id"])
    console.print(fit_table(result))
    console.print(model_table(result))
    for name, content in files.items():
        (OUTPUT / name).write_bytes(content)
    search = result["search"]
    console.print(
        f"{search['flights']:,} flights in {search['wall_s']:.1f} s; "
        f"{time.monotonic() - begun:.0f} s from start to plots. Saved:"
    )
    for name in sorted(files):
        console.print(f"  {(OUTPUT / name).relative_to(EXAMPLES.parent)}", markup=False)
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except CommandError as error:
        sys.exit(f"{error.message}\n{error.hint}")
