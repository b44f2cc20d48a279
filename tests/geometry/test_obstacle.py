"""What keeps an aircraft from flying, estimated from its document alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_bvp

from morphcore.geometry.aircraft import Aircraft
from morphcore.geometry.obstacle import LIFT_SLOPE, _divergence_pressure, load_per_length, obstacle
from tests.models.chains import example_aircraft, example_flight


def with_modulus(number: int, modulus_pa: float) -> Aircraft:
    """The example with another material of one wing."""
    aircraft = example_aircraft()
    surfaces = list(aircraft.surfaces)
    material = surfaces[number].material.model_copy(update={"youngs_modulus_pa": modulus_pa})
    surfaces[number] = replace(surfaces[number], material=material)
    return replace(aircraft, surfaces=tuple(surfaces))


def test_the_example_meets_no_obstacle() -> None:
    """It flies."""
    assert obstacle(example_aircraft(), example_flight()) is None


@pytest.mark.parametrize("number", [0, 1])
def test_the_soft_wing_is_named(number: int) -> None:
    """A modulus in GPa instead of Pa: pointer and name are those of the wing that has it."""
    found = obstacle(with_modulus(number, 2.1), example_flight())
    assert found is not None
    assert found.pointer == f"/aircraft/surfaces/{number}/material/youngs_modulus_pa"
    assert example_aircraft().surfaces[number].name in found.hint


def test_a_uniform_wing_bends_as_a_cantilever() -> None:
    """The limit lies where the tip's slope q L^3 / (6 EI) is one radian, by beam theory."""
    aircraft, flight = example_aircraft(), example_flight()
    wing = aircraft.surfaces[0]
    weight = (aircraft.fuselage.mass_kg + 90.0) * flight.gravity_m_s2
    assert load_per_length(aircraft, flight) == pytest.approx(weight / 6.0)
    modulus = weight / 6.0 * 3.0**3 / 6.0 / (0.3 * 0.1**3 / 12.0)
    assert wing.chord_at(0.0) == pytest.approx(0.3)
    assert "too soft" in (obstacle(with_modulus(0, 0.99 * modulus), flight) or _none()).hint
    stiffer = obstacle(with_modulus(0, 1.01 * modulus), flight)
    assert stiffer is None or "too soft" not in stiffer.hint


def test_too_little_air_is_named() -> None:
    """At a walking pace no wing carries the aircraft."""
    found = obstacle(example_aircraft(), replace(example_flight(), airspeed_m_s=5.0))
    assert found is not None
    assert found.pointer == "/flight/airspeed_m_s"


def test_divergence_is_that_of_the_twisting_beam() -> None:
    """At the pressure found, GJ t'' + q e c a t = 0 has a solution of its own with t(0) = 0 and t'(L) = 0.

    By shooting with scipy: the slope at the tip vanishes there, and not at other pressures.
    """
    wing = replace(example_aircraft().surfaces[0], elastic_axis_offset_m=0.03)
    stiffness = float(wing.section_at(np.zeros(1)).gj[0])
    pressure = _divergence_pressure(wing)

    def tip_slope(q: float) -> float:
        rate = q * (0.25 * 0.3 + 0.03) * 0.3 * LIFT_SLOPE / stiffness
        y = np.linspace(0.0, 3.0, 50)
        found = solve_bvp(
            lambda _, t: np.stack([t[1], -rate * t[0]]),
            lambda root, _: np.array([root[0], root[1] - 1.0]),
            y, np.zeros((2, y.size)), tol=1e-8,
        )  # fmt: skip
        return float(found.sol(3.0)[1])

    assert tip_slope(pressure) == pytest.approx(0.0, abs=1e-5)
    assert tip_slope(0.9 * pressure) > 0.05
    assert _divergence_pressure(replace(wing, elastic_axis_offset_m=-0.075)) == np.inf


def _none() -> object:
    raise AssertionError("no obstacle was found")
