"""The table of an identified model: every parameter, its interval, what is not seen, what is at a bound."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console
from typer.testing import CliRunner

from morphcore.identify.parameters import search_space
from morphcore.models.equivalent import chain_model, physical_guess
from morphcore.models.parameters_document import parameters_document
from morphid.main import app
from morphid.model_table import model_table, named_parameters, shown_interval
from tests.identify.flights import reference_aircraft, reference_flight
from tests.models.test_every_surface_its_own import chain
from tests.morphid.played_service import Play, PlayedService
from tests.morphid.test_identify import RESULT, arguments

MODEL = {
    "links_per_wing": 2,
    "division": [0.45, 0.55],
    "stiffness_nm_rad": [[41e3, 68e3, 380e3]],
    "damping_nms_rad": [[160.0, 270.0, 1500.0]],
    "aero": {"lift_factor": 1.06, "ac_offset_m": 0.002, "profile_drag": 0.01, "lag_s": 0.004},
}
UNCERTAINTY = {
    "interval_95": {
        "division.1": [0.4, 0.5],
        "stiffness_nm_rad.joint_1.flap": [39e3, None],
        "damping_nms_rad.joint_1.edgewise": [None, None],
        "lag_s": [None, 0.005],
    },
    "cramer_rao_percent": {"division.1": 1.234, "damping_nms_rad.joint_1.edgewise": 4e5, "lag_s": None},
    "undetermined": ["damping_nms_rad.joint_1.edgewise"],
    "at_bound": ["stiffness_nm_rad.joint_1.flap"],
}
WARNING = {
    "code": "at_bound",
    "message": "it ended there",
    "hint": "widen it",
    "pointer": "/model/bounds/lag_s",
}


def shown(result: dict[str, Any], width: int = 80) -> str:
    """The table as text, with the escapes of its colours."""
    console = Console(width=width, force_terminal=True, color_system="standard")
    with console.capture() as capture:
        console.print(model_table(result))
    return capture.get()


@pytest.mark.parametrize("separate", [False, True])
def test_names_are_those_of_the_uncertainty(separate: bool) -> None:  # noqa: FBT001
    """Names and values are the library's, in its order: no interval is shown for another parameter."""
    model = chain_model(reference_aircraft(), reference_flight(), 3)
    space = search_space(model, separate_wings=separate)
    batch = physical_guess(model, separate_wings=separate)
    found = dict(named_parameters(parameters_document(batch)))
    expected = dict(zip(space.parameter_names, space.flatten(batch)[0].tolist(), strict=True))
    assert list(found.items()) == list(expected.items())


def test_surfaces_that_are_not_alike_have_rows_of_their_own() -> None:
    """Wings and a flexible tail: the names of the library's search, mirror images once."""
    model = chain()
    space = search_space(model)
    batch = physical_guess(model)
    found = dict(named_parameters(parameters_document(batch)))
    expected = dict(zip(space.parameter_names, space.flatten(batch)[0].tolist(), strict=True))
    assert found == expected
    assert "right tail.profile_drag" in found


def test_other_links_and_lift_factors_of_a_tail_have_their_rows() -> None:
    """As many joints as each surface has, and the factors by the names of the search."""
    model = chain(links={"wing": 3, "tail": 1})
    space = search_space(model, own_lift=None)
    batch = physical_guess(model, apart=("tail",))
    document = parameters_document(batch)
    expected = dict(zip(space.parameter_names, space.flatten(batch)[0].tolist(), strict=True))
    assert dict(named_parameters(document)) == expected
    assert "tail.lift_factor" in expected
    assert "3 links of wing, 1 of tail" in shown({"model": document})


def test_rows_have_intervals_and_marks() -> None:
    """Each row its own interval, open sides open; grey what is not seen; marked: at a bound, fixed."""
    lines = {
        line.split()[0]: line
        for line in map(plain, shown({"model": MODEL, "uncertainty": UNCERTAINTY}).splitlines())
        if line.split()
    }
    assert "0.4 to 0.5" in lines["division.1"]
    assert "from 3.9e+04" in lines["stiffness_nm_rad.joint_1.flap"]
    assert lines["stiffness_nm_rad.joint_1.flap"].rstrip().endswith("bound")
    assert "up to 0.005" in lines["lag_s"]
    assert "fixed" in lines["profile_drag"]
    assert lines["division.1"].split()[:3] == ["division.1", "0.45", "1.2"]  # the Cramer-Rao bound
    assert ">1e3" in lines["damping_nms_rad.joint_1.edgewise"]
    grey = [
        line for line in shown({"model": MODEL, "uncertainty": UNCERTAINTY}).splitlines() if "unseen" in line
    ]
    assert len(grey) == 1
    assert "\x1b[2m" in grey[0]
    assert "damping_nms_rad.joint_1.edgewise" in grey[0]


def plain(line: str) -> str:
    """A line without its colours."""
    return re.sub(r"\x1b\[[0-9;]*m", "", line)


def test_an_interval_in_words() -> None:
    """Both ends, one, none."""
    assert [shown_interval(ends) for ends in ([1.0, 2.0], [None, 2.0], [1.0, None], [None, None])] == [
        "1 to 2",
        "up to 2",
        "from 1",
        "open",
    ]


def test_the_command_prints_bounds_and_warnings(examples: Path, play: Play) -> None:
    """Parameters at a bound stand in a list; warnings with code, pointer and hint on standard error."""
    result = {**RESULT, "model": MODEL, "uncertainty": UNCERTAINTY, "warnings": [WARNING]}
    play(PlayedService("identify", result))
    ended = CliRunner().invoke(app, arguments(examples))
    assert ended.exit_code == 0
    assert "At a bound of the search: stiffness_nm_rad.joint_1.flap" in ended.stdout
    assert "warning at_bound: /model/bounds/lag_s: it ended there (widen it)" in ended.stderr
    assert "warning" not in ended.stdout


def test_a_result_without_a_model_says_so(examples: Path, play: Play) -> None:
    """A search that was cancelled before anything flew has nothing to show but why."""
    fit = [{**RESULT["fit"][0], "J_identified": None, "rms_rad": dict.fromkeys(("phi", "theta", "psi"))}]  # type: ignore[index,dict-item]
    play(PlayedService("identify", {"model": None, "fit": fit, "warnings": [WARNING]}))
    ended = CliRunner().invoke(app, arguments(examples))
    assert ended.exit_code == 0
    assert "No model" in ended.stdout
