"""Sections whose lift is limited: flights beyond, trims that need it, and flights that do not come near."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from morphcore.aero.environment import moving_air
from morphcore.aero.kernels.stall import KNEE, capped, kept
from morphcore.errors import InvalidInput, TrimNotFound
from morphcore.geometry.aircraft import Aircraft
from morphcore.models.equivalent import chain_model, lane_constants, physical_guess
from morphcore.simulate.chain_motion import chain_motion
from morphcore.simulate.plan import flight_plan
from morphcore.simulate.schedule import ConstantRate, Hold
from morphcore.simulate.trim import trim, trimmed_state
from morphcore.validity import air_warnings
from morphdata.aircraft import Aircraft as Document
from morphdata.environment import Environment
from morphdata.lattice import Lattice
from tests.models.chains import EXAMPLES, aircraft_of, example_flight
from tests.simulate.flights import fly, steps

Array = NDArray[np.float64]
KINDS = ("rigid", "equivalent", "flexible")
SMALL = Lattice(chordwise=2, spanwise=6)


def limited(**limits: float) -> Aircraft:
    """The example's aircraft with these limits on both wings."""
    document = json.loads((EXAMPLES / "aircraft.json").read_text(encoding="utf-8"))
    for surface in document["surfaces"]:
        surface.update(limits)
    return aircraft_of(document)


def flown(aircraft: Aircraft, kind: str, flight: Any = None, schedules: Any = None, **options: Any) -> Any:
    """A short flight of one kind of model."""
    flight = replace(example_flight(), start=None) if flight is None else flight
    model: Any = physical_guess(chain_model(aircraft, flight, 3)) if kind == "equivalent" else kind
    more = {"elements": 4, "step_s": 0.002} if kind == "flexible" else {"step_s": 0.005}
    options = {"duration_s": 0.1, "output_step_s": 0.02, "lattice": SMALL, **more, **options}
    return fly(aircraft, flight, schedules or [Hold(), Hold()], model=model, **options)


def test_the_cut_is_smooth_and_never_exceeds_the_limit() -> None:
    """Identity below the knee, the limit above; value and slope continuous; both signs."""
    x = np.linspace(0.0, 3.0, 30_001)
    y = np.array([capped(each, 1.4) for each in x])
    below, above = x <= 1.4 * (1.0 - KNEE), x >= 1.4 * (1.0 + KNEE)
    np.testing.assert_array_equal(y[below], x[below])
    np.testing.assert_allclose(y[above], 1.4, rtol=1e-12)
    assert y.max() <= 1.4 + 1e-12
    slope = np.diff(y) / np.diff(x)
    assert slope.min() > -1e-9
    assert np.abs(np.diff(slope)).max() < 1e-3
    for value, expected in ((3.0, 1.4), (-3.0, -0.8), (0.5, 0.5), (0.0, 0.0)):
        assert value * kept(value, -0.08, 0.14, 10.0) == pytest.approx(expected)


@pytest.mark.parametrize("kind", KINDS)
def test_flights_below_the_limits_do_not_change(kind: str) -> None:
    """Limits that no section comes near leave the flight to round-off, and there is no warning."""
    morph = [ConstantRate(0.0, 0.3, 0.6), Hold()]
    with_limits, without = (
        flown(aircraft, kind, schedules=morph, duration_s=0.3)
        for aircraft in (limited(cl_max=1.4, cl_min=-1.0), limited())
    )
    np.testing.assert_allclose(with_limits.trajectory.euler, without.trajectory.euler, rtol=0.0, atol=1e-12)
    assert with_limits.warnings == without.warnings == ()


@pytest.mark.parametrize("kind", KINDS)
def test_a_strong_gust_lifts_no_more_than_the_limit(kind: str) -> None:
    """Far beyond the limit the lift is q S cl_max, q with the gust's own velocity, and there is a warning."""
    aircraft = limited(cl_max=0.6)
    flight = replace(example_flight(), start=None)
    gust = Environment.parse({"gust": {"amplitude_m_s": 40.0, "gradient_m": 30.0, "start_s": 0.02}})
    found, free = (
        flown(each, kind, flight, environment=gust, channels=["nz"], duration_s=0.4)
        for each in (aircraft, limited())
    )
    weight = flight.gravity_m_s2 * _mass(aircraft)
    area = sum(surface.area_m2 for surface in aircraft.surfaces)
    # the tenth: inertia of bending wings, and thrust and drag as the nose turns up
    most = 0.6 * flight.dynamic_pressure_pa * area * (1.0 + (40.0 / 150.0) ** 2) / weight
    assert found.trajectory.channels["nz"].max() < 1.1 * most
    assert free.trajectory.channels["nz"].max() > 1.5 * most
    if kind != "flexible":
        assert found.trajectory.channels["nz"].max() > 0.9 * most
    warning = next(each for each in found.warnings if each.code == "stalled")
    assert "whose limit is 0.6" in warning.message
    assert "stalled" not in [each.code for each in free.warnings]


