"""``morphid optimize``: in this process, at a played service, and at the live one."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from morphcore import load_trajectory
from morphcore.simulate.schedule import Spline
from morphdata.schedules import load_schedules
from morphid.exits import Exit
from morphid.main import app
from tests.live import LiveService
from tests.morphid.command_lines import PARAMETERS, command, parameters_file
from tests.morphid.played_service import Play, PlayedService

RUNNER = CliRunner()
RESULT: dict[str, Any] = {
    "schedule": {"knot_time_s": [0.0, 0.9, 2.0], "knot_sweep_rad": [0.0, 0.4, 1.0]},
    "limits": {"max_rate_rad_s": 1.0, "max_accel_rad_s2": None},
    "variation": {
        "constant": {"rigid": 9.0, "equivalent": 8.0, "flexible": 8.5},
        "rigid_optimum": {"rigid": 6.0, "equivalent": 6.5, "flexible": 6.6},
        "optimum": {"rigid": 6.1, "equivalent": 5.0, "flexible": None},
    },
    "reached": {"constant": {"max_rate_rad_s": 0.53, "max_accel_rad_s2": 5.3, "max_hinge_torque_nm": 77.0}},
    "reduction_percent": 37.5,
    "reduction_model": "equivalent",
    "morph": {"settle_s": 0.5},
    "pareto": [{"duration_s": 1.25, "variation_rad2": 3.5, "constant_rad2": 4.5}],
    "notes": ["optimum in the flexible model: it diverged"],
    "search": {},
}
LATTICE = {**PARAMETERS["lattice"], "core": {"law": "smoothed"}}  # the identified one, with this core
MORPH = ("--final", "1", "--duration", "2")
QUICK = (
    *("--method", "pso", "--particles", "4", "--generations", "1", "--seed", "2"),
    *("--knots", "4", "--settle", "0.2", "--rate-limit", "1", "--verify", "none"),
)


def test_the_choices_reach_the_service(tmp_path: Path, play: Play) -> None:
    """Morph, limits, weights, search and verification of the command line stand in the request."""
    played = play(PlayedService("optimize", RESULT))
    words = [*MORPH, "--parameters", parameters_file(tmp_path), "--url", "http://there"]
    words += """
        --initial 0.1 --knots 5 --free-values --settle 1 --goal minimum_time --max-variation 4
        --rate-limit 1 --accel-limit 8 --torque-limit 900 --no-monotonic --weights 1,2,0
        --method pso --particles 9 --generations 3 --seed 4 --preset paper
        --verify none --elements 6 --start given --core smoothed
        """.split()  # noqa: SIM905 - as a user writes it
    ended = RUNNER.invoke(app, command("optimize", *words))
    assert ended.exit_code == Exit.OK, ended.output
    assert {
        name: played.body[name] for name in sorted(played.body) if name not in {"aircraft", "flight"}
    } == {
        "flexible": {"elements": 6},
        "limits": {
            "max_rate_rad_s": 1.0,
            "max_accel_rad_s2": 8.0,
            "max_hinge_torque_nm": 900.0,
            "monotonic": False,
        },
        "model": {"parameters": PARAMETERS, "start": "given", "lattice": LATTICE},
        "morph": {
            "initial_rad": 0.1,
            "final_rad": 1.0,
            "duration_s": 2.0,
            "knots": 5,
            "free_values": True,
            "settle_s": 1.0,
            "goal": "minimum_time",
            "max_variation_rad2": 4.0,
        },
        "search": {"method": "pso", "particles": 9, "generations": 3, "seed": 4, "preset": "paper"},
        "verify": "none",
        "weights": {"phi": 1.0, "theta": 2.0, "psi": 0.0},
    }


def test_the_comparison_and_the_knots_are_shown(tmp_path: Path, play: Play) -> None:
    """The tables hold every variation that was flown, what was reached, the front, and the knots."""
    play(PlayedService("optimize", RESULT))
    words = (*MORPH, "--parameters", parameters_file(tmp_path), "--url", "http://there")
    ended = RUNNER.invoke(app, command("optimize", *words))
    rows = [line.split() for line in ended.stdout.splitlines()]
    assert ["constant", "rate", "9", "8", "8.5", "0.53", "5.3", "77"] in rows
    assert ["optimum", "6.1", "5"] in rows
    assert ["1.25", "3.5", "4.5"] in rows
    assert ["0.9000", "0.4000"] in rows
    assert "37.5 % below constant rate (equivalent model)" in ended.stdout
    assert "it diverged" in ended.stdout


def test_the_written_schedule_is_the_spline(tmp_path: Path, play: Play) -> None:
    """``--out`` holds the spline on both sides every 10 ms, and the settling after it."""
    play(PlayedService("optimize", RESULT))
    out = tmp_path / "schedule.csv"
    words = (*MORPH, "--parameters", parameters_file(tmp_path), "--out", out)
    ended = RUNNER.invoke(app, command("optimize", *words, "--url", "http://there"))
    assert ended.exit_code == Exit.OK, ended.output
    written = load_schedules(out).model_dump()
    time_s = np.array(written["sweep_left"]["time_s"])
    np.testing.assert_allclose(time_s, np.linspace(0.0, 2.5, 251), atol=1e-12)
    spline = Spline(np.array([0.0, 0.9, 2.0]), np.array([0.0, 0.4, 1.0])).motion(time_s)
    for side in ("left", "right"):
        np.testing.assert_allclose(written[f"sweep_{side}"]["angle_rad"], spline.angle, rtol=0.0, atol=1e-11)


def test_an_optimum_is_found_and_flown(tmp_path: Path) -> None:
    """In this process a schedule is found within its limit, and `morphid simulate` flies what was written."""
    model, out, best = parameters_file(tmp_path), tmp_path / "schedule.csv", tmp_path / "best.json"
    words = (*MORPH, *QUICK, "--parameters", model)
    ended = RUNNER.invoke(app, command("optimize", *words, "--out", out, "--json", best))
    assert ended.exit_code == Exit.OK, ended.output
    result = json.loads(best.read_text())
    variation = result["variation"]
    assert variation["optimum"]["equivalent"] <= variation["constant"]["equivalent"]
    assert "below constant rate" in ended.stdout
    flown = tmp_path / "flight.csv"
    ended = RUNNER.invoke(
        app, command("simulate", "--schedule", out, "--parameters", model, "--out", flown, "--json", "-")
    )
    assert ended.exit_code == Exit.OK, ended.output
    trajectory = load_trajectory(flown)
    assert trajectory.time_s[-1] == pytest.approx(2.2)
    # one per cent: `simulate` trims with the hinge as it is at the first moment, which a spline accelerates;
    # the search trims before the morph
    again = json.loads(ended.stdout)["summary"]["variation_rad2"]
    assert again == pytest.approx(variation["optimum"]["equivalent"], rel=1e-2)


@pytest.mark.parametrize(
    ("words", "code", "reported"),
    [
        ("", Exit.USAGE, "--parameters"),
        ("--model-id model_1", Exit.USAGE, "--url"),
        ("--parameters nowhere.json", Exit.INVALID_INPUT, "there is no file nowhere.json"),
        ("--parameters M --weights 1,2", Exit.USAGE, "--weights 1,1,1"),
        ("--parameters M --weights 0,0,0", Exit.INVALID_INPUT, "given by --weights 0,0,0"),
        ("--parameters M --rate-limit 0.4", Exit.INVALID_INPUT, "given by --"),
        ("--parameters M --final 3", Exit.INVALID_INPUT, "given by --final 3"),
        ("--parameters M --knots 1", Exit.INVALID_INPUT, "given by --knots 1"),
        ("--parameters M --goal minimum_time", Exit.INVALID_INPUT, "max_variation"),
        ("--parameters M --method magic", Exit.INVALID_INPUT, "given by --method magic"),
        ("--parameters M --out nowhere/s.csv", Exit.ENVIRONMENT, "--out nowhere/s.csv"),
    ],
)
def test_what_is_wrong_is_said_with_its_option(tmp_path: Path, words: str, code: Exit, reported: str) -> None:
    """A mistake in the command line is answered with the option at fault and a way out."""
    chosen = [parameters_file(tmp_path) if word == "M" else word for word in words.split()]
    ended = RUNNER.invoke(app, command("optimize", *MORPH, *chosen))
    assert ended.exit_code == code, ended.output
    assert reported in " ".join(ended.stderr.replace("│", " ").split())


@pytest.mark.timeout(600)
def test_the_service_finds_the_same(live_service: LiveService, tmp_path: Path) -> None:
    """The same command in this process and at the service gives the same schedule: same seed, same answer."""
    found = {}
    words = (*MORPH, *QUICK)
    for name, more in (("here", ()), ("there", ("--url", live_service.url))):
        out = tmp_path / f"{name}.json"
        model = ("--parameters", parameters_file(tmp_path), "--json", out)
        ended = RUNNER.invoke(app, command("optimize", *words, *model, *more))
        assert ended.exit_code == Exit.OK, ended.output
        found[name] = json.loads(out.read_text())
    for part in ("schedule", "variation"):
        assert found["here"][part] == found["there"][part]
