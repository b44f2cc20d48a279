"""Warnings: each where it belongs, none where it does not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from morphcore.models.equivalent import chain_model, physical_guess
from morphcore.simulate.flight import ModelChoice
from morphcore.simulate.schedule import ConstantRate, Hold
from morphcore.validity import (
    AirMotion,
    air_motion,
    air_warnings,
    error_warning,
    light_wing_warnings,
    steep_warning,
    wake_warnings,
)
from morphdata.lattice import Lattice
from tests.aero.shaped import aircraft as shaped
from tests.aero.shaped import pair
from tests.geometry.rehinged import rehinged
from tests.models.chains import example_aircraft, example_flight
from tests.simulate.flights import fly

COARSE = Lattice(chordwise=1, spanwise=4)
TIMES = np.linspace(0.0, 1.0, 101)
UNSAID = replace(example_flight(), mach=None)  # whether the air is compressed
SLOW = replace(UNSAID, airspeed_m_s=90.0)


def codes(warnings: object) -> list[str]:
    """The codes of warnings, in order."""
    return [warning.code for warning in warnings]  # type: ignore[attr-defined]


def motion(alpha_rad: float, speed_m_s: float) -> AirMotion:
    """A flight of one row."""
    return AirMotion(np.zeros(1), np.array([alpha_rad]), np.array([speed_m_s]))


@pytest.mark.parametrize(("degrees", "warned"), [(14.9, False), (15.1, True), (-15.1, True)])
def test_incidence_beyond_fifteen_degrees(degrees: float, warned: bool) -> None:  # noqa: FBT001
    """Either way."""
    found = air_warnings(SLOW, [("the flight", "/flight", motion(np.radians(degrees), 90.0))])
    assert codes(found) == ["large_alpha"] * warned


@pytest.mark.parametrize(("mach", "warned"), [(0.29, False), (0.31, True)])
def test_mach_beyond_three_tenths(mach: float, warned: bool) -> None:  # noqa: FBT001
    """Of 340.294 m/s at sea level (ISO 2533); in the flight as at its start; not where mach is given."""
    speed = mach * 340.294
    assert codes(air_warnings(SLOW, [("", "", motion(0.0, speed))])) == ["compressible"] * warned
    fast = replace(SLOW, airspeed_m_s=speed)
    assert codes(air_warnings(fast, [])) == ["compressible"] * warned
    assert air_warnings(replace(fast, mach=mach), []) == []
    assert air_warnings(replace(fast, mach=0.0), []) == []


@pytest.mark.parametrize(("share", "warned"), [(0.099, False), (0.101, True)])
def test_apparent_mass_left_out(share: float, warned: bool) -> None:  # noqa: FBT001
    """Wings of 0.3 m chord and 15 kg/m in air of so much density; none where the flight has it."""
    density = share * 15.0 / (np.pi * 0.15**2)
    flight = replace(SLOW, air_density_kg_m3=density)
    assert codes(light_wing_warnings(example_aircraft(), flight)) == ["apparent_mass_left_out"] * warned
    assert light_wing_warnings(example_aircraft(), replace(flight, apparent_mass=True)) == []


@pytest.mark.parametrize(("up_m", "warned"), [(0.1, True), (0.35, True), (1.0, False), (-0.5, False)])
def test_a_tail_in_a_wake(up_m: float, warned: bool) -> None:  # noqa: FBT001
    """Three metres behind wings of 0.5 m chord at 0.1 rad, whose wake is 0.3 m above them there."""
    tailed = shaped(
        *pair("wing", 2.5, (0.5, 0.5), position_m=[0.0, 0.0, 0.0]),
        *pair("tail", 1.0, (0.3, 0.3), position_m=[-3.0, 0.0, -up_m]),
    )
    found = wake_warnings(tailed, np.zeros(0), 0.1, "/aircraft")
    assert codes(found) == ["surface_in_wake"] * warned
    assert wake_warnings(example_aircraft(), np.zeros(2), 0.1, "/aircraft") == []


def test_incidence_by_hand() -> None:
    """A level aircraft that sinks at 10 m/s in a wind from ahead, yawed by a right angle: atan(10 / 60)."""
    found = air_motion(
        example_aircraft(),
        np.zeros(1),
        np.array([[0.0, 0.1, np.pi / 2]]),
        np.array([[0.0, 50.0, 10.0]]),
        np.array([[0.0, -10.0, 0.0]]),
        np.zeros((1, 2)),
    )
    assert found.incidence[0] == pytest.approx(0.1 + np.arctan(10.0 / 60.0))
    assert found.airspeed[0] == pytest.approx(np.hypot(60.0, 10.0))


def test_a_hinge_of_incidence_counts() -> None:
    """A wing turned nose up by its hinge meets the air at the body's angle and its own."""
    aircraft = example_aircraft()
    turning = tuple(rehinged(surface, "y") for surface in aircraft.surfaces)
    found = air_motion(
        replace(aircraft, surfaces=turning), np.zeros(1), np.array([[0.0, 0.05, 0.0]]),
        np.array([[50.0, 0.0, 0.0]]), np.zeros((1, 3)), np.array([[0.0, 0.3]]),
    )  # fmt: skip
    assert found.incidence[0] == pytest.approx(0.35)