def _mass(aircraft: Aircraft) -> float:
    surfaces = sum(surface.area_m2 * surface.thickness_m * 500.0 for surface in aircraft.surfaces)
    return float(aircraft.fuselage.mass_kg + surfaces)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("limit", [0.1, 0.39])
def test_a_trim_that_needs_stalled_wings_is_refused(kind: str, limit: float) -> None:
    """The sentence names surface, coefficient and limit, and about the speed that is enough."""
    aircraft = limited(cl_max=limit)
    with pytest.raises(TrimNotFound, match=f"whose sections stall at {limit:g}") as refused:
        flown(aircraft, kind)
    assert "wing'" in str(refused.value)
    speed = float(refused.value.hint.split("about ")[1].split(" m/s")[0])
    free = replace(example_flight(), start=None)
    flown(aircraft, kind, replace(free, airspeed_m_s=1.05 * speed))


@pytest.mark.parametrize("kind", KINDS)
def test_mirrored_gusts_stall_mirrored_wings(kind: str) -> None:
    """The right wing stalls in one gust, the left one in its mirror image: mirrored to 1e-9 rad."""
    rows = [{"y_m": -1.0, "factor": 0.1}, {"y_m": 1.0, "factor": 1.0}]
    image = [{"y_m": -1.0, "factor": 1.0}, {"y_m": 1.0, "factor": 0.1}]
    one, other = (
        flown(
            limited(cl_max=0.55, cl_min=-0.2), kind, duration_s=0.3,
            environment=Environment.parse(
                {"gust": {"amplitude_m_s": 15.0, "gradient_m": 15.0, "spanwise": spanwise}}
            ),
        )
        for spanwise in (rows, image)
    )  # fmt: skip
    assert [[each.code for each in found.warnings] for found in (one, other)] == [["stalled"]] * 2
    assert np.abs(one.trajectory.phi).max() > 1e-3
    for name, sign in (("phi", 1.0), ("theta", -1.0), ("psi", 1.0)):
        apart = getattr(one.trajectory, name) + sign * getattr(other.trajectory, name)
        assert np.abs(apart).max() < 1e-9, name


@pytest.mark.parametrize("kind", KINDS)
def test_a_trim_on_the_bend_of_the_lift_curve(kind: str) -> None:
    """Sections need 0.41 of at most 0.43, where the curve bends: the trim is found at a larger incidence."""
    near, free = (
        flown(each, kind, duration_s=0.04).trim.alpha[0] for each in (limited(cl_max=0.43), limited())
    )
    assert free + 1e-4 < near < free + 5e-3


def test_flights_of_a_search_warn_too() -> None:
    """The motion on which the warnings of identifications and optimisations rest knows of the stall."""
    flight = replace(example_flight(), start=None)
    gust = Environment.parse({"gust": {"amplitude_m_s": 15.0, "gradient_m": 30.0}})
    air = moving_air(gust, flight, [0.0, 0.4])
    for aircraft, codes in ((limited(cl_max=0.5), ["stalled"]), (limited(cl_max=5.0), []), (limited(), [])):
        model = chain_model(aircraft, flight, 2, SMALL)
        batch = physical_guess(model)
        plan = flight_plan(model, [Hold(), Hold()], steps(0.4, 0.005), air=air)
        found = trim(model, batch, plan)
        constants = lane_constants(model, batch, plan.grid.step_s)
        constants.set_thrust(*found.acting_B)
        motion = chain_motion(model, plan, constants, trimmed_state(model, batch, plan, found))
        assert [each.code for each in air_warnings(flight, [("a sample", "/samples/0", motion)])] == codes


@pytest.mark.parametrize(
    ("field", "value"), [("cl_max", 0.0), ("cl_max", -1.0), ("cl_min", 0.2), ("cl_min", -11.0)]
)
def test_limits_of_the_wrong_sign_are_refused(field: str, value: float) -> None:
    """The document names the field."""
    document = json.loads((EXAMPLES / "aircraft.json").read_text(encoding="utf-8"))
    document["surfaces"][1][field] = value
    with pytest.raises(InvalidInput) as refused:
        Document.parse(document)
    assert refused.value.pointer == f"/surfaces/1/{field}"
