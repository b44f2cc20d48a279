"""The command as a whole."""

from __future__ import annotations

import json
import subprocess
import sys

from typer.testing import CliRunner

from morphid.exits import Exit
from morphid.main import app

RUNNER = CliRunner()


def test_no_service_is_a_sentence() -> None:
    """When nobody listens, the exit code is 5 and the sentence says how to start a service; also as JSON."""
    ended = RUNNER.invoke(app, ["jobs", "ls", "--url", "http://127.0.0.1:1", "--json"])
    assert ended.exit_code == Exit.UNREACHABLE
    assert "morphid serve" in json.loads(ended.stderr)["hint"]


def test_listing_jobs_loads_no_compiler() -> None:
    """The command line starts light: numba, SciPy and matplotlib are not imported for `jobs ls`."""
    program = (
        "import sys\n"
        "from morphid.main import app\n"
        "try:\n"
        "    app(['jobs', 'ls', '--url', 'http://127.0.0.1:1'])\n"
        "except SystemExit as end:\n"
        "    loaded = {'numba', 'scipy', 'matplotlib', 'numpy', 'fastapi', 'sqlalchemy'} & set(sys.modules)\n"
        "    sys.exit(f'{end.code} {loaded}' if end.code != 5 or loaded else 0)\n"
    )
    ended = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stderr


def test_a_missing_package_is_a_sentence() -> None:
    """A command whose package is not installed names it and says what to install."""
    program = (
        "import sys; sys.modules['sqlalchemy'] = None; from morphid.main import app; app(['db', 'upgrade'])"
    )
    ended = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert ended.returncode == Exit.ENVIRONMENT
    assert "needs the package sqlalchemy" in ended.stderr
    assert "pip install 'morphid[server]'" in ended.stderr
