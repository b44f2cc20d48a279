"""``morphid identify`` against a service that a test plays."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
import pytest
from typer.testing import CliRunner

from cli import service
from cli.exits import CommandError, Exit
from cli.files import read_json, save_files
from cli.main import app

RUNNER = CliRunner()
ANGLES = {"phi": 1e-5, "theta": 4e-4, "psi": 2e-5}
RESULT = {
    "model": {
        "links_per_wing": 1,
        "division": [1.0],
        "stiffness_nm_rad": [[1.0e4, 2.0e4, 3.0e4]],
        "damping_nms_rad": [[10.0, 20.0, 30.0]],
        "aero": {},
    },
    "fit": [
        {
            "sample": "a",
            "role": "train",
            "J_rigid": 0.2,
            "J_initial": 0.1,
            "J_identified": 1e-4,
            "rms_rad": ANGLES,
            "max_abs_rad": ANGLES,
        }
    ],
}


class PlayedService:
    """Answers like a service: a job that ends after two looks, in the way that the test wants.

    Parameters
    ----------
    ending : final status.
    """

    def __init__(self, ending: str = "succeeded") -> None:
        self.ending = ending
        self.asked: list[str] = []
        self.body: dict[str, Any] = {}

    def __call__(self, request: httpx.Request) -> httpx.Response:
        """Answer one request."""
        call = f"{request.method} {request.url.path}"
        self.asked.append(call)
        if call == "POST /identify":
            self.body = json.loads(request.content)
        status = "running" if self.asked.count(call) < 2 else self.ending
        answers = {
            "POST /trajectories": httpx.Response(201, json={"id": f"traj_{self.asked.count(call)}"}),
            "POST /identify": httpx.Response(202, json=self.job("queued")),
            "GET /jobs/job_1": httpx.Response(200, json=self.job(status)),
            "GET /jobs/job_1/result": httpx.Response(200, json=RESULT),
            "GET /jobs/job_1/artifacts": httpx.Response(
                200, json={"artifacts": [{"name": "convergence.svg"}]}
            ),
            "GET /jobs/job_1/artifacts/convergence.svg": httpx.Response(200, content=b"<svg/>"),
        }
        return answers.get(call) or httpx.Response(404, json={"title": "There is nothing here"})

    def job(self, status: str) -> dict[str, Any]:
        """Give the job as it is."""
        error = (
            {"code": "diverged", "detail": "it flew apart", "hint": "stiffen it"}
            if status == "failed"
            else None
        )
        return {
            "id": "job_1",
            "status": status,
            "progress": {"fraction": 0.5},
            "partial": False,
            "error": error,
        }


@pytest.fixture
def play(monkeypatch: pytest.MonkeyPatch) -> Callable[[PlayedService], PlayedService]:
    """Put a played service in the place of the network."""

    def install(played: PlayedService) -> PlayedService:
        client = httpx.Client

        def with_transport(**kwargs: Any) -> httpx.Client:
            return client(**{**kwargs, "transport": httpx.MockTransport(played)})

        monkeypatch.setattr(service.httpx, "Client", with_transport)
        monkeypatch.setattr(service.time, "sleep", lambda _seconds: None)
        return played

    return install


def arguments(examples: Path) -> list[str]:
    """Give the command line of a small identification."""
    files = ["--aircraft", examples / "aircraft.json", "--flight", examples / "flight.json"]
    samples = ["--sample", examples / "train_rate_0.5.csv", "--held-out", examples / "train_rate_0.8.csv"]
    return ["identify", *(str(word) for word in [*files, *samples]), "--url", "http://there", "--seed", "3"]


def test_the_choices_reach_the_service(
    examples: Path, tmp_path: Path, play: Callable[[PlayedService], PlayedService]
) -> None:
    """Roles, model and search of the command line stand in the request; result and plots are saved."""
    played = play(PlayedService())
    out, plots = tmp_path / "out.json", tmp_path / "plots"
    ended = RUNNER.invoke(
        app, [*arguments(examples), "--links", "1", "--json", str(out), "--plots", str(plots)]
    )
    assert ended.exit_code == Exit.OK, ended.output
    assert [(sample["name"], sample["role"]) for sample in played.body["samples"]] == [
        ("train_rate_0.5", "train"),
        ("train_rate_0.8", "held_out"),
    ]
    assert played.body["model"] == {"links_per_wing": 1}
    assert played.body["search"] == {"seed": 3}
    assert json.loads(out.read_text()) == RESULT
    assert (plots / "convergence.svg").read_bytes() == b"<svg/>"


def test_json_on_standard_output_is_nothing_but_json(
    examples: Path, play: Callable[[PlayedService], PlayedService]
) -> None:
    """With ``--json -`` standard output can be piped into a program."""
    play(PlayedService())
    ended = RUNNER.invoke(app, [*arguments(examples), "--json", "-"])
    assert json.loads(ended.stdout) == RESULT


@pytest.mark.parametrize(
    ("ending", "code"), [("failed", Exit.FAILED), ("cancelled", Exit.STOPPED), ("expired", Exit.STOPPED)]
)
def test_the_exit_code_tells_the_ending(
    examples: Path, play: Callable[[PlayedService], PlayedService], ending: str, code: Exit
) -> None:
    """A script learns from the exit code how the job ended, a person from the sentence."""
    play(PlayedService(ending))
    ended = RUNNER.invoke(app, arguments(examples))
    assert ended.exit_code == code
    assert ("it flew apart (stiffen it)" in ended.stderr) == (ending == "failed")


def test_a_missing_file_is_named(examples: Path) -> None:
    """A sample that is not there ends the command with its name and exit code 3."""
    command = arguments(examples)
    command[2] = "nowhere.json"
    ended = RUNNER.invoke(app, command)
    assert ended.exit_code == Exit.INVALID_INPUT
    assert "nowhere.json" in ended.stderr


def test_a_broken_json_file_names_the_line(tmp_path: Path) -> None:
    """JSON that does not parse is reported with file and line."""
    (tmp_path / "a.json").write_text('{"span_m": 3,\n oops}')
    with pytest.raises(CommandError, match="line 2") as caught:
        read_json(tmp_path / "a.json")
    assert caught.value.code is Exit.INVALID_INPUT


def test_no_service_is_a_sentence() -> None:
    """When nobody listens, the exit code is 5 and the sentence says how to start a service; also as JSON."""
    ended = RUNNER.invoke(app, ["jobs", "ls", "--url", "http://127.0.0.1:1", "--json"])
    assert ended.exit_code == Exit.UNREACHABLE
    assert "morphid serve" in json.loads(ended.stderr)["hint"]


def test_saved_names_stay_in_the_folder(tmp_path: Path) -> None:
    """A file name from a service cannot climb out of the folder."""
    assert save_files({"../../evil.svg": b"x"}, tmp_path / "plots") == [tmp_path / "plots" / "evil.svg"]


def test_listing_jobs_loads_no_compiler() -> None:
    """The command line starts light: numba, SciPy and matplotlib are not imported for `jobs ls`."""
    import subprocess
    import sys

    program = (
        "import sys\n"
        "from cli.main import app\n"
        "try:\n"
        "    app(['jobs', 'ls', '--url', 'http://127.0.0.1:1'])\n"
        "except SystemExit as end:\n"
        "    loaded = {'numba', 'scipy', 'matplotlib', 'numpy', 'fastapi', 'sqlalchemy'} & set(sys.modules)\n"
        "    sys.exit(f'{end.code} {loaded}' if end.code != 5 or loaded else 0)\n"
    )
    ended = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stderr


def test_a_refused_sample_is_a_sentence(examples: Path, tmp_path: Path) -> None:
    """In this process too, a sample whose time falls is refused with a sentence and exit code 3."""
    rows = (examples / "train_rate_0.8.csv").read_text().splitlines()
    (tmp_path / "falls.csv").write_text("\n".join([*rows[:5], rows[3], *rows[5:]]))
    ended = RUNNER.invoke(
        app,
        [
            *("identify", "--aircraft", str(examples / "aircraft.json")),
            *("--flight", str(examples / "flight.json"), "--sample", str(tmp_path / "falls.csv")),
        ],
    )
    assert ended.exit_code == Exit.INVALID_INPUT
    assert "rise" in ended.stderr


def test_a_refused_flight_names_the_field(examples: Path, tmp_path: Path) -> None:
    """A value that the library refuses is named by its JSON pointer."""
    flight = json.loads((examples / "flight.json").read_text())
    (tmp_path / "flight.json").write_text(json.dumps({**flight, "airspeed_m_s": -1.0}))
    ended = RUNNER.invoke(
        app,
        [
            *("identify", "--aircraft", str(examples / "aircraft.json")),
            *("--flight", str(tmp_path / "flight.json"), "--sample", str(examples / "train_rate_0.8.csv")),
        ],
    )
    assert ended.exit_code == Exit.INVALID_INPUT
    assert "/flight/airspeed_m_s" in ended.stderr
