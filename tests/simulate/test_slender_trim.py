"""Trims of wings that bend far: slender wings, a tailed aircraft, what limits them, flights that start there.

Bending is confirmed by an independent rod (`tests.oracles.elastica`) under the loads of the trimmed wing, and
by finer elements; PHYSICS 15 names the aircraft.
"""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from morphcore.errors import TrimNotFound
from morphcore.geometry.aircraft import Start
from morphcore.identify.cost import sample_cases, shared_trims
from morphcore.models.equivalent import chain_model, physical_guess
from morphcore.models.kinematics import tip_positions
from morphcore.simulate.flexible import FlexibleFlight
from morphcore.simulate.plan import flight_plan
from morphcore.simulate.time_grid import TimeGrid
from morphcore.simulate.trajectory import Trajectory
from morphcore.simulate.trim import Trim, trim
from morphcore.simulate.trim_limits import BENT_RAD, STALL_RAD
from morphdata.lattice import Lattice, VortexCore
from tests.oracles.elastica import Loads, cantilever_tip
from tests.simulate.flights import fly
from tests.simulate.slender import (
    HALF_SPAN_M,
    Trimmed,
    slender_aircraft,
    slender_flight,
    tailed_aircraft,
    tailed_flight,
    trimmed,
)

Array = NDArray[np.float64]

LAWS = ("line", "smoothed")
FACTORS = (100.0, 10.0, 3.0, 1.5, 1.0, 0.9, 0.8)
GRAVITY = slender_flight().gravity_m_s2


@cache
def slender(stiffness: float, law: str = "line", elements: int = 10) -> Trimmed:
    """The trim of the slender aircraft."""
    return trimmed(slender_aircraft(stiffness), slender_flight(), law, elements=elements)


@cache
def tailed(stiffness: float, law: str = "line") -> Trimmed:
    """The trim of the tailed aircraft."""
    return trimmed(tailed_aircraft(stiffness), tailed_flight(), law)


def is_smooth(values: list[float], limit: float) -> bool:
    """Whether second differences on an equidistant grid stay below a limit."""
    return bool(np.abs(np.diff(values, n=2)).max() < limit)


@pytest.mark.parametrize("law", LAWS)
def test_slender_wings_trim(law: str) -> None:
    """From a hundred times Patil's stiffness to 0.8 of it, and smoothly in between.

    Over the flexibility, in steps of 0.05, the angle of attack first falls (the wing twists nose up), then
    rises as the lift turns inward: never by a jump. Its second differences stay below 4 mrad, and the tip
    rises with every step.
    """
    for factor in FACTORS:
        assert slender(factor, law).found.residual < 1e-10
    steps = [slender(1.0 / flexibility, law) for flexibility in np.linspace(0.05, 1.25, 25)]
    alphas = [step.found.alpha for step in steps]
    tips = [-step.tip[2] for step in steps]
    print(law, [f"{1e3 * alpha:.1f}" for alpha in alphas], [f"{tip:.3f}" for tip in tips])
    assert is_smooth(alphas, 4e-3)
    assert np.diff(tips).min() > 0.0
    assert is_smooth(tips, 0.01)


@pytest.mark.parametrize("law", LAWS)
def test_level_flight_is_level(law: str) -> None:
    """Lift across the path is the weight, by a sum over the forces of the lattice."""
    found = slender(1.0, law)
    loads = wing_loads(found)
    weight = GRAVITY * (50.0 + 2.0 * HALF_SPAN_M * 0.75)
    lift = -2.0 * loads.force_N[:, 2].sum()  # both wings; N points down, the path is level
    R_NB = found.found.state.poses.R[0]
    thrust_N = R_NB @ found.found.force_B
    assert thrust_N[2] == pytest.approx(0.0, abs=1e-6)
    assert lift == pytest.approx(weight, rel=1e-9)