def test_a_twisted_tip_counts() -> None:
    """Its incidence is that of body, hinges and twist together; or the root's, if the tip is turned down."""
    aircraft = example_aircraft()
    for twist, expected in ((0.2, 0.55), (-0.2, 0.35)):
        twisted = tuple(replace(rehinged(surface, "y"), twist_rad=twist) for surface in aircraft.surfaces)
        found = air_motion(
            replace(aircraft, surfaces=twisted), np.zeros(1), np.array([[0.0, 0.05, 0.0]]),
            np.array([[50.0, 0.0, 0.0]]), np.zeros((1, 3)), np.array([[0.0, 0.3]]),
        )  # fmt: skip
        assert found.incidence[0] == pytest.approx(expected)


def test_steep_pitch() -> None:
    """Beyond the vertical no Euler angle lies; close to it roll and yaw cannot be distinguished."""
    assert steep_warning("x", "", np.array([0.0, 1.4])) == []
    assert "nearly" in steep_warning("x", "", np.array([0.0, -1.55]))[0].message
    assert "degrees" in steep_warning("x", "", np.array([0.0, 4.0]))[0].hint


@pytest.mark.parametrize(("share", "warned"), [(0.049, False), (0.051, True)])
def test_errors_beyond_five_per_cent(share: float, warned: bool) -> None:  # noqa: FBT001
    """Of the rms of the motion; what the integration does not resolve is no error."""
    departure = np.stack([0.0 * TIMES, TIMES, 0.0 * TIMES], axis=1)
    assert codes(error_warning("x", "", share * departure[::-1], departure)) == ["large_error"] * warned
    assert error_warning("x", "", share * 1e-4 * departure, 1e-4 * departure) == []


def models() -> dict[str, ModelChoice]:
    """All three models of the example."""
    guess = physical_guess(chain_model(example_aircraft(), example_flight(), 2, COARSE))
    return {"rigid": "rigid", "equivalent": guess, "flexible": "flexible"}


@pytest.mark.parametrize("kind", ["rigid", "equivalent", "flexible"])
def test_flights_of_all_models_warn(kind: str) -> None:
    """Slow and heavy, trimmed beyond 15 degrees: every model says so, from its trim on; fast it is quiet."""
    options = {"model": models()[kind], "duration_s": 0.1, "lattice": COARSE, "step_s": 2e-3}
    still = [Hold(), Hold()]
    slow = replace(UNSAID, airspeed_m_s=75.0)
    found = fly(example_aircraft(), slow, still, **options)  # type: ignore[arg-type]
    assert np.degrees(found.trim.alpha[0]) > 15.0
    assert codes(found.warnings) == ["large_alpha"]
    assert fly(example_aircraft(), example_flight(), still, **options).warnings == ()  # type: ignore[arg-type]
    fast = fly(example_aircraft(), UNSAID, still, **options)  # type: ignore[arg-type]
    assert codes(fast.warnings) == ["compressible"]


def test_a_sweep_into_the_tail_warns() -> None:
    """The angles that are flown decide, not those at the start."""
    aircraft = example_aircraft()
    tail = replace(
        aircraft.surfaces[0], name="tail", position_m=(-1.9, 1.0, 0.0), hinges=(), span_m=1.0, flexible=False
    )
    whole = replace(aircraft, surfaces=(*aircraft.surfaces, tail))
    quiet = replace(example_flight(), mach=0.0)
    for final, expected in (
        (0.02, []),
        (1.0, ["surfaces_overlap"]),
    ):  # it lies in the wings' wake in any case
        sweep = ConstantRate(0.0, final, 0.4)
        found = fly(whole, quiet, {"both": sweep}, duration_s=0.4, lattice=COARSE)
        assert codes(found.warnings) == ["surface_in_wake", *expected]
