"""The whole workflow: start the service, post the example flights, watch the job, show and save the result.

One flight is held out: the model is judged by how well it predicts that one. Run by ``make demo``.
Everything it writes is in ``demo-output/``.
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

from rich.console import Console

from morphid.broker import free_port
from morphid.commands.identify import show_fit, show_verdict
from morphid.exits import CommandError
from morphid.screen import meter, print_job_error, stdout
from morphid.service import Service

EXAMPLES = Path(__file__).resolve().parent
OUTPUT = EXAMPLES.parent / "demo-output"
SAMPLES = {"train_rate_0.2": "train", "train_rate_0.5": "held_out", "train_rate_0.8": "train"}
ANGLES = ("phi", "theta", "psi")


def sample(name: str, role: str) -> dict[str, Any]:
    """Read a sample flight as it stands in a request (s, rad)."""
    with (EXAMPLES / f"{name}.csv").open(newline="", encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    columns = {"time_s": "t", "sweep_left_rad": "sweep_left", "sweep_right_rad": "sweep_right"}
    columns |= {f"{angle}_rad": angle for angle in ANGLES}
    series = {key: [float(row[column]) for row in rows] for key, column in columns.items()}
    return {"name": name, "role": role, **series}


def request() -> dict[str, Any]:
    """Request an equivalent model with three links per wing, fitted to two flights and tested on a third."""
    return {
        "aircraft": json.loads((EXAMPLES / "aircraft.json").read_text("utf-8")),
        "flight": json.loads((EXAMPLES / "flight.json").read_text("utf-8")),
        "samples": [sample(name, role) for name, role in SAMPLES.items()],
        "model": {"links_per_wing": 3},
        "search": {"seed": 1},
    }


@contextmanager
def service() -> Iterator[str]:
    """Run ``morphid serve`` on a free port while the block runs; yield its address."""
    command = [sys.executable, "-m", "morphid.main", "serve", "--json", "--port", str(free_port(8000))]
    process = subprocess.Popen(
        [*command, "--data-dir", str(OUTPUT / "service")],
        env={
            **os.environ,
            "MORPHID_WEBHOOK_DIAL_ONLY": "127.0.0.1",
        },  # a demonstration contacts no other hosts
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
            raise SystemExit("the service did not start; see its messages above")
    finally:
        process.send_signal(signal.SIGINT)
        process.communicate()


def judge(console: Console, result: dict[str, Any]) -> None:
    """Print warnings, verdict and the suggested next step."""
    for warning in result.get("warnings") or ():
        console.print(f"Warning: {warning['message']}; {warning['hint']}.", style="yellow", markup=False)
    use = (
        "Find a smooth morph with the model: .venv/bin/morphid optimize --aircraft examples/aircraft.json "
        f"--flight examples/flight.json --parameters {shown(OUTPUT / 'result.json')} "
        "--final 1.0 --duration 2.0"
    )
    show_verdict(result, use)


def shown(path: Path) -> str:
    """Return a path relative to where ``make demo`` runs."""
    return str(path.relative_to(EXAMPLES.parent))


def main() -> int:
    """Run the demonstration; 0 when a model was identified."""
    begun = time.monotonic()
    shutil.rmtree(OUTPUT, ignore_errors=True)
    console = stdout()
    with service() as url, Service(url) as client:
        console.print(f"The service runs at {url} ({time.monotonic() - begun:.1f} s).")
        job = client.submit("identify", request())
        flights = ", ".join(
            name + (" (held out)" if role == "held_out" else "") for name, role in SAMPLES.items()
        )
        console.print(
            f"POST /identify -> 202, job {job['id']}: {flights}, three links per wing", soft_wrap=True
        )
        with meter() as bar:
            for seen in client.watch(job["id"]):
                bar.show(seen.get("progress"), seen["status"])
                job = seen
        if job["status"] != "succeeded":
            console.print(f"The job {job['status']}.", style="red")
            print_job_error(job.get("error") or {})
            return 1
        result, files = client.result(job["id"]), client.artifacts(job["id"])
    for name, content in files.items():
        (OUTPUT / name).write_bytes(content)
    show_fit(result)
    judge(console, result)
    search = result["search"]
    console.print(
        f"{search['flights']:,} flights in {search['wall_s']:.1f} s; "
        f"{time.monotonic() - begun:.0f} s from start to end. "
        f"Saved: {len(files)} files (plots, curves, result.json) in {shown(OUTPUT)}/",
        soft_wrap=True,
    )
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except CommandError as error:
        sys.exit(f"{error.message}\n{error.hint}")
