"""Flights and trims of aircraft with cambered, twisted wings: every kind of model, both cores, both sides."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from morphcore.frames import euler_from_quaternion
from morphcore.geometry.aircraft import Aircraft
from morphcore.geometry.mirror import mirror_of
from morphcore.models.equivalent import chain_model, physical_guess
from morphcore.simulate.schedule import ConstantRate, Hold
from morphcore.simulate.trim import trim
from morphdata.environment import Environment, Gust
from morphdata.lattice import CoreLaw, Lattice, VortexCore
from tests.models.chains import EXAMPLES, aircraft_of, example_aircraft, example_flight, instant, random_batch
from tests.oracles.fresh import FreshModel, fly_fresh
from tests.simulate.flights import fly, fly_trimmed, plan_of
from tests.simulate.test_trim import start_rates

Array = NDArray[np.float64]

MODERATE: dict[str, float] = {"zero_lift_rad": -0.05, "cm0": -0.06, "twist_rad": -0.02}
OTHER: dict[str, float] = {"zero_lift_rad": -0.03, "cm0": 0.02, "twist_rad": 0.03}
ROUND_OFF_RAD = 1e-9


def with_sections(right: dict[str, float], left: dict[str, float], **material: float) -> Aircraft:
    """The example's aircraft with these sections."""
    document = json.loads((EXAMPLES / "aircraft.json").read_text(encoding="utf-8"))
    for surface in document["surfaces"]:
        surface.update(right if surface["side"] == "right" else left)
        surface["material"].update(material)
    return aircraft_of(document)


def free_flight() -> Any:
    """The example's flight condition, without a given start."""
    return replace(example_flight(), start=None)


@pytest.mark.parametrize("law", ["line", "smoothed"])
@pytest.mark.parametrize("sections", [{"zero_lift_rad": -0.06}, MODERATE], ids=["cambered", "twisted"])
def test_stiff_models_trim_alike(law: CoreLaw, sections: dict[str, float]) -> None:
    """One link and beams a thousand times as stiff as the example's: incidence, thrust, moment to 2e-3."""
    stiff = with_sections(sections, sections, youngs_modulus_pa=2e12)
    links, beams = (
        fly(
            stiff, free_flight(), [Hold(0.3), Hold(0.3)], model=model, duration_s=0.02,
            lattice=Lattice(core=VortexCore(law=law)),
        ).trim
        for model in ("rigid", "flexible")
    )  # fmt: skip
    for name in ("alpha", "force_B", "moment_B"):
        found, expected = (np.ravel(getattr(each, name)) for each in (links, beams))
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=2e-3 * np.abs(expected).max())
    flat = fly(example_aircraft(), free_flight(), [Hold(0.3), Hold(0.3)], model="rigid", duration_s=0.02).trim
    assert flat.alpha[0] - links.alpha[0] > 0.03


def test_camber_is_an_angle_of_attack() -> None:
    """A rigid aircraft of uniform zero-lift angle meets the air at its lift's angle less the flat one's.

    To 2 per cent: the lift stands across the stream, not across the chord.
    """
    alpha = [
        fly(
            with_sections(sections, sections), free_flight(), [Hold(), Hold()], model="rigid", duration_s=0.02
        ).trim.alpha[0]
        for sections in ({}, {"zero_lift_rad": -0.05})
    ]
    assert alpha[0] - alpha[1] == pytest.approx(0.05, rel=0.02)


@pytest.mark.parametrize("links", [1, 3])
def test_nothing_accelerates(links: int) -> None:
    """The trimmed start stays: the lag has settled to the motion of cambered, twisted sections, too."""
    aircraft = with_sections(MODERATE, OTHER)
    model = chain_model(aircraft, free_flight(), links)
    batch = random_batch(np.random.default_rng(links), model, 4)
    if links > 1:
        batch = batch.changed(zero_lift_rad=batch["zero_lift_rad"] + 0.01)
    swept = np.array([[0.3, 0.0, 0.0], [0.5, 0.0, 0.0]])
    found = trim(model, batch, instant(model, swept)).require()
    rates, n = start_rates(model, batch, swept, found), model.coordinates
    np.testing.assert_allclose(rates[:, 4:10], 0.0, atol=1e-6)
    np.testing.assert_allclose(rates[:, 13 + n : 13 + 2 * n], 0.0, atol=1e-3)


def test_a_trimmed_flight_stays_trimmed() -> None:
    """Chain and beams of different sides fly on level for a tenth of a second, to 1e-7 rad."""
    aircraft = with_sections(MODERATE, OTHER)
    model = physical_guess(chain_model(aircraft, free_flight(), 3))
    for choice in (model, "flexible"):
        flown = fly(aircraft, free_flight(), [Hold(0.2), Hold(0.4)], model=choice, duration_s=0.1).trajectory
        assert np.ptp(flown.euler, axis=0).max() < 1e-7


