"""``morphid export``: the file of a model, in this process, with what is known of its fit."""

from __future__ import annotations

import io
import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from morphdata.export import ModelFile
from morphid.exits import Exit
from morphid.main import app
from tests.morphid.command_lines import PARAMETERS, command, parameters_file

RUNNER = CliRunner()
FIT = [{"sample": "rate_0.5", "role": "train", "J_identified": 1e-4}]


def test_the_file_is_the_model_with_its_fit(tmp_path: Path) -> None:
    """Of a whole result the fit is in the file, and the file is taken where the result is."""
    given, out, again = (tmp_path / name for name in ("identified.json", "model.json", "model.npz"))
    given.write_text(json.dumps({"model": PARAMETERS, "fit": FIT}))
    first = command("export", "--parameters", given, "--format", "json", "--out", out)
    ended = RUNNER.invoke(app, first)
    assert ended.exit_code == Exit.OK, ended.output
    saved = ModelFile.load(out)
    assert saved.origin.fit == FIT
    assert saved.model.model_dump()["stiffness_nm_rad"] == PARAMETERS["stiffness_nm_rad"]
    ended = RUNNER.invoke(app, command("export", "--parameters", out, "--format", "npz", "--out", again))
    assert ended.exit_code == Exit.OK, ended.output
    with np.load(io.BytesIO(again.read_bytes())) as found:
        assert json.loads(str(found["origin.fit"])) == FIT
        assert found["joints.stiffness_nm_rad"].tolist() == PARAMETERS["stiffness_nm_rad"] * 2


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (("--format", "npz"), Exit.USAGE, "--out FILE"),
        (("--format", "zip", "--out", "model.zip"), Exit.INVALID_INPUT, "'npz', 'mat' or 'json'"),
    ],
)
def test_what_is_missing_or_unknown_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...], code: Exit, said: str
) -> None:
    """Without a place nothing is computed; an unknown format is refused with those there are."""
    given = parameters_file(tmp_path)
    monkeypatch.chdir(tmp_path)
    ended = RUNNER.invoke(app, command("export", "--parameters", given, *words), env={"COLUMNS": "200"})
    assert ended.exit_code == code, ended.output
    assert said in ended.output
    assert [path.name for path in tmp_path.iterdir()] == ["identified.json"]
