"""Identification of wings and a tail with different numbers of links and lift factors of their own."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from morphcore.errors import InvalidInput
from morphcore.identify import AutoIdentification, Identification, IdentifyResult, SearchSettings
from morphcore.identify.cost import fly_attitudes, sample_cases, shared_trims
from morphcore.identify.parameters import search_space
from morphcore.identify.study import Study
from morphcore.models.equivalent import ChainModel, ParameterBatch, chain_model, physical_guess
from morphcore.models.parameters_document import parameters_from_document
from morphcore.simulate.schedule import ConstantRate
from morphcore.simulate.trajectory import Trajectory
from morphdata.identify import EquivalentModel
from tests.models.test_every_surface_its_own import LATTICE, NAMES, ORDERS, aircraft, flight

LINKS = {"wing": 3, "tail": 2}
LIFT = {"lift_factor": 1.1, "tail.lift_factor": 0.85}
NOISE_RAD = 1e-5
ERRORS = 2.0  # standard errors
FIT_ROUND_OFF = 1e-3  # of a standard error: a descent amplifies round-off by what the flights do not see


def chain(names: tuple[str, ...] = NAMES, links: Any = LINKS) -> ChainModel:
    """Wings and a flexible tail."""
    return chain_model(aircraft(names), flight(), links, LATTICE)


def truth(model: ChainModel) -> ParameterBatch:
    """Softer than the beams, damped more, and with the lift factors to find."""
    guess = physical_guess(model, apart=("tail",))
    return guess.changed(
        stiffness_nm_rad=0.8 * guess["stiffness_nm_rad"],
        damping_nms_rad=1.5 * guess["damping_nms_rad"],
        lift_factor=np.array([[*LIFT.values()]]),
    )


@cache
def samples() -> tuple[Trajectory, ...]:
    """Three asymmetric flights of the truth, as an attitude sensor sees them."""
    model, rng = chain(), np.random.default_rng(7)
    return tuple(
        _sample(model, name, left, right, rng)
        for name, left, right in (("a", 0.2, 0.3), ("b", 0.4, 0.4), ("c", 0.5, 0.1))
    )


def _sample(model: ChainModel, name: str, left: float, right: float, rng: np.random.Generator) -> Trajectory:
    time_s = np.linspace(0.0, 0.8, 81)
    rest = np.zeros_like(time_s)
    moved = [ConstantRate(0.0, final, 0.4).motion(time_s).angle for final in (left, right)]
    blank = Trajectory(
        name, time_s, dict(zip(("sweep_left", "sweep_right"), moved, strict=True)), *[rest] * 3
    )
    ((case, found),) = shared_trims(model, truth(model), sample_cases(model, [blank]), "trim")
    euler = fly_attitudes(model, truth(model), case, found)[0] + NOISE_RAD * rng.standard_normal((81, 3))
    return replace(blank, phi=euler[:, 0], theta=euler[:, 1], psi=euler[:, 2])


def identification(names: tuple[str, ...] = NAMES, **options: Any) -> Identification:
    """A descent from the physical guess."""
    settings = {"links_per_wing": LINKS, "own_lift": ["tail"], **options}
    return Identification(
        aircraft(names), flight(), samples(),
        EquivalentModel(lattice=LATTICE, step_s=0.01, **settings),
        SearchSettings(method="least_squares", iterations=12),
    )  # fmt: skip


@cache
def identified(names: tuple[str, ...] = NAMES) -> IdentifyResult:
    """Its end."""
    run, checkpoint = identification(names), b""
    for step in run.steps():
        checkpoint = step.checkpoint
    return run.result(checkpoint)


def test_lift_factors_of_wing_and_tail_are_recovered() -> None:
    """Each within two of its standard errors, which tell them apart; the flights to their noise."""
    found = identified().to_document()
    value, error = found["uncertainty"]["value"], found["uncertainty"]["standard_error"]
    for name, true in LIFT.items():
        assert abs(value[name] - true) <= ERRORS * error[name], name
        assert error[name] < 0.05
    assert found["model"]["aero"]["lift_factors"] == {"tail": value["tail.lift_factor"]}
    for fit in found["fit"]:
        assert max(fit["rms_rad"].values()) < 1.2 * NOISE_RAD


def test_other_numbers_of_links_are_recovered() -> None:
    """What the flights determine of the wings of three links and the tail of two is within its errors."""
    found = identified().to_document()
    uncertainty = found["uncertainty"]
    assert found["model"]["links_per_wing"] == LINKS
    true = identification().space.flatten(truth(chain()))[0]
    known = 0
    for name, own in zip(identification().space.parameter_names, true, strict=True):
        error = uncertainty["standard_error"][name]
        if error and name not in uncertainty["undetermined"] and error < 0.2 * abs(own):
            assert abs(uncertainty["value"][name] - own) <= 3.0 * error, name
            known += "stiffness" in name
    assert known >= 4  # flap and torsion of the wings at least
    names = set(uncertainty["value"])
    assert {"right wing.stiffness_nm_rad.joint_2.flap", "right tail.stiffness_nm_rad.joint_1.flap"} <= names
    assert "right tail.stiffness_nm_rad.joint_2.flap" not in names


def test_the_order_of_surfaces_changes_nothing() -> None:
    """Names and values of all parameters."""
    first, second = (identified(names).to_document()["uncertainty"] for names in (NAMES, ORDERS[2]))
    assert first["value"].keys() == second["value"].keys()
    for name, value in first["value"].items():
        error = first["standard_error"][name] or 0.0
        assert abs(second["value"][name] - value) <= max(FIT_ROUND_OFF * error, 1e-7), name


def test_an_identified_model_is_the_beginning_of_another() -> None:
    """Its document, read back, encodes to the point that it was, and the shared factor to one for all."""
    run, found = identification(), identified()
    again = parameters_from_document(json.loads(json.dumps(found.to_document()["model"])))
    point = run.space.encode(again)
    np.testing.assert_allclose(run.space.flatten(run.space.decode(point))[0], run.space.flatten(again)[0])
    shared = physical_guess(chain()).changed(lift_factor=np.array([1.05]))
    both = run.space.flatten(run.space.decode(run.space.encode(shared)))[0]
    assert [both[run.space.parameter_names.index(name)] for name in LIFT] == pytest.approx([1.05, 1.05])
    with pytest.raises(InvalidInput, match="3 links of wing, 2 of tail") as caught:
        identification(links_per_wing={"wing": 2, "tail": 2}).space.encode(again)
    assert caught.value.pointer == "/search/warm_start"


@pytest.mark.parametrize(
    ("asked", "names"),
    [
        (["tail"], ["lift_factor", "tail.lift_factor"]),
        (["left tail"], ["lift_factor", "tail.lift_factor"]),
        (["wing"], ["lift_factor", "wing.lift_factor"]),
        (["wing", "tail"], ["lift_factor", "tail.lift_factor"]),
        ([], ["lift_factor"]),
    ],
)
def test_who_has_a_factor_of_its_own(asked: list[str], names: list[str]) -> None:
    """The named; where all are, the largest surface has the one without a name."""
    space = search_space(chain(), own_lift=asked)
    assert [name for name in space.names if "lift" in name] == names
    fixed = search_space(chain(), own_lift=asked, aero_coefficients=["lag_s"])
    assert not [name for name in fixed.names if "lift" in name]


def test_a_factor_for_an_unknown_surface_is_refused() -> None:
    """With the names to use."""
    with pytest.raises(InvalidInput) as caught:
        search_space(chain(), own_lift=["fin"])
    assert "wing, tail" in caught.value.hint


def test_the_links_of_one_surface_are_chosen() -> None:
    """`auto` for the wings, the tail as it is said to be."""
    model = EquivalentModel(links_per_wing={"wing": "auto", "tail": 1}, lattice=LATTICE)
    run = AutoIdentification(aircraft(), flight(), samples(), model)
    assert [each.model.links_per_wing for each in run.runs.values()][:3] == [
        1,
        {"wing": 2, "tail": 1},
        {"wing": 3, "tail": 1},
    ]


def test_a_study_compares_models_by_surface() -> None:
    """A row of each, by the mean of its numbers, and a reason in words."""
    run = Study(
        aircraft(), flight(), samples(),
        links=[{"wing": 2, "tail": 1}, 1],
        model=EquivalentModel(lattice=LATTICE, step_s=0.01),
        search=SearchSettings(method="least_squares", iterations=2),
    )  # fmt: skip
    checkpoint = [step.checkpoint for step in run.steps()][-1]
    found = run.result(checkpoint)
    assert [row.links_per_wing for row in found.rows] == [1, {"wing": 2, "tail": 1}]
    assert [row.bodies for row in found.rows] == [5, 7]
    assert found.recommended.links_per_wing == {"wing": 2, "tail": 1}
    assert found.recommended.reason.startswith("2 links of wing, 1 of tail: J = ")
    assert found.row({"wing": 2, "tail": 1}).batch.links_per_wing == {"wing": 2, "tail": 1}
    json.dumps(found.to_document())
