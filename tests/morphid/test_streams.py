"""Outputs that lack a character, or whose reader has left."""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from morphid.streams import SPELT, WORDS

ROOT = Path(__file__).resolve().parents[2]
ENCODINGS = ["latin-1", "ascii", "cp1252", "ascii:strict", "iso8859-7", "utf-8"]
RESULT: dict[str, Any] = {
    "model": {
        "links_per_wing": 1,
        "division": [1.0],
        "aero": {"lift_factor": 1.0},
        "stiffness_nm_rad": [[1.0, 2.0, 3.0]],
        "damping_nms_rad": [],
        "kind": "rigid",
    },
    "fit": [
        {
            "sample": "Fluß φ 飛",
            "role": "held_out",
            "J_rigid": 1.0,
            "J_initial": 1.0,
            "J_identified": 0.1,
            "rms_rad": {"phi": 0.1, "theta": 0.1, "psi": 0.1},
        }
    ],
    "rows": [{"links_per_wing": 1, "parameters": 3, "rms_rad": {}}],
    "recommended": {"reason": "J = 1 rad² ≤ 2 rad²"},
    "trim": {"alpha_rad": 0.1},
    "summary": {"max_abs_rad": {}},
    "cost": {},
}
PROGRAM = """
import json, sys
from morphid.commands.identify import show_model
from morphid.commands.simulate import show_flight
from morphid.commands.study import show_study
from morphid.commands.paper import requirements_table
from morphid.exits import CommandError, Exit
from morphid.screen import meter, print_job_error, print_json, reports_errors, stderr, stdout
from morphid.serve import Announcer
import typer

result = json.loads(sys.stdin.read())
with meter() as bar:
    bar.show({"fraction": 0.5, "phase": "search", "message": "φ ≥ θ"})
for show in (show_model, show_flight, show_study):
    show(result)
figure = {"what": "φ", "at_least": True, "limit": 1, "unit": "°", "value": 1.0, "met": True}
stdout().print(requirements_table({"seed": 1, "total_s": 1.0, "asked": [figure]}))
print_json(result)
Announcer(json_events=False).event("ready", "in /tmp/Fluß/φ")
print_job_error({"detail": "θ is NaN", "code": "x"})

@reports_errors
def command():
    raise CommandError("φ θ ψ ± ² 飛", code=Exit.INVALID_INPUT, hint="≤ π/2")

try:
    command()
except typer.Exit:
    pass
"""


def environment(**more: str) -> dict[str, str]:
    """This process's, without what chooses an encoding."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHONIO", "LC_"))}
    return {**kept, **more}


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_whatever_is_shown_is_shown_in_every_encoding(encoding: str) -> None:
    """Tables, progress, errors, announcements: spelt where the encoding lacks the letter, never refused."""
    ended = subprocess.run(
        [sys.executable, "-c", PROGRAM],
        input=json.dumps(RESULT),
        env=environment(PYTHONIOENCODING=encoding),
        cwd=ROOT,
        capture_output=True,
        encoding="utf-8",
        errors="replace",
        check=False,
    )
    assert ended.returncode == 0, ended.stderr
    assert "Traceback" not in ended.stderr
    if encoding.startswith(("latin", "ascii", "cp")):
        assert "RMS of phi, theta, psi" in ended.stdout
        assert "error: phi theta psi" in ended.stderr


@pytest.mark.parametrize("words", [["--help"], ["identify", "--help"], ["nonsense"], ["jobs", "ls", "--x"]])
@pytest.mark.parametrize("encoding", ["ascii", "cp1252"])
def test_help_and_usage_are_shown_too(words: list[str], encoding: str) -> None:
    """What the command's own library prints."""
    ended = subprocess.run(
        [sys.executable, "-m", "morphid.main", *words],
        env=environment(PYTHONIOENCODING=encoding),
        cwd=ROOT,
        capture_output=True,
        check=False,
    )
    assert ended.returncode in {0, 2}
    assert b"Traceback" not in ended.stderr


