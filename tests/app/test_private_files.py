"""Files that only their owner reads."""

from __future__ import annotations

import fcntl
import subprocess
import sys
from pathlib import Path

from app.private_files import touch_private

TRY_TO_LOCK = (
    "import fcntl, sys\n"
    "with open(sys.argv[1], 'r+') as file:\n"
    "    try:\n        fcntl.lockf(file, fcntl.LOCK_EX | fcntl.LOCK_NB)\n"
    "    except OSError:\n        sys.exit(7)\n"
)


def test_locks_of_this_process_outlive_a_look_at_the_mode(tmp_path: Path) -> None:
    """A file that is there is not opened and closed: that would drop the locks of SQLite and spoil it."""
    path = tmp_path / "database"
    touch_private(path)
    path.chmod(0o644)
    with path.open("r+") as held:
        fcntl.lockf(held, fcntl.LOCK_EX)
        touch_private(path)
        ended = subprocess.run([sys.executable, "-c", TRY_TO_LOCK, str(path)], check=False)
    assert ended.returncode == 7
    assert path.stat().st_mode & 0o777 == 0o600
