"""The flight condition. The JSON of ``examples/flight.json``."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field, WithJsonSchema

from morphdata.atmosphere import standard_atmosphere
from morphdata.base import Document, Vector3
from morphdata.faults import Fault

MACH_LIMIT = 0.7  # linear compressibility (Prandtl-Glauert) is valid up to here
# an enumeration with one value: generated clients treat a constant in a union as the only choice
Auto = Annotated[Literal["auto"], WithJsonSchema({"type": "string", "enum": ["auto"]})]

EXAMPLE_FLIGHT: dict[str, Any] = {
    "airspeed_m_s": 150.0,
    "air_density_kg_m3": 1.225,
    "gravity_m_s2": 9.81,
    "altitude_m": 0.0,
    "mach": 0.0,
    "start": {
        "alpha_rad": 0.06231329180863801,
        "force_b_n": [341.282868, 0.0, 21.438968],
        "moment_b_n_m": [0.0, -736.319035, 0.0],
    },
}


class Start(Document):
    """A measured start: attitude relative to the air, and the constant force and moment that hold it."""

    alpha_rad: float = Field(ge=-0.5, le=0.5)
    force_b_n: Vector3 = Field(default=[0.0, 0.0, 0.0], description="Body axes, at the reference point.")
    moment_b_n_m: Vector3 = Field(
        default=[0.0, 0.0, 0.0],
        description="Body axes, about the reference point; beyond that of the thrust if the aircraft has a "
        "line of thrust.",
    )


class Flight(Document):
    """Airspeed, air and start of every sample."""

    model_config = ConfigDict(json_schema_extra={"examples": [EXAMPLE_FLIGHT]})

    airspeed_m_s: float = Field(gt=0.0, le=1000.0)
    air_density_kg_m3: Annotated[float, Field(gt=0.0, le=2.0)] | None = Field(
        default=None, description="Default: that of the standard atmosphere at `altitude_m`."
    )
    gravity_m_s2: float = Field(default=9.80665, ge=0.0, le=30.0)
    altitude_m: float = Field(default=0.0, ge=-1000.0, le=20_000.0)
    mach: Annotated[float, Field(ge=0.0, le=MACH_LIMIT)] | Auto | None = Field(
        default=None, description='Mach number, "auto" from speed and altitude, null for incompressible flow.'
    )
    wind_n_m_s: Vector3 = Field(default=[0.0, 0.0, 0.0], description="Velocity of the air, earth axes (NED).")
    apparent_mass: bool = Field(
        default=False,
        description="Whether wings accelerate air with them: pi rho b^2 per length for a semichord b. It "
        "matters for light wings; leave it out where the source of the samples leaves it out.",
    )
    start: Start | None = Field(default=None, description='Needed for `model.start = "given"`.')
    trim_drive: Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]{0,49}$")] | None = Field(
        default=None,
        description="A drive (`incidence_left`), or a word for both sides (`incidence`), whose angle "
        "balances the pitching moment in trim. It holds that angle; a history given for it counts from its "
        "first value as an increment. Default: a constant moment balances. Not used from a given start.",
    )

    @property
    def mach_number(self) -> float | None:
        """Mach number; None for incompressible flow."""
        if self.mach != "auto":
            return self.mach
        return self.airspeed_m_s / standard_atmosphere(self.altitude_m).speed_of_sound_m_s

    @property
    def density_kg_m3(self) -> float:
        """Density of the air, given or the standard atmosphere's."""
        if self.air_density_kg_m3 is not None:
            return self.air_density_kg_m3
        return standard_atmosphere(self.altitude_m).density_kg_m3

    def faults(self) -> Iterator[Fault]:
        """Check that a Mach number from speed and altitude is within the method's validity."""
        mach = self.mach_number
        if mach is not None and mach > MACH_LIMIT:
            yield Fault(
                "unsupported_regime",
                f"{self.airspeed_m_s:g} m/s at {self.altitude_m:g} m is Mach {mach:.2f}.",
                "/mach",
                f"Linear compressibility ends at Mach {MACH_LIMIT}: fly slower, or omit mach.",
            )


def load_flight(path: str | Path) -> Flight:
    """Read a flight condition from its JSON file.

    Parameters
    ----------
    path : str or Path
        The file.

    Returns
    -------
    Flight
        The document.

    Raises
    ------
    InvalidInput
        Lists every fault, with pointers that begin with ``/flight``.

    Examples
    --------
    >>> from morphcore import load_flight
    >>> load_flight("examples/flight.json").density_kg_m3
    1.225
    """
    return Flight.load(path, "/flight")