@pytest.mark.parametrize("kind", ["rigid", "chain", "flexible"])
@pytest.mark.parametrize("law", ["line", "smoothed"])
def test_mirrored_sections_give_a_mirrored_flight(kind: str, law: CoreLaw) -> None:
    """Sides and sweeps exchanged: roll and yaw change sign, pitch does not, to 1e-9 rad."""
    slow, fast = ConstantRate(0.0, 0.1, 0.2), ConstantRate(0.0, 0.2, 0.2)
    flown = []
    for right, left, sweeps in ((MODERATE, OTHER, (slow, fast)), (OTHER, MODERATE, (fast, slow))):
        aircraft = with_sections(right, left)
        choice = physical_guess(chain_model(aircraft, free_flight(), 3)) if kind == "chain" else kind
        flown.append(
            fly(
                aircraft, free_flight(), dict(zip(("right", "left"), sweeps, strict=True)), model=choice,
                duration_s=0.25, lattice=Lattice(core=VortexCore(law=law)),
            ).trajectory.euler
        )  # fmt: skip
    there, back = flown
    assert np.ptp(there[:, 0]) > 1e-3
    np.testing.assert_allclose(back, there * [-1.0, 1.0, -1.0], rtol=0.0, atol=ROUND_OFF_RAD)


def test_half_a_cambered_aircraft_flies_like_the_whole() -> None:
    """Equal sections keep the symmetry, unequal ones end it. A gust of no strength keeps it from halving."""
    aircraft = with_sections(MODERATE, MODERATE)
    assert mirror_of(aircraft, free_flight()) is not None
    for name, value in MODERATE.items():
        assert mirror_of(with_sections(MODERATE, MODERATE | {name: value + 1e-3}), free_flight()) is None
    still = Environment(gust=Gust(amplitude_m_s=0.0, gradient_m=10.0))
    model = physical_guess(chain_model(aircraft, free_flight(), 3))
    schedule = ConstantRate(0.0, 0.3, 0.3, start_s=0.05)
    half, whole = (
        fly(
            aircraft, free_flight(), {"left": schedule, "right": schedule}, model=model, duration_s=0.5,
            environment=environment,
        ).trajectory
        for environment in (None, still)
    )  # fmt: skip
    np.testing.assert_allclose(half.euler, whole.euler, rtol=0.0, atol=1e-10)


def test_more_links_tend_to_the_beams() -> None:
    """The pitch of a chain of six on a cambered, twisted, torsion-loaded wing is nearer than that of two."""
    aircraft = with_sections(MODERATE, MODERATE)
    schedule = ConstantRate(0.0, 0.5, 0.5)
    beams, *chains = (
        fly(aircraft, free_flight(), {"left": schedule, "right": schedule}, model=choice, duration_s=0.6)
        for choice in (
            "flexible",
            *(physical_guess(chain_model(aircraft, free_flight(), n)) for n in (2, 6)),
        )
    )
    two, six = (np.abs(chain.trajectory.theta - beams.trajectory.theta).max() for chain in chains)
    assert six < 0.5 * two
    assert six < 5e-4


def test_a_fresh_lattice_agrees() -> None:
    """Unlike sections on both sides: attitudes within 1 mrad of a lattice rebuilt in every evaluation.

    Flat wings are 0.6 mrad off in this flight: the price of a lattice that does not bend. That
    program lags circulations instead of motions, and puts the slope on the panels of the bent wings.
    """
    model = chain_model(with_sections(MODERATE, OTHER), free_flight(), 2, Lattice(chordwise=2, spanwise=5))
    guess, schedules = physical_guess(model), [ConstantRate(0.0, 0.3, 0.3), ConstantRate(0.0, 0.6, 0.3)]
    plan = plan_of(model, schedules, 0.5, 0.005)
    fast = fly_trimmed(model, plan, guess)
    fresh = FreshModel(model, guess)
    start, state = fresh.trimmed(np.zeros(2))
    assert fast.trim is not None
    assert start.alpha == pytest.approx(fast.trim.alpha[0], rel=5e-3)
    np.testing.assert_allclose(
        start.moment_B, fast.trim.moment_B[0], atol=5e-3 * np.abs(start.moment_B).max()
    )
    flown = np.array([s.quaternion for s in fly_fresh(fresh, schedules, plan.grid, start, state)])
    error = np.abs(euler_from_quaternion(flown) - fast.euler[:, 0])
    assert np.ptp(fast.euler[:, 0], axis=0).min() > 1e-2
    assert error.max() < 1e-3
