"""The standard atmosphere against the standard's printed tables and the laws behind them."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from morphcore.errors import InvalidInput
from morphdata.atmosphere import GRAVITY_M_S2, standard_atmosphere


@pytest.mark.parametrize(
    ("altitude_m", "temperature_k", "pressure_pa", "density_kg_m3", "speed_of_sound_m_s"),
    [
        (-1000, 294.65, 113929.0, 1.34700, 344.111),
        (0, 288.15, 101325.0, 1.22500, 340.294),
        (1000, 281.65, 89874.6, 1.11164, 336.434),
        (5000, 255.65, 54019.9, 0.736116, 320.529),
        (10000, 223.15, 26436.3, 0.412707, 299.463),
        (11000, 216.65, 22632.1, 0.363918, 295.070),
        (15000, 216.65, 12044.6, 0.193674, 295.070),
        (20000, 216.65, 5474.89, 0.0880349, 295.070),
    ],
)
def test_the_standards_table(
    altitude_m: float,
    temperature_k: float,
    pressure_pa: float,
    density_kg_m3: float,
    speed_of_sound_m_s: float,
) -> None:
    """ISO 2533:1975, table by geopotential altitude, to its printed six digits."""
    air = standard_atmosphere(altitude_m)
    assert air.temperature_k == pytest.approx(temperature_k, abs=1e-9)
    assert air.pressure_pa == pytest.approx(pressure_pa, rel=5e-6)
    assert air.density_kg_m3 == pytest.approx(density_kg_m3, rel=5e-6)
    assert air.speed_of_sound_m_s == pytest.approx(speed_of_sound_m_s, rel=2e-6)


@given(st.floats(-990, 19_990).filter(lambda h: abs(h - 11_000) > 10))
def test_air_carries_its_own_weight(altitude_m: float) -> None:
    """Hydrostatic balance, dp/dh = -rho g, by central differences of 1 m."""
    slope = standard_atmosphere(altitude_m + 1).pressure_pa - standard_atmosphere(altitude_m - 1).pressure_pa
    weight = standard_atmosphere(altitude_m).density_kg_m3 * GRAVITY_M_S2
    assert slope / 2 == pytest.approx(-weight, rel=1e-7)


@given(st.floats(-1000, 20_000))
def test_air_is_a_perfect_gas(altitude_m: float) -> None:
    """Pressure is rho R T with R of the standard, and a^2 = 1.4 p / rho."""
    air = standard_atmosphere(altitude_m)
    assert air.pressure_pa == pytest.approx(air.density_kg_m3 * 287.05287 * air.temperature_k, rel=1e-12)
    assert air.speed_of_sound_m_s**2 == pytest.approx(1.4 * air.pressure_pa / air.density_kg_m3, rel=1e-12)


@pytest.mark.parametrize("altitude_m", [-1001, 20_001, math.nan, math.inf])
def test_altitudes_outside_are_refused(altitude_m: float) -> None:
    """Outside the two lowest layers there is no answer, but an error at the field."""
    with pytest.raises(InvalidInput) as caught:
        standard_atmosphere(altitude_m)
    assert caught.value.pointer == "/flight/altitude_m"
    assert caught.value.hint