def test_the_c_locale(tmp_path: Path) -> None:
    """`LC_ALL=C`: names are in UTF-8 all the same; where Python is forbidden that, a sentence says so."""
    command = [sys.executable, "-m", "morphid.main", "keys"]
    create = ["create", "--owner", "a", "--name", "Flügel φ"]
    data_dir = tmp_path / "Fluß"
    for words in (create, ["ls"]):
        reported = environment(LC_ALL="C")
        line = [*command, *words, "--data-dir", str(data_dir)]
        ended = subprocess.run(line, env=reported, cwd=ROOT, capture_output=True, check=False)
        assert ended.returncode == 0, ended.stderr
    assert (data_dir / "morphid.sqlite3").is_file()
    reported |= {"PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    ended = subprocess.run(line, env=reported, cwd=ROOT, capture_output=True, check=False)
    assert ended.returncode == 2
    assert b"PYTHONUTF8" in ended.stderr
    assert b"Traceback" not in ended.stderr


def test_words_are_ascii() -> None:
    """What stands for a letter can be written everywhere; the rest loses its accent or becomes a mark."""
    assert all(word.isascii() and word for word in WORDS.values())
    out = io.TextIOWrapper(io.BytesIO(), encoding="ascii", errors=SPELT)
    out.write("φé飛\ud800")
    out.flush()
    assert out.buffer.getvalue() == b"phie??"  # type: ignore[attr-defined]


PIPED = """
import json, os, sys
from pathlib import Path
from morphid.exits import Exit
from morphid.main import app
from morphid.commands.identify import show_model
from morphid.running import Answer, hand_over
from morphid import running
from morphid.commands import doctor as command

@app.command("played")
def played(out: Path, plain: bool = False):
    result = json.loads(os.environ["RESULT"])
    for _ in range(2000):
        if plain:
            running.print_json(result)
        else:
            show_model(result)
    hand_over(Answer(Exit.STOPPED, result, {"a.svg": b"x"}), show_model, json_out=out / "r.json", plots=out)

app()
"""


@pytest.mark.parametrize("more", [pytest.param([], marks=pytest.mark.slow), ["--plain"]])
@pytest.mark.parametrize("which", ["stdout", "both"])
def test_a_reader_who_leaves_changes_nothing_else(tmp_path: Path, more: list[str], which: str) -> None:
    """`morphid ... | head`: files are still written, the exit code is the work's, and nobody complains."""
    reading, writing = os.pipe()
    os.close(reading)
    process = subprocess.Popen(
        [sys.executable, "-c", PIPED, "played", str(tmp_path), *more],
        env=environment(RESULT=json.dumps(RESULT)),
        cwd=ROOT,
        stdout=writing,
        stderr=writing if which == "both" else subprocess.PIPE,
        text=True,
    )
    os.close(writing)
    _, reported = process.communicate(timeout=60)
    assert process.returncode == 4, reported
    assert json.loads((tmp_path / "r.json").read_text("utf-8")) == RESULT
    assert (tmp_path / "a.svg").read_bytes() == b"x"
    if which == "stdout":
        assert "Traceback" not in reported
        assert "BrokenPipe" not in reported


@pytest.mark.parametrize("words", [["--help"], ["keys", "scopes", "--json"], ["keys", "scopes"]])
def test_no_reader_at_all(words: list[str]) -> None:
    """The last flush, at the interpreter's end, is quiet as well."""
    reading, writing = os.pipe()
    os.close(reading)
    ended = subprocess.run(
        [sys.executable, "-m", "morphid.main", *words],
        cwd=ROOT,
        stdout=writing,
        stderr=subprocess.PIPE,
        text=True,
        check=False,
    )
    os.close(writing)
    assert ended.stderr == ""
    assert ended.returncode in {0, 1}
