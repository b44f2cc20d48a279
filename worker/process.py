"""Run a worker or the beat: ``python -P -m worker.process worker``, then options of Celery's.

Celery's own command puts the working folder on the import path, where a user may have a package ``app`` or
``worker``. This entry point does not, and ``-P`` keeps Python from doing it.
"""

from __future__ import annotations

import sys
from typing import Final

from app.jobs.queue import QUEUE
from worker.tasks import run_job

COMMANDS: Final = {
    "worker": ("worker", "--queues", QUEUE, "--prefetch-multiplier", "1"),
    # the schedule stays in memory: a kill cannot corrupt anything on disk
    "beat": ("beat", "--scheduler", "celery.beat:Scheduler", "--pidfile", ""),
}


def main(arguments: list[str] | None = None) -> int:
    """Run until SIGTERM and return the exit code.

    The arguments are ``worker`` or ``beat``, followed by Celery options.
    """
    role, *options = sys.argv[1:] if arguments is None else arguments
    if role not in COMMANDS:
        sys.stderr.write(f"unknown role {role!r}: one of {', '.join(COMMANDS)}\n")
        return 2
    # of a task, not of `worker.celery_app`: loaded tasks are not searched for in the working folder
    code: int | None = run_job.app.start(["--quiet", *COMMANDS[role], *options])
    return code or 0


if __name__ == "__main__":
    sys.exit(main())
