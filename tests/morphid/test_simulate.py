"""``morphid simulate``: in this process, at a played service, and at the live one."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from morphcore import load_aircraft, load_flight, load_trajectory, simulate
from morphcore.models.parameters_document import parameters_from_document
from morphcore.simulate.schedule import ConstantRate
from morphdata.lattice import Lattice
from morphid.exits import Exit
from morphid.main import app
from tests.live import LiveService
from tests.morphid.command_lines import COARSE, EXAMPLES, PARAMETERS, command, parameters_file, sample
from tests.morphid.played_service import Play, PlayedService

RUNNER = CliRunner()
RESULT: dict[str, Any] = {
    "model": {"kind": "rigid"},
    "trim": {"alpha_rad": 0.07, "tip_z_m": {"left": -0.2, "right": -0.2}},
    "trajectory": {},
    "summary": {"max_abs_rad": {"phi": 0.0, "theta": 0.1, "psi": 0.0}, "variation_rad2": 1.0},
    "cost": {"wall_s": 0.1, "real_time_factor": 20.0},
}


def test_a_flight_is_the_librarys_and_a_sample_again(tmp_path: Path) -> None:
    """The written flight has the samples' columns and is what `simulate` of the library flies."""
    out, result = tmp_path / "flight.csv", tmp_path / "flight.json"
    words = ("--parameters", parameters_file(tmp_path), "--rate", "2", "--final", "0.6", "--duration", "0.5")
    ended = RUNNER.invoke(app, command("simulate", *words, "--out", out, "--json", result))
    assert ended.exit_code == Exit.OK, ended.output
    assert "equivalent model" in ended.stdout
    written = load_trajectory(out)
    headers = [Path(path).read_text().partition("\n")[0] for path in (out, sample("train_rate_0.5"))]
    assert headers[0] == headers[1]
    flown = simulate(
        load_aircraft(EXAMPLES / "aircraft.json"),
        load_flight(EXAMPLES / "flight.json"),
        dict.fromkeys(("left", "right"), ConstantRate(0.0, 0.6, 0.3)),
        model=parameters_from_document(PARAMETERS),
        duration_s=0.5,
        lattice=Lattice(chordwise=1, spanwise=4),  # the one given with the parameters
    ).trajectory
    # nine digits are written
    np.testing.assert_allclose(written.euler, flown.euler, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(written.sweep_left, flown.sweep_left, rtol=0.0, atol=1e-9)
    assert json.loads(result.read_text())["trajectory"]["theta_rad"] == flown.theta.tolist()


def test_a_sample_is_flown_to_its_end(tmp_path: Path) -> None:
    """A sample flight is a schedule; the rigid model follows its sweep from its first row to its last."""
    out = tmp_path / "flight.csv"
    words = ("--schedule", sample("train_asymmetric"), *COARSE, "--out", out, "--plots", tmp_path / "plots")
    ended = RUNNER.invoke(app, command("simulate", *words))
    assert ended.exit_code == Exit.OK, ended.output
    measured, flown = load_trajectory(sample("train_asymmetric")), load_trajectory(out)
    np.testing.assert_allclose(flown.time_s, measured.time_s, atol=1e-9)
    np.testing.assert_allclose(flown.sweep_left, measured.sweep_left, atol=1e-8)
    np.testing.assert_allclose(flown.sweep_right, measured.sweep_right, atol=1e-8)
    assert (tmp_path / "plots" / "flight.svg").is_file()


def test_wings_sweep_and_fold_by_a_table_in_degrees(tmp_path: Path) -> None:
    """The example with two hinges: one column sweeps both wings, two fold them differently."""
    out, folder = tmp_path / "flight.csv", EXAMPLES / "two_hinges"
    words = (
        "--flight",
        EXAMPLES / "flight.json",
        "--schedule",
        folder / "schedule.csv",
        *COARSE,
        "--out",
        out,
    )
    ended = RUNNER.invoke(app, ["simulate", "--aircraft", *map(str, (folder / "aircraft.json", *words))])
    assert ended.exit_code == Exit.OK, ended.output
    flown = load_trajectory(out)
    degrees = {"sweep_left": 20.0, "sweep_right": 20.0, "fold_left": 15.0, "fold_right": 12.0}
    assert {name: float(np.rad2deg(flown.drives[name][-1])) for name in flown.drives} == pytest.approx(
        degrees
    )
    assert np.abs(flown.phi).max() > 1e-4  # unlike folds roll


def test_points_and_shape_are_options(tmp_path: Path) -> None:
    """`--points` reads a list of points, `--shape-times` takes seconds with commas between."""
    points, plots = tmp_path / "points.json", tmp_path / "plots"
    points.write_text('[{"name": "imu", "position_m": [1, 0, 0]}]')
    more = ("--channels", "nz", "--points", points, "--shape-times", "0,0.15", "--plots", plots)
    words = ("--rate", "1", "--final", "0.2", *COARSE, *more, "--json", tmp_path / "out.json")
    ended = RUNNER.invoke(app, command("simulate", *words))
    assert ended.exit_code == Exit.OK, ended.output
    result = json.loads((tmp_path / "out.json").read_text())
    assert list(result["trajectory"])[-2:] == ["nz", "nz_imu"]
    assert result["shape"]["time_s"] == pytest.approx([0.0, 0.15])
    assert (plots / "shape.csv").is_file()
    assert (plots / "shape.npz").is_file()
    ended = RUNNER.invoke(app, command("simulate", "--rate", "1", "--final", "0.2", "--shape-times", "now"))
    assert ended.exit_code == Exit.USAGE
    assert "write --shape-times 1" in ended.output


def test_a_climbing_turn_is_flown_from_its_document(tmp_path: Path) -> None:
    """The example with controls turns at its rate, and shows the bank angle and its drives."""
    out, folder = tmp_path / "turn.csv", EXAMPLES / "controls"
    files = {"--aircraft": "aircraft.json", "--flight": "turn.json", "--schedule": "schedule.csv"}
    words = [word for option, name in files.items() for word in (option, str(folder / name))]
    ended = RUNNER.invoke(app, ["simulate", *words, *map(str, COARSE), "--out", str(out)])
    assert ended.exit_code == Exit.OK, ended.output
    assert "bank angle at the start, rad" in ended.output
    assert "aileron_right in trim, rad" in ended.output
    flown = load_trajectory(out)
    assert flown.psi[5] - flown.psi[0] == pytest.approx(0.2 * (flown.time_s[5] - flown.time_s[0]), rel=1e-3)
    assert np.tan(flown.phi[0]) == pytest.approx(20.0 * 0.2 / 9.80665, rel=0.02)


def test_the_flexible_model_flies_too() -> None:
    """`--model flexible` bends: its tips are up before the morph, those of the rigid one are not."""
    tips = {}
    for model in ("rigid", "flexible"):
        words = ("--model", model, "--rate", "1", "--final", "0.2", "--duration", "0.2", *COARSE)
        more = ("--elements", "2") if model == "flexible" else ()
        ended = RUNNER.invoke(app, command("simulate", *words, *more, "--json", "-"))
        assert ended.exit_code == Exit.OK, ended.output
        tips[model] = json.loads(ended.stdout)["trim"]["tip_z_m"]["left"]
    assert tips["rigid"] == 0.0
    assert tips["flexible"] < -0.1


def test_the_choices_reach_the_service(tmp_path: Path, play: Play) -> None:
    """Model, lattice, start, air and schedules of the command line stand in the request."""
    played = play(PlayedService("simulate", RESULT, files={"flight.csv": b"t\n"}))
    (tmp_path / "air.json").write_text('{"seed": 2}')
    words = ("--model", "flexible", "--elements", "8", "--core", "smoothed", "--start", "given")
    more = ("--rate", "0.5", "--final", "-1", "--environment", tmp_path / "air.json")
    url = ("--url", "http://there", "--out", tmp_path / "flight.csv")
    ended = RUNNER.invoke(app, command("simulate", *words, *more, *url))
    assert ended.exit_code == Exit.OK, ended.output
    lattice = {"core": {"law": "smoothed"}}
    assert played.body["model"] == {"kind": "flexible", "elements": 8, "start": "given", "lattice": lattice}
    assert played.body["schedules"] == {
        "both": {"kind": "constant_rate", "final_rad": -1.0, "rate_rad_s": 0.5}
    }
    assert played.body["duration_s"] == 2.0
    assert played.body["environment"] == {"seed": 2}
    assert (tmp_path / "flight.csv").read_bytes() == b"t\n"


def test_a_model_of_the_service_is_named_by_its_id(play: Play) -> None:
    """With ``--model-id`` the service's own model flies; without a service there is none."""
    words = ("--model-id", "model_1", "--rate", "0.5", "--final", "1")
    ended = RUNNER.invoke(app, command("simulate", *words))
    assert ended.exit_code == Exit.USAGE
    assert "--url" in ended.stderr
    played = play(PlayedService("simulate", RESULT))
    ended = RUNNER.invoke(app, command("simulate", *words, "--url", "http://there"))
    assert ended.exit_code == Exit.OK, ended.output
    assert played.body["model"] == {"kind": "equivalent", "model_id": "model_1"}


@pytest.mark.parametrize(
    ("words", "code", "reported"),
    [
        ("", Exit.USAGE, "--rate and --final"),
        ("--rate 1", Exit.USAGE, "--rate and --final"),
        ("--rate 1 --final 1 --schedule S.csv", Exit.USAGE, "either --schedule"),
        ("--rate -1 --final 1", Exit.INVALID_INPUT, "--rate -1 --final 1"),
        ("--rate 1 --final 3", Exit.INVALID_INPUT, "given by --rate 1 --final 3"),
        ("--rate 1 --final 1 --duration 0", Exit.INVALID_INPUT, "given by --duration 0"),
        ("--rate 1 --final 1 --chordwise 99", Exit.INVALID_INPUT, "given by --chordwise 99"),
        ("--rate 1 --final 1 --elements 4", Exit.INVALID_INPUT, "given by --elements 4"),
        ("--rate 1 --final 1 --model equivalent", Exit.USAGE, "morphid identify --json"),
        ("--rate 1 --final 1 --model bent", Exit.USAGE, "flexible"),
        ("--schedule nowhere.csv", Exit.INVALID_INPUT, "there is no file nowhere.csv"),
        ("--rate 1 --final 1 --out nowhere/f.csv", Exit.ENVIRONMENT, "--out nowhere/f.csv"),
    ],
)
def test_what_is_wrong_is_said_with_its_option(words: str, code: Exit, reported: str) -> None:
    """A mistake in the command line is answered with the option at fault and a way out."""
    ended = RUNNER.invoke(app, command("simulate", *words.split()))
    assert ended.exit_code == code, ended.output
    assert reported in " ".join(ended.stderr.replace("│", " ").split())


def test_what_is_wrong_in_a_file_is_said_with_the_file(tmp_path: Path) -> None:
    """Bad cells, missing models and bad parameters name file and field."""
    schedule, model = tmp_path / "s.csv", tmp_path / "m.json"
    schedule.write_text("t,sweep_left,sweep_right\n0,0,0\n1,oops,0\n2,0,0\n")
    ended = RUNNER.invoke(app, command("simulate", "--schedule", schedule))
    assert ended.exit_code == Exit.INVALID_INPUT
    assert "line 3: sweep_left is 'oops'" in ended.stderr
    flight = ("--rate", "1", "--final", "1", "--parameters", model)
    model.write_text("{}")
    ended = RUNNER.invoke(app, command("simulate", *flight))
    assert ended.exit_code == Exit.INVALID_INPUT
    assert f"--parameters {model}" in ended.stderr
    model.write_text(json.dumps({**PARAMETERS, "division": [0.5, 0.6]}))
    ended = RUNNER.invoke(app, command("simulate", *flight))
    assert ended.exit_code == Exit.INVALID_INPUT
    assert "/model/parameters/division" in ended.stderr
    assert f"given by --parameters {model}" in ended.stderr


@pytest.mark.timeout(600)
def test_the_service_flies_the_same(live_service: LiveService, tmp_path: Path) -> None:
    """A flight at the service is the one flown here, to the last digit written."""
    words = ("--parameters", parameters_file(tmp_path), "--schedule", sample("train_rate_0.8"))
    for name, more in (("here", ()), ("there", ("--url", live_service.url))):
        ended = RUNNER.invoke(app, command("simulate", *words, *more, "--out", tmp_path / f"{name}.csv"))
        assert ended.exit_code == Exit.OK, ended.output
    assert (tmp_path / "here.csv").read_bytes() == (tmp_path / "there.csv").read_bytes()


def test_a_rate_on_an_aircraft_with_several_drives_asks_for_the_drive() -> None:
    """The hint names the option and the drives to choose from, and the command that it gives is accepted."""
    aircraft = EXAMPLES / "two_hinges" / "aircraft.json"
    line = command("simulate", "--rate", "1", "--final", "0.2", "--duration", "0.1")
    line[line.index("--aircraft") + 1] = str(aircraft)
    ended = RUNNER.invoke(app, line)
    assert ended.exit_code == Exit.INVALID_INPUT
    said = " ".join(ended.stderr.split())
    assert "--drive sweep" in said
    assert "fold" in said
