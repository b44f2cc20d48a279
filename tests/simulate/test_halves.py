"""Half a symmetric aircraft stands for the whole one."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from morphcore.aero.operator import lattice_operator
from morphcore.errors import InvalidInput
from morphcore.geometry.aircraft import Aircraft
from morphcore.geometry.mirror import mirror_of
from morphcore.identify.cost import fly_attitudes, sample_cases, shared_trims
from morphcore.models.equivalent import ChainModel, chain_model, lane_constants, physical_guess
from morphcore.models.kinematics import whole_joints
from morphcore.paper.computation import benchmark_swarm
from morphcore.simulate.common_path import common_path
from morphcore.simulate.plan import flight_plan
from morphcore.simulate.schedule import ConstantRate
from morphcore.simulate.time_grid import time_grid
from morphcore.simulate.trim import trim
from morphdata.environment import Environment, Gust
from tests.models.chains import aircraft_of, example_aircraft, example_flight
from tests.simulate.flights import example_model, fly, sample, sample_schedules, steps

# sums in another order, over hundreds of steps of an aircraft that leaves its trim by itself
ROUND_OFF_RAD = 1e-10


def wing(side: str, **more: Any) -> dict[str, Any]:
    """A tapered wing with offset axes, as a document."""
    return {
        "name": side, "side": side, "span_m": 2.0, "root_chord_m": 0.5, "tip_chord_m": 0.3,
        "thickness_m": 0.06,
        "material": {"density_kg_m3": 300.0, "youngs_modulus_pa": 2e9, "stiffness_damping_s": 2e-3},
        "hinge": {"position_m": [0.1, 0.3 if side == "right" else -0.3, -0.1], "axis": "z"},
        "elastic_axis_offset_m": 0.05, "mass_axis_offset_m": 0.02, **more,
    }  # fmt: skip


def tailed(**change: Any) -> Aircraft:
    """Two wings and a fixed rigid tail, the left tail named before the right wing."""
    tail = {"span_m": 0.8, "flexible": False, "position_m": [-2.2, 0.0, -0.3]}
    left_tail, right_tail = (
        wing("left") | tail | {"name": "tail l"},
        wing("right") | tail | {"name": "tail r"},
    )
    for part in (left_tail, right_tail):
        part.pop("hinge")
    return aircraft_of(
        {
            "fuselage": {"length_m": 4.0, "width_m": 0.5, "height_m": 0.5, "density_kg_m3": 120.0},
            "surfaces": [wing("left"), left_tail, wing("right") | change, right_tail],
        }
    )


def whole_and_half(model: ChainModel, angle: float) -> tuple[np.ndarray, np.ndarray]:
    """The operator of one half folded out of the whole one's, and the half model's own."""
    assert model.half is not None
    assert model.mirror is not None
    whole = lattice_operator(model.lattice, [angle] * len(model.aircraft.hinges), mach=0.3).matrix
    own = lattice_operator(model.half.lattice, [angle] * len(model.mirror.own_hinges), mach=0.3).matrix
    n = model.half.lattice.strips // len(model.mirror.own)
    blocks = [
        [
            whole[5 * n * i : 5 * n * (i + 1), 2 * n * j : 2 * n * (j + 1)]
            + whole[5 * n * i : 5 * n * (i + 1), 2 * n * k : 2 * n * (k + 1)]
            for j, k in zip(model.mirror.own, model.mirror.image, strict=True)
        ]
        for i in model.mirror.own
    ]
    folded = np.block(blocks)
    return folded, own[: folded.shape[0], : folded.shape[1]]


@pytest.mark.parametrize("aircraft", [example_aircraft(), tailed()], ids=["wings", "tailed"])
@pytest.mark.parametrize("angle", [0.0, 0.9])
def test_a_mirror_image_induces_what_the_other_half_does(aircraft: Aircraft, angle: float) -> None:
    """The half's operator is the whole one's for equal circulations on both sides, to round-off."""
    folded, own = whole_and_half(chain_model(aircraft, example_flight(), 2), angle)
    np.testing.assert_allclose(own, folded, rtol=0.0, atol=1e-12 * np.abs(folded).max())


@pytest.mark.parametrize("name", ["train_rate_0.5", "train_rate_0.8"])
def test_half_an_aircraft_flies_like_the_whole(name: str) -> None:
    """Attitudes of many models agree to round-off, and half an aircraft never rolls or yaws."""
    model = example_model(3)
    swarm = benchmark_swarm(model, 5)
    flown = []
    for separate in (False, True):
        (case,) = sample_cases(model, [sample(name)], separate_wings=separate)
        assert case.plan.halved is not separate
        ((_, found),) = shared_trims(model, swarm, [case], "trim")
        flown.append(fly_attitudes(model, swarm, case, found))
    half, whole = flown
    assert np.abs(half - whole).max() < ROUND_OFF_RAD
    assert np.abs(half[..., [0, 2]] - half[:, :1, [0, 2]]).max() < 1e-14


def test_a_single_flight_tells_of_both_halves() -> None:
    """Trim, tips, angles and motion of `simulate` are those of the whole aircraft, tail and all.

    A gust of no strength keeps the simulator from halving.
    """
    aircraft, schedule = tailed(), ConstantRate(0.0, 0.3, 0.5, start_s=0.05)
    still = Environment(gust=Gust(amplitude_m_s=0.0, gradient_m=10.0))
    half, whole = (
        fly(
            aircraft,
            replace(example_flight(), airspeed_m_s=70.0, start=None),
            {"left": schedule, "right": schedule},
            model=physical_guess(chain_model(aircraft, example_flight(), 3)),
            duration_s=0.7,
            environment=environment,
        )
        for environment in (None, still)
    )
    np.testing.assert_allclose(half.trim.q_joint, whole.trim.q_joint, rtol=0.0, atol=1e-9)
    assert half.trajectory.extra.keys() == whole.trajectory.extra.keys()
    np.testing.assert_allclose(half.trajectory.euler, whole.trajectory.euler, rtol=0.0, atol=ROUND_OFF_RAD)
    for name, column in whole.trajectory.extra.items():
        np.testing.assert_allclose(half.trajectory.extra[name], column, rtol=0.0, atol=1e-7, err_msg=name)
    np.testing.assert_array_equal(half.trajectory.sweep_left, whole.trajectory.sweep_left)


@pytest.mark.parametrize(
    "aircraft",
    [
        tailed(span_m=2.01),
        tailed(profile_drag=0.01),
        tailed(hinge={"position_m": [0.1, 0.31, -0.1], "axis": "z"}),
        tailed(hinge={"position_m": [0.1, 0.3, -0.1], "axis": "y"}),
        replace(tailed(), surfaces=tailed().surfaces[:3]),
        replace(tailed(), fuselage=replace(tailed().fuselage, centre_of_mass_B=np.array([0.0, 0.01, 0.0]))),
        replace(tailed(), fuselage=replace(tailed().fuselage, inertia_B=np.diag([1, 2, 2.5]) + 0.1)),
    ],
)
def test_what_is_not_symmetric_flies_whole(aircraft: Aircraft) -> None:
    """Any difference between the sides, a surface without its image, or a lopsided fuselage."""
    model = chain_model(aircraft, example_flight(), 2)
    assert mirror_of(tailed(), example_flight()) is not None
    assert model.half is None


def test_a_lopsided_start_flies_whole() -> None:
    """A measured start with a rolling moment."""
    flight = example_flight()
    assert flight.start is not None
    rolling = replace(flight, start=replace(flight.start, moment_B=np.array([1.0, 0.0, 0.0])))
    assert chain_model(example_aircraft(), rolling, 2).half is None


def test_unequal_sweeps_fly_whole() -> None:
    """The asymmetric sample, and one whose sides differ by a microradian."""
    model = example_model(2)
    even = sample("train_rate_0.8")
    uneven = replace(even, drives={**even.drives, "sweep_left": even.sweep_left + 1e-6})
    for flown in (sample("train_asymmetric"), uneven):
        (case,) = sample_cases(model, [flown])
        assert not case.plan.halved
        assert case.plan.flown(model) is model


def test_plans_are_of_the_whole_unless_requested() -> None:
    """Who does not know of halves gets a plan for the model at hand."""
    model = example_model(2)
    schedules = sample_schedules("train_rate_0.8")
    grid = time_grid(sample("train_rate_0.8").time_s)
    assert not flight_plan(model, schedules, grid).halved
    assert flight_plan(model, schedules, grid, may_halve=True).halved
    assert not common_path(model, 0.0, 0.1).halved


def test_the_joints_of_the_other_half() -> None:
    """A trim of the half, spread over both, is the trim of the whole: flap and lag turn the other way."""
    model = chain_model(tailed(), replace(example_flight(), airspeed_m_s=70.0, start=None), 3)
    assert model.half is not None
    guess, schedules = physical_guess(model), [ConstantRate(0.2, 0.3, 0.5)] * len(model.aircraft.hinges)
    whole, half = (
        trim(plan.flown(model), guess, plan).require()
        for plan in (
            flight_plan(model, schedules, steps(0.1, 0.005), may_halve=may_halve)
            for may_halve in (False, True)
        )
    )
    np.testing.assert_allclose(whole_joints(model, half.q_joint), whole.q_joint, rtol=0.0, atol=1e-9)
    assert np.abs(whole.q_joint).max() > 1e-3


def test_wings_of_their_own_need_the_whole() -> None:
    """Half an aircraft refuses parameters that differ from wing to wing."""
    model = example_model(2)
    assert model.half is not None
    with pytest.raises(InvalidInput, match="for 2 wings"):
        lane_constants(model.half, physical_guess(model, separate_wings=True), 0.005)
