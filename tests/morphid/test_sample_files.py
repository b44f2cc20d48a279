"""Sample files of the command line: in every format, and what its options declare about them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io
from scipy.spatial.transform import Rotation
from typer.testing import CliRunner

from morphcore import load_trajectory
from morphdata.faults import InvalidInput
from morphid.exits import CommandError, Exit
from morphid.main import app
from morphid.running import sample_document
from morphid.service import Service


def test_every_format_makes_the_same_request(examples: Path, tmp_path: Path) -> None:
    """A flight as CSV, JSON, Parquet and MATLAB file becomes the same sample of a request."""
    source = examples / "train_rate_0.8.csv"
    flown = load_trajectory(source)
    columns = {
        "t": flown.time_s,
        **{name: getattr(flown, name) for name in ("sweep_left", "sweep_right", "phi", "theta", "psi")},
        **flown.channels,
    }
    places = {ending: tmp_path / f"train_rate_0.8.{ending}" for ending in ("json", "parquet", "mat")}
    places["json"].write_text(json.dumps({name: column.tolist() for name, column in columns.items()}))
    pq.write_table(pa.table(columns), places["parquet"])
    scipy.io.savemat(places["mat"], {"flight": columns}, do_compression=True)
    expected = sample_document(source, "train")
    for path in places.values():
        assert sample_document(path, "train") == expected


@pytest.mark.parametrize("ending", ["csv", "json", "parquet", "mat"])
def test_a_broken_file_is_reported_in_a_sentence(tmp_path: Path, ending: str) -> None:
    """The file is named, the exit code says invalid input, and there is a way out."""
    path = tmp_path / f"x.{ending}"
    path.write_bytes(np.random.default_rng(1).bytes(1000))
    with pytest.raises(CommandError, match=path.name) as caught:
        sample_document(path, "train")
    assert caught.value.code is Exit.INVALID_INPUT
    assert caught.value.hint


def sample_of_command(
    words: list[str], examples: Path, monkeypatch: pytest.MonkeyPatch
) -> tuple[int, str, dict[str, Any]]:
    """Exit code and errors of ``identify`` with these words, and the sample that it hands to the work."""
    taken: list[dict[str, Any]] = []

    def begin(request: dict[str, Any], _threads: int) -> None:
        taken.append(request)
        raise InvalidInput("that will do", hint="nothing")

    monkeypatch.setattr("worker.operations.find_operation", lambda _name: begin)
    vehicle = [f"--{name}={examples / name}.json" for name in ("aircraft", "flight")]
    ended = CliRunner().invoke(app, ["identify", *vehicle, *words])
    return ended.exit_code, ended.stderr, taken[0]["samples"][0] if taken else {}


def test_options_declare_what_is_in_the_files(
    examples: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Axes, a numbered quaternion, a scaled column and a window of time reach the request."""
    flown = load_trajectory(examples / "train_rate_0.8.csv")
    body_to_ned = Rotation.from_euler("ZYX", flown.euler[:, ::-1]).as_matrix()
    ned_of_enu, frd_of_flu = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1]]), np.diag([1, -1, -1])
    quaternion = Rotation.from_matrix(ned_of_enu.T @ body_to_ned @ frd_of_flu).as_quat()
    columns = {
        "t": flown.time_s,
        **{f"q{number}": quaternion[:, number] for number in range(4)},
        "servo": (np.rad2deg(flown.sweep_left) + 135.0) / 0.09,
        "q": -flown.channels["q"],
    }
    pq.write_table(pa.table(columns), tmp_path / "a.parquet")
    words = [f"--sample={tmp_path}/a.parquet", "--earth", "enu", "--body", "flu", "--quaternion", "xyzw"]
    words += ["--column", "sweep_deg=servo*0.09-135", "--between", "0.5:1.0"]
    _, said, sample = sample_of_command(words, examples, monkeypatch)
    assert "that will do" in said
    kept = (flown.time_s >= 0.5) & (flown.time_s <= 1.0)
    for name, values in {"phi_rad": flown.phi, "theta_rad": flown.theta, "sweep_rad": flown.sweep_left,
                         "q_rad_s": flown.channels["q"], "time_s": flown.time_s}.items():  # fmt: skip
        np.testing.assert_allclose(sample[name], values[kept], atol=1e-12)


@pytest.mark.parametrize(
    ("words", "option"),
    [
        (["--earth", "up"], "--earth"),
        (["--body", "up"], "--body"),
        (["--quaternion", "abcd"], "--quaternion"),
        (["--column", "sweep"], "--column"),
        (["--column", "sweep=a", "--column", "sweep=b"], "--column"),
        (["--column", "2nd=a"], "--column"),
        (["--between", "3"], "--between"),
        (["--between", "3:1"], "--between"),
    ],
)
def test_odd_declarations_name_the_option(
    examples: Path, monkeypatch: pytest.MonkeyPatch, words: list[str], option: str
) -> None:
    """Before any file is read."""
    sample = f"--sample={examples}/train_rate_0.8.csv"
    code, said, request = sample_of_command([sample, *words], examples, monkeypatch)
    assert code == Exit.INVALID_INPUT
    assert option in said
    assert not request


def test_a_service_receives_what_is_declared(examples: Path) -> None:
    """As parts of the form with the file."""
    seen: list[bytes] = []

    def answer(request: httpx.Request) -> httpx.Response:
        seen.append(request.read())
        return httpx.Response(201, json={"id": "traj_1"})

    with Service("http://127.0.0.1:1", transport=httpx.MockTransport(answer)) as service:
        said = {"earth": "ENU", "columns": {"sweep": "servo*2"}, "between": [1.0, 2.0]}
        service.upload(examples / "train_rate_0.8.csv", said)
    for part in (b'name="earth"', b"ENU", b'{"sweep": "servo*2"}', b"[1.0, 2.0]"):
        assert part in seen[0]
