"""The flight condition. The JSON of ``examples/flight.json``."""

from __future__ import annotations

import math
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
DriveName = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]{0,49}$")]
OwnDrive = Literal["auto", "none"]
Rate = Annotated[float, Field(ge=-5.0, le=5.0)]
LARGEST_LOAD_FACTOR = 10.0  # of a steady turn; it banks by 1.47 rad there

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
    bank_rad: float = Field(
        default=0.0, ge=-1.5, le=1.5, description="Roll angle phi at the start, right wing down."
    )


class Flight(Document):
    """Airspeed, air and steady motion at the start of every sample: level flight, unless it says otherwise.

    A steady flight climbs, turns about the vertical or sideslips at constant airspeed. Sideslip is as given,
    zero in a turn too; where the flight is not symmetric, the bank angle balances the forces across it.
    """

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
    climb_rad: float = Field(
        default=0.0,
        ge=-1.2,
        le=1.2,
        description="Angle of the flight path through the air above the horizontal.",
    )
    turn_rate_rad_s: float = Field(
        default=0.0,
        ge=-2.0,
        le=2.0,
        description="Rate of the heading in a steady turn, positive to the right. The bank angle follows; "
        "that of a coordinated turn, about the flight path, has the tangent V * rate / g.",
    )
    sideslip_rad: float = Field(
        default=0.0,
        ge=-0.35,
        le=0.35,
        description="Angle between the stream and the plane of symmetry, positive with the wind from the "
        "right.",
    )
    rates_rad_s: Annotated[list[Rate], Field(min_length=3, max_length=3)] | None = Field(
        default=None,
        description="Rates p, q, r in body axes instead of those of a turn. Speed, angle of attack and rates "
        "do not change at the start, as in a pull-up or a steady roll; later they do, because the weight "
        "turns in body axes.",
    )
    trim_drive: DriveName | None = Field(
        default=None,
        description="A drive (`incidence_left`), or a word for both sides (`incidence`), whose angle "
        "balances the pitching moment in trim. It holds that angle; a history given for it counts from its "
        "first value as an increment. Default: a constant moment balances. Not used from a given start.",
    )
    roll_trim_drive: OwnDrive | DriveName = Field(
        default="auto",
        description="The same for the rolling moment. `auto`: in flights with a sideslip, a turn, or rates "
        "of roll or yaw, the first control that moves the trailing edges of both sides against each other; "
        "`none`: a constant moment.",
    )
    yaw_trim_drive: OwnDrive | DriveName = Field(
        default="auto",
        description="The same for the yawing moment. `auto`: in those flights the first control of a fin.",
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

    @property
    def load_factor(self) -> float:
        """Lift over weight of the steady flight."""
        return load_factor(self.airspeed_m_s, self.gravity_m_s2, self.climb_rad, self.turn_rate_rad_s)

    @property
    def is_lateral(self) -> bool:
        """Whether the flight has a sideslip, a turn, or a rate of roll or yaw."""
        p, _, r = self.rates_rad_s or [0.0, 0.0, 0.0]
        return any((self.sideslip_rad, self.turn_rate_rad_s, p, r))

    def faults(self) -> Iterator[Fault]:
        """Check that the motion can be flown, and that Mach is within the method's validity."""
        yield from self._motion_faults()
        mach = self.mach_number
        if mach is not None and mach > MACH_LIMIT:
            yield Fault(
                "unsupported_regime",
                f"{self.airspeed_m_s:g} m/s at {self.altitude_m:g} m is Mach {mach:.2f}.",
                "/mach",
                f"Linear compressibility ends at Mach {MACH_LIMIT}: fly slower, or omit mach.",
            )

    def _motion_faults(self) -> Iterator[Fault]:
        if self.rates_rad_s is not None and self.turn_rate_rad_s:
            yield Fault(
                "two_rotations",
                "turn_rate_rad_s and rates_rad_s both say how the aircraft rotates.",
                "/rates_rad_s",
                "Give one of them: the rates of a turn follow from its rate.",
            )
        if self.is_lateral and not self.gravity_m_s2:
            yield Fault(
                "unsteady_flight",
                "Without gravity no bank angle balances a sideslip, a turn, a roll or a yaw.",
                "/gravity_m_s2",
                "Give gravity, or fly straight.",
            )
        if self.load_factor > LARGEST_LOAD_FACTOR:
            across = math.cos(self.climb_rad)
            steepest = math.sqrt((LARGEST_LOAD_FACTOR / across) ** 2 - 1.0)
            yield Fault(
                "unsteady_flight",
                f"A turn of {self.turn_rate_rad_s:g} rad/s at {self.airspeed_m_s:g} m/s needs a lift of "
                f"{self.load_factor:.3g} times the weight.",
                "/turn_rate_rad_s",
                f"Up to {steepest * self.gravity_m_s2 / self.airspeed_m_s:.3g} rad/s it is at most "
                f"{LARGEST_LOAD_FACTOR:g} times: turn less, or fly slower.",
            )


def load_factor(airspeed_m_s: float, gravity_m_s2: float, climb_rad: float, turn_rate_rad_s: float) -> float:
    """Lift over weight of a steady climb and coordinated turn, cos(climb) / cos(bank); 1 without gravity.

    The bank angle about the flight path has the tangent V * rate / g: the lift carries g cos(climb) and turns
    the path, of which V cos(climb) is horizontal.
    """
    if not gravity_m_s2:
        return 1.0
    return math.cos(climb_rad) * math.hypot(1.0, airspeed_m_s * turn_rate_rad_s / gravity_m_s2)


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
