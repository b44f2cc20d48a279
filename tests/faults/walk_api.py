"""The API process with two faults on request: messages sent many times, and death right before sending one.

Environment: ``MORPHID_TEST_DELIVERIES`` sends every message so often; when the file that
``MORPHID_TEST_CRASH_FILE`` names is there, the next accepted job is committed, then the process dies.
"""

from __future__ import annotations

import os
import signal
from pathlib import Path

from app.jobs.queue import Publisher
from app.main import create_app

publish_once = Publisher.publish


def publish(self: Publisher, job_id: str) -> None:
    """Die, or send the message the requested number of times."""
    crash = Path(os.environ.get("MORPHID_TEST_CRASH_FILE", "/nonexistent"))
    if crash.exists():
        crash.write_text(job_id)
        crash.rename(crash.with_suffix(".done"))
        os.kill(os.getpid(), signal.SIGKILL)
    for _ in range(int(os.environ.get("MORPHID_TEST_DELIVERIES", "1"))):
        publish_once(self, job_id)


Publisher.publish = publish  # type: ignore[method-assign]

if __name__ == "__main__":
    from app.http.server import main

    main()

__all__ = ["create_app"]
