"""Real requests, small enough for a test, and a real worker that runs them."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from fnmatch import fnmatch
from typing import Any

from sqlalchemy import select

from app.database import Database
from app.documents import unpacked
from app.jobs.records import Job
from app.jobs.store import create_job, get_job, request_cancel
from app.tables import artifacts, job_results
from morphdata.operations import operation_named
from tests.identification_request import EXAMPLES, identification
from worker.attempt import Ending
from worker.numerics import Kernels
from worker.operations import Document, find_operation
from worker.runner import Runner, never

OWNER = "local"
MORPH = {"kind": "constant_rate", "final_rad": 0.4, "duration_s": 0.4, "start_s": 0.1}
COARSE = {"chordwise": 1, "spanwise": 4}


def vehicle() -> Document:
    """Give the example aircraft and flight condition."""
    return {name: json.loads((EXAMPLES / f"{name}.json").read_text()) for name in ("aircraft", "flight")}


def simulation(duration_s: float = 0.6, **model: Any) -> Document:
    """Request a short flight on a coarse lattice."""
    return {
        **vehicle(),
        "model": {"kind": "rigid", "lattice": COARSE, **model},
        "schedules": {"both": MORPH},
        "duration_s": duration_s,
    }


def study(*links: int) -> Document:
    """Request a study with searches of a few flights."""
    document = identification("train_rate_0.8", held_out=("train_asymmetric",))
    document["model"] = {"links_per_wing": list(links), "lattice": COARSE}
    document["search"] = {"method": "pso", "particles": 8, "generations": 2, "seed": 1}
    return document


def parameters() -> Document:
    """Give a plausible equivalent model of two links: joints as soft as the wing's outer half bends."""
    return {
        "links_per_wing": 2,
        "separate_wings": False,
        "division": [0.5, 0.5],
        "stiffness_nm_rad": [[35000.0, 45000.0, 315000.0]],
        "damping_nms_rad": [[140.0, 180.0, 1260.0]],
        "aero": {"lift_factor": 1.0, "ac_offset_m": 0.0, "profile_drag": 0.01, "lag_s": 0.004},
    }


def optimisation(**parts: Any) -> Document:
    """Request a small optimisation on a coarse lattice, of a short morph with one knot to place."""
    return {
        **vehicle(),
        "model": {"parameters": parameters(), "lattice": COARSE},
        "morph": {"final_rad": 0.5, "duration_s": 0.8, "knots": 3, "settle_s": 0.2},
        "limits": {"max_rate_rad_s": 1.2},
        "search": {"particles": 4, "generations": 2, "seed": 1},
        "verify": "none",
        **parts,
    }


def undeclared(files: Iterable[str], operation: str) -> list[str]:
    """Names of files that the operation's descriptor does not declare."""
    patterns = operation_named(operation).files
    return [name for name in files if not any(fnmatch(name, pattern) for pattern in patterns)]


@dataclass
class RealWorker:
    """A job store and a worker of this process that runs the library."""

    database: Database

    def add(self, operation: str, request: Document) -> str:
        """Queue a job."""
        with self.database.write() as session:
            return create_job(session, owner=OWNER, operation=operation, request=request).id

    def run(self, shutting_down: Callable[[], bool] = never) -> Ending:
        """Run the next job."""
        runner = Runner(
            database=self.database,
            kernels=Kernels(lambda _threads: None, threads=1),
            worker_name="test",
            lease_s=60.0,
            heartbeat_s=10.0,
            find_operation=find_operation,
            shutting_down=shutting_down,
        )
        return runner.run_next()[0]

    def cancelled_after(self, job_id: str, *, fraction: float) -> tuple[Ending, float]:
        """Run the next job, cancel it when it has come so far; give its end and the seconds that took."""
        endings: list[Ending] = []
        thread = threading.Thread(target=lambda: endings.append(self.run()))
        thread.start()
        while (self.job(job_id).progress or {}).get("fraction", 0.0) < fraction:
            assert thread.is_alive(), self.job(job_id)
            time.sleep(0.02)
        with self.database.write() as session:
            request_cancel(session, OWNER, job_id)
        requested_at = time.monotonic()
        thread.join(30.0)
        return endings[0], time.monotonic() - requested_at

    def job(self, job_id: str) -> Job:
        """Get a job."""
        with self.database.read() as session:
            return get_job(session, OWNER, job_id)

    def result(self, job_id: str) -> Document:
        """Give a job's result."""
        with self.database.read() as session:
            data = session.execute(select(job_results.c.document).where(job_results.c.job_id == job_id))
            document: Document = unpacked(data.scalar_one())
        return document

    def files(self, job_id: str) -> dict[str, bytes]:
        """Give a job's files."""
        with self.database.read() as session:
            rows = session.execute(
                select(artifacts.c.name, artifacts.c.data).where(artifacts.c.job_id == job_id)
            )
            return {row.name: bytes(row.data) for row in rows}
