"""``morphid identify`` against a service that a test plays."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from morphdata.identify import IdentifyRequest
from morphid.commands.fields import field_options
from morphid.exits import Exit
from morphid.main import app
from tests.morphid.played_service import Play, PlayedService

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


def arguments(examples: Path) -> list[str]:
    """Give the command line of a small identification."""
    files = ["--aircraft", examples / "aircraft.json", "--flight", examples / "flight.json"]
    samples = ["--sample", examples / "train_rate_0.5.csv", "--held-out", examples / "train_rate_0.8.csv"]
    return ["identify", *(str(word) for word in [*files, *samples]), "--url", "http://there", "--seed", "3"]


def test_the_choices_reach_the_service(examples: Path, tmp_path: Path, play: Play) -> None:
    """Roles, model and search of the command line stand in the request; result and plots are saved."""
    played = play(PlayedService("identify", RESULT))
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


def test_bounds_are_options_too(examples: Path, play: Play) -> None:
    """What a hint calls ``model.bounds.lag_s`` is ``--bounds lag_s=...``, several at once or repeated."""
    played = play(PlayedService("identify", RESULT))
    bounds = ("--bounds", "lag_s=0.001:0.01", "lift_factor=0.8:1.2", "--bounds", "ac_offset_m=-0.1:0.1")
    ended = RUNNER.invoke(app, [*arguments(examples), *bounds, "--separate-wings"])
    assert ended.exit_code == Exit.OK, ended.output
    assert played.body["model"] == {
        "separate_wings": True,
        "bounds": {"lag_s": [0.001, 0.01], "lift_factor": [0.8, 1.2], "ac_offset_m": [-0.1, 0.1]},
    }


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("4", 4),
        ("auto", "auto"),
        ("wing=4", {"wing": 4}),
        ("right wing=4, tail=1", {"right wing": 4, "tail": 1}),
    ],
)
def test_links_by_surface_are_one_option(text: str, expected: object) -> None:
    """A number, the word, or numbers by name."""
    option = next(each for each in field_options(IdentifyRequest) if each.flag == "--links")
    assert option.read(text) == expected


@pytest.mark.parametrize(
    ("links", "code", "reported"),
    [
        ("wing=", Exit.USAGE, "write --links wing=4,tail=1"),
        ("wing=4,3", Exit.USAGE, "write --links wing=4,tail=1"),
        ("wing=4,fin=1", Exit.INVALID_INPUT, "each flexible surface: wing"),
        ("wing=17", Exit.INVALID_INPUT, "at most 16"),
        ("left wing=4,right wing=3", Exit.INVALID_INPUT, "give it once, for 'wing'"),
    ],
)
def test_links_that_make_no_sense_are_named(examples: Path, links: str, code: Exit, reported: str) -> None:
    """With the names to use, before anything is loaded."""
    words = [word for word in arguments(examples) if word not in ("--url", "http://there")]
    ended = RUNNER.invoke(app, [*words, "--links", links])
    assert ended.exit_code == code, ended.output
    assert reported in " ".join(ended.stderr.replace("│", " ").split())


@pytest.mark.parametrize(
    ("bounds", "code", "reported"),
    [
        ("lag_s", Exit.USAGE, "NAME=LOW:HIGH"),
        ("lag_s=a:b", Exit.USAGE, "NAME=LOW:HIGH"),
        ("lag_s=0:0.1", Exit.INVALID_INPUT, "given by --bounds lag_s=0:0.1"),
        ("division=0.4:0.5", Exit.INVALID_INPUT, "3 x 0.4 = 1.2"),
        ("lift=0.8:1.2", Exit.INVALID_INPUT, "/model/bounds/lift"),
    ],
)
def test_bounds_that_make_no_sense_are_named(examples: Path, bounds: str, code: Exit, reported: str) -> None:
    """A bound that cannot be read, cannot be searched, or leaves no room, before anything is loaded."""
    words = [word for word in arguments(examples) if word not in ("--url", "http://there")]
    ended = RUNNER.invoke(app, [*words, "--bounds", bounds])
    assert ended.exit_code == code, ended.output
    assert reported in " ".join(ended.stderr.replace("│", " ").split())


STATISTICS: dict[str, object] = {
    "theil": 0.0123,
    "theil_bias": 0.25,
    "theil_variance": 0.05,
    "theil_covariance": 0.7,
    "lag_1": 0.91,
    "ljung_box_p": 1e-9,
    "white": False,
    "drive_correlation": -0.62,
}


@pytest.mark.parametrize(("grade", "used"), [("good", True), ("usable", True), ("poor", False)])
def test_the_verdict_is_printed(examples: Path, play: Play, grade: str, used: bool) -> None:  # noqa: FBT001
    """After the tables a word says whether the model may be believed, why, and what to do next."""
    verdict = {"grade": grade, "reasons": ["It is so."], "next_steps": ["Fly once more."]}
    play(PlayedService("identify", {**RESULT, "verdict": verdict}))
    ended = RUNNER.invoke(app, arguments(examples))
    assert ended.exit_code == Exit.OK, ended.output
    after = ended.stdout.partition(f"Verdict: {grade}")[2]
    assert after.index("It is so.") < after.index("Fly once more.")
    assert ("morphid simulate" in after) is used


def test_a_result_of_an_earlier_version_has_no_verdict(examples: Path, play: Play) -> None:
    """Nothing is said where the service has not judged."""
    play(PlayedService("identify", RESULT))
    ended = RUNNER.invoke(app, arguments(examples))
    assert ended.exit_code == Exit.OK, ended.output
    assert "Verdict" not in ended.stdout


def test_statistics_of_residuals_are_printed(examples: Path, play: Play) -> None:
    """Theil's U, its parts in per cent, correlations, whiteness; silent channels have no row."""
    silent = dict.fromkeys(STATISTICS)
    fit = {**RESULT["fit"][0], "statistics": {"theta": STATISTICS, "phi": silent}}  # type: ignore[index]
    play(PlayedService("identify", {**RESULT, "fit": [fit]}))
    ended = RUNNER.invoke(app, arguments(examples))
    (row,) = (line for line in ended.stdout.splitlines() if "0.0123" in line)
    assert row.split()[1:] == ["θ", "0.0123", "25", "5", "70", "0.91", "no", "-0.62"]
    residuals = ended.stdout[ended.stdout.index("Theil") :].partition("Equivalent model")[0]
    assert "φ" not in residuals


def test_json_on_standard_output_is_nothing_but_json(examples: Path, play: Play) -> None:
    """With ``--json -`` standard output can be piped into a program."""
    play(PlayedService("identify", RESULT))
    ended = RUNNER.invoke(app, [*arguments(examples), "--json", "-"])
    assert json.loads(ended.stdout) == RESULT


@pytest.mark.parametrize(
    ("ending", "code"), [("failed", Exit.FAILED), ("cancelled", Exit.STOPPED), ("expired", Exit.STOPPED)]
)
def test_the_exit_code_tells_the_ending(examples: Path, play: Play, ending: str, code: Exit) -> None:
    """A script learns from the exit code how the job ended, a person from the sentence."""
    play(PlayedService("identify", RESULT, ending))
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
    assert "does not increase" in ended.stderr


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
