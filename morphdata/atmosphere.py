"""International Standard Atmosphere (ISO 2533:1975) up to 20 km."""

from __future__ import annotations

import math
from dataclasses import dataclass

from morphdata.faults import InvalidInput

SEA_LEVEL_TEMPERATURE_K = 288.15
SEA_LEVEL_PRESSURE_PA = 101_325.0
LAPSE_RATE_K_M = -0.0065
TROPOPAUSE_M = 11_000.0
GAS_CONSTANT_J_KG_K = 287.05287
HEAT_RATIO = 1.4
GRAVITY_M_S2 = 9.80665
CEILING_M = 20_000.0


@dataclass(frozen=True)
class AirState:
    """Temperature (K), pressure (Pa), density (kg/m^3) and speed of sound (m/s) of still air."""

    temperature_k: float
    pressure_pa: float
    density_kg_m3: float
    speed_of_sound_m_s: float


def standard_atmosphere(altitude_m: float) -> AirState:
    """Air at a geopotential altitude between -1 and 20 km.

    Raises
    ------
    InvalidInput : the altitude is outside that range.
    """
    if not -1000.0 <= altitude_m <= CEILING_M:
        raise InvalidInput(
            f"altitude_m is {altitude_m:g}, outside -1000..{CEILING_M:g}",
            pointer="/flight/altitude_m",
            hint="give an altitude inside the standard atmosphere's two lowest layers",
        )
    below = min(altitude_m, TROPOPAUSE_M)
    temperature = SEA_LEVEL_TEMPERATURE_K + LAPSE_RATE_K_M * below
    exponent = -GRAVITY_M_S2 / (GAS_CONSTANT_J_KG_K * LAPSE_RATE_K_M)
    pressure = SEA_LEVEL_PRESSURE_PA * (temperature / SEA_LEVEL_TEMPERATURE_K) ** exponent
    above = altitude_m - below
    pressure *= math.exp(-GRAVITY_M_S2 * above / (GAS_CONSTANT_J_KG_K * temperature))
    return AirState(
        temperature_k=temperature,
        pressure_pa=pressure,
        density_kg_m3=pressure / (GAS_CONSTANT_J_KG_K * temperature),
        speed_of_sound_m_s=math.sqrt(HEAT_RATIO * GAS_CONSTANT_J_KG_K * temperature),
    )