def wing_loads(found: Trimmed) -> Loads:
    """The air's forces on the right wing's sections in N, and its weight per length."""
    model, state = found.model, found.found.state
    flight = FlexibleFlight(model)
    flight.structure(state.poses, state.V, state.A)
    flight.place_lattice(state.poses, np.zeros(3), state.V)
    twists = flight.sections.twists(state.V)
    forces = flight.lattice.section_forces(state.circulation, twists, np.zeros(3))
    axes = flight.sections.place(flight.work, state.poses)
    mine = (model.element >= 0) & (model.element < model.beams.elements // 2)
    length = model.aircraft.surfaces[0].span_m / (model.beams.elements // 2)
    at = (model.element + model.fraction)[mine] * length
    return Loads(
        at,
        np.einsum("kij,kj->ki", axes.R, forces[:, 3:])[mine],
        np.einsum("kij,kj->ki", axes.R, forces[:, :3])[mine],
        np.array([0.0, 0.0, 0.75 * GRAVITY]),
    )


@pytest.mark.parametrize("law", LAWS)
def test_the_bent_wing_is_an_elastica(law: str) -> None:
    """At Patil's stiffness the tip rises by 45 (46) per cent of the half-span, as an independent rod says.

    The rod bears the trimmed wing's air loads and weight, and has no stretch or shear: the tips agree within
    0.03 per cent of the half-span. Forty elements move the tip of ten by 0.06 per cent.
    """
    found = slender(1.0, law)
    R_NB = found.found.state.poses.R[0]
    rigidity = np.array([2e4, 1e4, 4e6])
    along = np.array([0.0, 1.0, 0.0])
    tip_N = cantilever_tip(HALF_SPAN_M, rigidity, R_NB, along, wing_loads(found))
    tip = tip_N @ R_NB / HALF_SPAN_M
    fine = slender(1.0, law, 40).tip
    print(law, "beams", found.tip, "rod", tip, "forty elements", fine)
    np.testing.assert_allclose(found.tip, tip, rtol=0.0, atol=3e-4)
    np.testing.assert_allclose(found.tip, fine, rtol=0.0, atol=1e-3)
    assert -found.tip[2] == pytest.approx({"line": 0.446, "smoothed": 0.460}[law], abs=1e-3)


def chain_trim(stiffness: float, law: str, links: int = 8) -> tuple[Trim, Array]:
    """The nominal chain's trim, and its right tip (3,) over the half-span."""
    chosen = Lattice(core=VortexCore(law=law))  # type: ignore[arg-type]
    model = chain_model(slender_aircraft(stiffness), slender_flight(), links, chosen)
    plan = flight_plan(model, [], TimeGrid(0.0, 1e-3, 2, None))
    batch = physical_guess(model)
    found = trim(model, batch, plan)
    return found, tip_positions(model, batch, plan.hinges[0], found.q_joint)[0, 0] / HALF_SPAN_M


@pytest.mark.parametrize("law", LAWS)
def test_chains_bend_as_the_beams(law: str) -> None:
    """Eight links are within 5 per cent of the beams' tip, in spite of their unbent lattice."""
    found, tip = chain_trim(1.0, law)
    found.require()
    print(law, "chain", tip, "beams", slender(1.0, law).tip)
    assert tip[2] == pytest.approx(slender(1.0, law).tip[2], rel=0.05)


@pytest.mark.parametrize("law", LAWS)
def test_soft_chains_are_followed_from_stiff_joints(law: str) -> None:
    """Newton's method from straight joints fails at 0.9; followed, alpha and tip continue smoothly."""
    factors = [1.0 / flexibility for flexibility in (0.95, 1.0, 1.05, 1.1, 1.15, 1.2, 1.25)]
    found = [chain_trim(factor, law) for factor in factors]
    alphas = [step.require().alpha[0] for step, _ in found]
    tips = [-tip[2] for _, tip in found]
    print(law, alphas, tips)
    assert is_smooth(alphas, 5e-3)
    assert is_smooth(tips, 5e-3)
    assert np.diff(tips).min() > 0.0
    model = chain_model(slender_aircraft(0.9), slender_flight(), 8, Lattice(core=VortexCore(law=law)))  # type: ignore[arg-type]
    plan = flight_plan(model, [], TimeGrid(0.0, 1e-3, 2, None))
    assert not trim(model, physical_guess(model), plan, follow=False).converged.any()


@pytest.mark.parametrize("law", LAWS)
def test_a_tailed_aircraft_trims(law: str) -> None:
    """From EI = 1500 N m^2 to 2.9 times softer, where the tip is at 18 per cent of the span, and beyond.

    Newton's method on the nodes' poses found no trim of the softer ones. Over the flexibility, relative to
    the softest's, alpha falls smoothly; it stays within 2 mrad of the straight line between neighbours.
    """
    soft = tailed(5.0 / 2.9, law)
    assert -soft.tip[2] == pytest.approx(0.175, abs=0.01)
    steps = [tailed(1.0 / flexibility, law) for flexibility in np.linspace(0.1, 1.0, 19)]
    alphas = [step.found.alpha for step in steps]
    print(law, soft.tip, [f"{1e3 * alpha:.2f}" for alpha in alphas])
    assert np.diff(alphas).max() < 0.0
    assert is_smooth(alphas, 5e-4)
    for step in steps:
        assert step.found.residual < 1e-10
    bending_tail = trimmed(tailed_aircraft(5.0 / 2.9, flexible_tail=True), tailed_flight(), law)
    assert bending_tail.found.alpha == pytest.approx(soft.found.alpha, abs=1e-3)


@pytest.mark.parametrize(("kind", "stiffness"), [("slender", 1.0), ("tailed", 5.0 / 2.9)])
def test_the_given_start_of_a_trim_is_the_trim(kind: str, stiffness: float) -> None:
    """Its alpha, force and moment given, the wings settle to the same shape: 1e-7 m and rad."""
    aircraft, flight, free = {
        "slender": (slender_aircraft(stiffness), slender_flight(), slender(stiffness)),
        "tailed": (tailed_aircraft(stiffness), tailed_flight(), tailed(stiffness)),
    }[kind]
    found = free.found
    start = Start(found.alpha, found.force_B, found.moment_B)
    given = trimmed(aircraft, replace(flight, start=start), start="given").found
    assert given.alpha == found.alpha
    np.testing.assert_allclose(given.state.poses.x, found.state.poses.x, rtol=0.0, atol=1e-7)
    np.testing.assert_allclose(given.state.poses.R, found.state.poses.R, rtol=0.0, atol=1e-7)
    np.testing.assert_allclose(given.state.A, 0.0, atol=1e-5)


@pytest.mark.parametrize(("kind", "stiffness"), [("slender", 1.0), ("tailed", 5.0 / 2.9)])
@pytest.mark.parametrize("law", LAWS)
def test_a_bent_aircraft_flies_on(kind: str, stiffness: float, law: str) -> None:
    """A second of flight from the trim, hinges held: attitude stays within 1e-4 rad."""
    aircraft, flight = {
        "slender": (slender_aircraft(stiffness), slender_flight()),
        "tailed": (tailed_aircraft(stiffness), tailed_flight()),
    }[kind]
    chosen = Lattice(core=VortexCore(law=law))  # type: ignore[arg-type]
    flown = fly(
        aircraft, flight, [], model="flexible", duration_s=1.0, step_s=0.005, lattice=chosen
    ).trajectory
    departure = np.abs(flown.euler - flown.euler[0]).max()
    print(kind, law, f"{departure:.2e} rad")
    assert departure < 1e-4


def failure(**changes: Any) -> TrimNotFound:
    """How the trim of a changed slender aircraft fails."""
    aircraft = slender_aircraft(changes.get("stiffness", 1.0), changes.get("mass_kg", 50.0))
    with pytest.raises(TrimNotFound) as caught:
        trimmed(aircraft, slender_flight(changes.get("airspeed_m_s", 25.0)))
    return caught.value


def test_too_little_air_is_named() -> None:
    """At 5 m/s nothing lifts: both lift coefficients, and where rigid wings are at the stall."""
    error = failure(airspeed_m_s=5.0)
    needed = GRAVITY * 74.0 / (0.5 * 0.0889 * 5.0**2 * 32.0)
    assert f"coefficient of {needed:.3g}" in str(error)
    assert np.isfinite(error.residual)
    assert error.residual > 0.1
    hinted = float(re.findall(r"about ([\d.]+) m/s", error.hint)[0])
    stiff = trimmed(slender_aircraft(1e4), slender_flight(hinted)).found
    assert stiff.alpha == pytest.approx(STALL_RAD, rel=0.01)


def test_too_soft_a_wing_is_named() -> None:
    """A twentieth of the stiffness folds up: the message says where, and the hint's factor does trim."""
    error = failure(stiffness=0.05)
    assert "'right wing'" in str(error) or "'left wing'" in str(error)
    assert "per cent of their flexibility" in str(error)
    assert np.isfinite(error.residual)
    assert error.residual > 1e-3
    factor = float(re.findall(r"wings ([\d.]+) times as stiff", error.hint)[0])
    assert factor > 1.0
    stiffer = slender(0.05 * factor)
    assert abs(stiffer.found.alpha) < STALL_RAD
    R = stiffer.found.state.poses.R
    turned = R[stiffer.model.roots[0]].T @ R[stiffer.model.tips[0]]
    assert np.arccos(0.5 * (np.trace(turned) - 1.0)) < BENT_RAD


def test_a_chain_without_trim_says_where_it_ended() -> None:
    """The share of the joints' flexibility, angle of attack and joints there, and what trims."""
    found, _ = chain_trim(0.1, "line")
    with pytest.raises(TrimNotFound, match="per cent of their flexibility") as caught:
        found.require()
    assert 0.0 < found.share[0] < 1.0
    factor = float(re.findall(r"wings ([\d.]+) times as stiff", caught.value.hint)[0])
    chain_trim(0.1 * factor, "line")[0].require()
    heavy = chain_model(slender_aircraft(1.0, mass_kg=1e6), slender_flight(), 1)
    with pytest.raises(TrimNotFound, match="the iteration ended with an angle of attack of"):
        flight_plan(heavy, [], TimeGrid(0.0, 1e-3, 2, None))


def test_mirror_images_trim_alike() -> None:
    """One wing 1.4 times as stiff: the image has the same alpha to 1e-9 rad, roll and yaw reversed."""
    both = [slender_aircraft(stiffness).surfaces for stiffness in (1.0, 1.4)]
    aircraft = slender_aircraft(1.0)
    there = trimmed(replace(aircraft, surfaces=(both[0][0], both[1][1])), slender_flight()).found
    back = trimmed(replace(aircraft, surfaces=(both[1][0], both[0][1])), slender_flight()).found
    assert abs(there.moment_B[0]) > 10.0
    assert back.alpha == pytest.approx(there.alpha, abs=1e-9)
    np.testing.assert_allclose(back.force_B, there.force_B * [1.0, -1.0, 1.0], rtol=0.0, atol=1e-6)
    np.testing.assert_allclose(back.moment_B, there.moment_B * [-1.0, 1.0, -1.0], rtol=0.0, atol=1e-6)


def test_a_soft_chain_flies_halved_and_whole() -> None:
    """Followed in its half or as a whole: the same flight to 1e-9 rad, and it stays in trim."""
    model = chain_model(slender_aircraft(0.9), slender_flight(), 8)
    shared = physical_guess(model)
    apart = physical_guess(model, separate_wings=True)  # sets of their own: flown as a whole
    halved, whole = (
        fly(slender_aircraft(0.9), slender_flight(), [], model=batch, duration_s=0.5, step_s=0.005).trajectory
        for batch in (shared, apart)
    )
    np.testing.assert_allclose(halved.euler, whole.euler, rtol=0.0, atol=1e-9)
    assert np.abs(halved.euler - halved.euler[0]).max() < 1e-6


def level(rows: int = 11) -> Trajectory:
    """A sample of level flight without any drive."""
    time_s, zero = np.linspace(0.0, 0.1, rows), np.zeros(rows)
    return Trajectory(name="level", time_s=time_s, drives={}, phi=zero, theta=zero, psi=zero)


@pytest.mark.parametrize(("stiffness", "needed"), [(1.5, False), (0.9, True)])
def test_a_search_follows_if_its_nominal_model_needs_it(stiffness: float, needed: bool) -> None:  # noqa: FBT001
    """Decided once for a sample; then every set of a batch is trimmed that can be."""
    model = chain_model(slender_aircraft(stiffness), slender_flight(), 8)
    (case,) = sample_cases(model, [level()])
    assert case.needs_following(model, "trim") is needed
    ((_, found),) = shared_trims(model, physical_guess(model), (case,), "trim")
    assert found.converged.all()
