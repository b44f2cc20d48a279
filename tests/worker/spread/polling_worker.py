"""A worker process without a broker that polls the job store.

``python -m tests.worker.spread.polling_worker URL NAME CHUNK_LEASE_S`` says ``ready`` when its kernels are.
"""

from __future__ import annotations

import sys
import time

from app.database import Database
from worker import numerics
from worker.attempt import Ending
from worker.runner import Runner

IDLE_S = 0.02


def main(url: str, name: str, chunk_lease_s: float) -> None:
    """Work until killed, on one thread."""
    numerics.prepare_environment(1)
    kernels = numerics.Kernels(numerics.warm_up_library, 1)
    kernels.wait(lambda: False, poll_s=0.01)
    print("ready", flush=True)
    runner = Runner(
        database=Database(url),
        kernels=kernels,
        worker_name=name,
        lease_s=60.0,
        heartbeat_s=10.0,
        chunk_lease_s=chunk_lease_s,
    )
    while True:
        if runner.run_next()[0] is Ending.NOTHING_QUEUED:
            time.sleep(IDLE_S)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], float(sys.argv[3]))
