"""Steady flight beyond level: climbs, turns, sideslips and given rates, in all three kinds of model."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from morphcore.errors import InvalidInput, TrimNotFound
from morphcore.frames import euler_rates, quaternion_from_euler, rotation_from_quaternion
from morphcore.geometry.aircraft import Flight
from morphcore.models.equivalent import chain_model, physical_guess
from morphcore.simulate.flight import Simulation
from morphcore.simulate.plan import flight_plan
from morphcore.simulate.schedule import ConstantRate, Hold
from morphcore.simulate.steady import air_velocity_B, pitch, rates_B
from morphdata.lattice import Lattice
from tests.models.chains import aircraft_of, example_aircraft, flight_of
from tests.oracles.dynamics import bias
from tests.oracles.fresh import FreshModel, FreshState
from tests.simulate.flights import fly, fly_trimmed, steps
from tests.simulate.tailed_aircraft import FLIGHT, document, rigid
from tests.simulate.test_trim_by_elevator import with_elevator

COARSE = Lattice(chordwise=2, spanwise=8)
KINDS = ("rigid", "equivalent", "flexible")
V, G = FLIGHT["airspeed_m_s"], FLIGHT["gravity_m_s2"]
EXAMPLE = {"airspeed_m_s": 150.0, "air_density_kg_m3": 1.225, "gravity_m_s2": 9.81}
AILERON = {"name": "aileron", "from": 0.6, "to": 0.95, "chord_fraction": 0.25, "mirror": "antisymmetric"}
RUDDER = {"name": "rudder", "from": 0.0, "to": 1.0, "chord_fraction": 0.4}


def finned() -> dict[str, Any]:
    """The aircraft with an elevator, dihedral, ailerons, and a fin with a rudder."""
    changed = with_elevator()
    fin = {
        **changed["surfaces"][2], "name": "fin", "dihedral_rad": 0.5 * np.pi, "span_m": 0.3,
        "position_m": [-1.0, 0.0, -0.05], "controls": [RUDDER],
    }  # fmt: skip
    for wing in changed["surfaces"][:2]:
        wing |= {"dihedral_rad": 0.08, "controls": [AILERON]}
    changed["surfaces"].append(fin)
    return changed


def flown(kind: str, more: dict[str, Any], schedules: Any = None, **options: Any) -> Simulation:
    """A flight of the aircraft with a fin, or of another ``aircraft``, in one kind of model."""
    aircraft = options.pop("aircraft", None) or aircraft_of(finned())
    flight = more.get("flight") or flight_of(FLIGHT | more)
    model: Any = kind
    if kind == "equivalent":
        model = physical_guess(chain_model(aircraft, flight, 3, COARSE))
    known = {"duration_s": 0.04, "lattice": COARSE, "elements": 4, "output_step_s": 0.02} | options
    return fly(aircraft, flight, schedules or {}, model=model, **known)


@pytest.mark.parametrize("bank", [0.0, 0.4, -1.2])
def test_the_kinematics_are_those_of_the_path(bank: float) -> None:
    """The path climbs as asked, and only the heading changes, by the turn rate."""
    flight = flight_of(FLIGHT | {"climb_rad": 0.3, "sideslip_rad": -0.2, "turn_rate_rad_s": 0.4})
    alpha, phi = np.array([0.1, -0.05]), np.array([bank, bank])
    theta = pitch(flight, alpha, phi)
    R_NB = rotation_from_quaternion(quaternion_from_euler(phi, theta, 0.0 * phi))
    path_N = np.einsum("kij,kj->ki", R_NB, air_velocity_B(flight, alpha))
    np.testing.assert_allclose(path_N[:, 2], -V * np.sin(0.3), rtol=1e-13)
    np.testing.assert_allclose(np.linalg.norm(path_N, axis=1), V, rtol=1e-13)
    rates = euler_rates(np.stack([phi, theta, 0.0 * phi], axis=1), rates_B(flight, theta, phi))
    np.testing.assert_allclose(rates, [[0.0, 0.0, 0.4]] * 2, atol=1e-14)


STEADY = {
    "climb": {"climb_rad": 0.15},
    "turn": {"turn_rate_rad_s": 0.3},
    "sideslip": {"sideslip_rad": 0.05},
    "all in wind": {"turn_rate_rad_s": -0.5, "climb_rad": -0.1, "sideslip_rad": 0.03}
    | {"wind_n_m_s": [3.0, 2.0, -1.0], "apparent_mass": True},
}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", STEADY)
def test_a_trimmed_flight_stays_steady(kind: str, name: str) -> None:
    """Three seconds later rates, airspeed, and angles of the stream are what they were, and so is the turn.

    What is left of a turn in a chain is the step's error in the attitude.
    """
    more = STEADY[name] | {"trim_drive": "elevator"}
    channels = ["p", "q", "r", "airspeed", "alpha", "beta", "vz"]
    options = {"duration_s": 3.0, "output_step_s": 0.1, "channels": channels}
    found = flown(kind, more, **options).trajectory
    turn = more.get("turn_rate_rad_s", 0.0)
    drift = {column: float(np.abs(values - values[0]).max()) for column, values in found.extra.items()}
    assert max(drift.values()) < 1e-5, drift
    assert max(np.ptp(found.phi), np.ptp(found.theta)) < 1e-6
    np.testing.assert_allclose(np.unwrap(found.psi) - found.psi[0], turn * found.time_s, atol=2e-6)
    np.testing.assert_allclose(found.extra["beta"], more.get("sideslip_rad", 0.0), atol=1e-6)
    sink = -V * np.sin(more.get("climb_rad", 0.0)) + more.get("wind_n_m_s", [0.0, 0.0, 0.0])[2]
    np.testing.assert_allclose(found.extra["vz"], sink, atol=2e-5)


@pytest.mark.parametrize("kind", ["rigid", "flexible"])
def test_a_climb_takes_the_thrust_of_drag_and_weight(kind: str) -> None:
    """T = D + W sin(climb): with the same lift, W cos(climb), in level flight of less weight.

    The wings are rigid: bent ones would feel the weight's part along the chord.
    """
    aircraft, climb = rigid(aircraft_of(document())), 0.3
    climbing = flown(kind, {"climb_rad": climb}, aircraft=aircraft).trim
    lighter = flown(kind, {"gravity_m_s2": G * np.cos(climb)}, aircraft=aircraft).trim
    weight = G * (aircraft.fuselage.mass_kg + _mass_of_wings())
    np.testing.assert_allclose(climbing.alpha, lighter.alpha, rtol=0.0, atol=1e-10)
    along = [float(np.linalg.norm(each.force_B[0])) for each in (climbing, lighter)]
    assert along[0] - along[1] == pytest.approx(weight * np.sin(climb), rel=1e-7)


def _mass_of_wings() -> float:
    surfaces = document()["surfaces"]
    return sum(
        s["span_m"] * s["chord_m"] * s["thickness_m"] * s["material"]["density_kg_m3"] for s in surfaces
    )


@pytest.mark.parametrize("kind", KINDS)
def test_a_coordinated_turn_banks_by_theory(kind: str) -> None:
    """The bank about the path has the tangent V turn / g, and the lift cos(climb) / cos(bank) of the weight.

    The specific force is that of g and the acceleration V turn cos(climb) towards the centre of the circle. A
    flat wing has hardly any side force, bent ones have some by the rates of roll and yaw.
    """
    near = 1e-4 if kind == "rigid" else 3e-3
    turn, climb = 0.08, 0.1
    flight = flight_of(EXAMPLE | {"turn_rate_rad_s": turn, "climb_rad": climb})
    options = {"channels": ["nx", "ny", "nz", "alpha"], "aircraft": example_aircraft()}
    found = flown(kind, {"flight": flight}, **options)
    bank, alpha = found.trim.bank[0], found.trim.alpha[0]
    theta = found.trajectory.theta[0]
    # bank about the flight path: of y of B, which is level in it, against the vertical
    about_path = np.arcsin(np.sin(bank) * np.cos(theta) / np.cos(climb))
    assert np.tan(about_path) == pytest.approx(150.0 * turn / 9.81, rel=near)
    load = np.array([found.trajectory.extra[name][0] for name in ("nx", "ny", "nz")])
    np.testing.assert_allclose(load @ load, 1.0 + (150.0 * turn * np.cos(climb) / 9.81) ** 2, rtol=1e-6)
    lift = load[2] * np.cos(alpha) + load[0] * np.sin(alpha)
    assert lift == pytest.approx(np.cos(climb) / np.cos(about_path), rel=near)
    assert abs(load[1]) < near * lift
    assert flight.load_factor == pytest.approx(lift, rel=near)


@pytest.mark.parametrize(
    ("more", "left"),
    [({"sideslip_rad": 0.06}, 0.01), ({"turn_rate_rad_s": 0.3}, 0.015), ({"climb_rad": 0.2}, 1e-4)],
)
def test_a_fresh_lattice_needs_the_same_forces(more: dict[str, Any], left: float) -> None:
    """An independent sum: lattice and wake anew in the trimmed motion, all edges, on the tree.

    Of moments, shares of the largest; of a turn the rate of pitch leaves more in the drag.
    """
    aircraft, flight = rigid(aircraft_of(document())), flight_of(FLIGHT | more)
    found = flown("rigid", more, aircraft=aircraft).trim
    model = chain_model(aircraft, flight, 1, COARSE)
    force, moment = _required(FreshModel(model, physical_guess(model)), flight, found)
    np.testing.assert_allclose(found.force_B[0], force, atol=left * np.linalg.norm(force))
    np.testing.assert_allclose(found.moment_B[0], moment, atol=left * np.linalg.norm(moment))


def _required(fresh: FreshModel, flight: Flight, found: Any) -> tuple[np.ndarray, np.ndarray]:
    """Constant force and moment that the motion of a trim needs."""
    alpha, bank = found.alpha[0], found.bank[0]
    theta = pitch(flight, np.array(alpha), np.array(bank))
    twist = np.concatenate([rates_B(flight, theta, np.array(bank)), air_velocity_B(flight, np.array(alpha))])
    nothing, lag = np.zeros(0), np.zeros((2, fresh.model.lattice.table.rings))
    state = FreshState(quaternion_from_euler(bank, theta, 0.0), twist, np.zeros(3), nothing, nothing, lag)
    motion = fresh.motion(state, np.zeros((len(fresh.model.aircraft.hinges), 3)))
    gravity_N = np.array([0.0, 0.0, flight.gravity_m_s2])
    required = bias(fresh.tree, motion, fresh.loads(motion, None).wrench, gravity_N)
    return required[3:6], required[:3]


def test_a_sideslip_agrees_with_the_lateral_derivatives() -> None:
    """Moments, controls' angles and bank of a sideslip are those of the lattice's slopes about none."""
    probe, sideslip = 2e-3, 0.05
    constant = {"roll_trim_drive": "none", "yaw_trim_drive": "none"}
    near, far = (flown("rigid", {"sideslip_rad": x} | constant).trim for x in (probe, sideslip))
    for axis in (0, 2):
        assert far.moment_B[0, axis] == pytest.approx(near.moment_B[0, axis] * sideslip / probe, rel=0.02)
    assert far.bank[0] == pytest.approx(near.bank[0] * sideslip / probe, rel=0.02)
    # dihedral effect and weathercock stability: moments that hold the sideslip to the right
    assert far.moment_B[0, 0] > 0.0 > far.moment_B[0, 2]
    assert far.bank[0] > 0.0
    held = flown("rigid", {"sideslip_rad": sideslip})
    slopes = {}
    for drive in ("aileron", "rudder"):
        moved = flown("rigid", {"sideslip_rad": sideslip} | constant, {drive: Hold(0.01)}).trim
        slopes[drive] = (moved.moment_B[0] - far.moment_B[0]) / 0.01
    left = far.moment_B[0].copy()
    for drive, name in (("aileron", "aileron_right"), ("rudder", "rudder")):
        left += slopes[drive] * held.trim_drives[name]
    assert np.abs(left[[0, 2]]).max() < 0.02 * np.abs(far.moment_B[0]).max()
    assert np.abs(held.trim.moment_B[0, [0, 2]]).max() < 1e-6


@pytest.mark.parametrize("kind", KINDS)
def test_mirrored_flights_are_mirrored(kind: str) -> None:
    """A turn to the left while slipping is the mirror image of one to the right, wings sweeping in both."""
    morph = {"sweep": ConstantRate(0.0, 0.2, 0.6)}
    right, left = (
        flown(kind, {"turn_rate_rad_s": side * 0.3, "sideslip_rad": side * 0.04}, morph, duration_s=0.4)
        for side in (1.0, -1.0)
    )
    assert right.trim.bank[0] > 0.3
    for name, sign in (("phi", 1.0), ("theta", -1.0), ("psi", 1.0)):
        one, other = (getattr(each.trajectory, name) for each in (right, left))
        assert np.abs(one + sign * other).max() < 1e-9, name
    for drive in ("aileron_left", "rudder"):
        assert right.trim_drives[drive] == pytest.approx(-left.trim_drives[drive], abs=1e-9)


def test_rigid_and_flexible_models_agree() -> None:
    """An all-rigid aircraft: angles, forces and moments of both lattices within 0.2 per cent of the largest.

    The drag of a turn differs by 1.5 per cent: the rate of pitch, which the reduced lattice distributes along
    the chord as it does uniform incidence.
    """
    aircraft = rigid(aircraft_of(finned()))
    for more, drag in (({"sideslip_rad": 0.05}, 0.002), ({"turn_rate_rad_s": 0.3}, 0.015)):
        constant = more | {"roll_trim_drive": "none", "yaw_trim_drive": "none"}
        one, other = (
            flown(kind, constant, aircraft=aircraft, elements=1).trim for kind in ("rigid", "flexible")
        )
        np.testing.assert_allclose([one.alpha, one.bank], [other.alpha, other.bank], rtol=2e-3, atol=2e-5)
        np.testing.assert_allclose(one.force_B, other.force_B, atol=drag * np.linalg.norm(other.force_B))
        np.testing.assert_allclose(one.moment_B, other.moment_B, atol=2e-3 * np.linalg.norm(other.moment_B))


def test_the_aircrafts_own_controls_balance_an_asymmetric_flight() -> None:
    """Ailerons and rudder are found; in level flight they stay; "none" and other names are obeyed."""
    found = flown("rigid", {"sideslip_rad": 0.05})
    assert set(found.trim_drives) == {"aileron_right", "aileron_left", "rudder"}
    assert found.trim_drives["aileron_right"] == found.trim_drives["aileron_left"]
    assert not flown("rigid", {}).trim_drives
    told = [w.message for w in found.warnings if w.code == "constant_trim_moment"]
    assert len(told) == 1, "of the pitching moment alone: no trim_drive is named"
    only = flown("rigid", {"sideslip_rad": 0.05, "roll_trim_drive": "none"})
    assert set(only.trim_drives) == {"rudder"}
    told = [w for w in only.warnings if w.code == "constant_trim_moment" and "rolling" in w.message]
    assert len(told) == 1
    assert "roll_trim_drive" in told[0].hint
    named = flown("rigid", {"yaw_trim_drive": "rudder", "roll_trim_drive": "aileron"})
    assert set(named.trim_drives) == {"aileron_right", "aileron_left", "rudder"}
    assert max(map(abs, named.trim_drives.values())) < 1e-9


def test_a_fin_beyond_its_stall_is_told() -> None:
    """The sideslip is the angle of attack of a fin."""
    codes = [
        {warning.code for warning in flown("rigid", {"sideslip_rad": sideslip}).warnings}
        for sideslip in (0.25, -0.3)
    ]
    assert "large_alpha" not in codes[0]
    assert "large_alpha" in codes[1]


def test_a_history_of_a_control_counts_from_its_trim() -> None:
    """As that of the elevator does, in all models alike."""
    for kind in ("rigid", "flexible"):
        held = flown(kind, {"turn_rate_rad_s": 0.2}).trim_drives["rudder"]
        moved = flown(
            kind, {"turn_rate_rad_s": 0.2}, {"rudder": ConstantRate(0.1, 0.05, 0.2)}, duration_s=0.4
        ).trajectory
        np.testing.assert_allclose(moved.drives["rudder"][[0, -1]], [held, held - 0.05], atol=1e-8)


@pytest.mark.parametrize("kind", ["rigid", "flexible"])
def test_a_control_without_authority_is_refused(kind: str) -> None:
    """The error has the field, the angle and the moment that is left, and offers the constant moment."""
    short = finned()
    short["surfaces"][4]["controls"] = [RUDDER | {"min_rad": -0.01, "max_rad": 0.01}]
    with pytest.raises(InvalidInput) as caught:
        flown(kind, {"sideslip_rad": 0.1}, aircraft=aircraft_of(short))
    assert caught.value.pointer == "/flight/yaw_trim_drive"
    assert "yawing moment: at -0.01 rad" in str(caught.value)
    assert '"none"' in caught.value.hint


@pytest.mark.parametrize("kind", KINDS)
def test_a_flight_beyond_the_wings_says_so(kind: str) -> None:
    """The error has what was asked for, the residual, the angle of attack and the lift that is missing."""
    with pytest.raises(TrimNotFound) as caught:
        flown(kind, {"airspeed_m_s": 3.0, "turn_rate_rad_s": 1.0})
    said = str(caught.value)
    for part in ("a turn of 1 rad/s", "residual", "stall", "1.05 times its weight"):
        assert part in said
    assert caught.value.pointer == "/flight/airspeed_m_s"


def test_symmetric_flights_are_flown_by_halves() -> None:
    """A climb and a pull-up are, as the whole flies; a turn, a sideslip and a roll are flown whole."""
    aircraft = aircraft_of(with_elevator())
    for more, halved in (
        ({"climb_rad": 0.2}, True),
        ({"rates_rad_s": [0.0, 0.2, 0.0], "climb_rad": 0.1}, True),
        ({"turn_rate_rad_s": 0.1}, False),
        ({"sideslip_rad": 0.01}, False),
        ({"rates_rad_s": [0.1, 0.0, 0.0]}, False),
        ({"roll_trim_drive": "elevator_left"}, False),
    ):
        model = chain_model(aircraft, flight_of(FLIGHT | more), 2, COARSE)
        schedules = [ConstantRate(0.0, 0.3, 0.6)] * 2 + [Hold()] * 2
        plan = flight_plan(model, schedules, steps(0.3, 0.005), may_halve=True)
        assert plan.halved is halved, more
        if halved:
            whole = flight_plan(model, schedules, steps(0.3, 0.005))
            batch = physical_guess(model)
            answers = [fly_trimmed(each.flown(model), each, batch).euler for each in (plan, whole)]
            np.testing.assert_allclose(*answers, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_given_rates_are_steady_at_the_start(kind: str) -> None:
    """A pull-up needs the lift 1 + q V / g, and a roll begins without acceleration: second differences."""
    pull = 0.3
    found = flown(kind, {"rates_rad_s": [0.0, pull, 0.0]}, channels=["nz", "nx", "q", "alpha"])
    lift = found.trajectory.extra["nz"] * np.cos(found.trim.alpha[0])
    lift += found.trajectory.extra["nx"] * np.sin(found.trim.alpha[0])
    assert lift[0] == pytest.approx(1.0 + pull * V / G, rel=1e-3)
    roll = flown(
        kind, {"rates_rad_s": [0.5, 0.0, 0.0]}, channels=["p", "q", "r", "beta"], output_step_s=0.002
    )
    columns = roll.trajectory.extra
    assert columns["p"][0] == pytest.approx(0.5, abs=1e-12)
    for name, values in columns.items():
        assert abs(values[1] - values[0]) < 0.2 * np.ptp(values), name
    assert roll.trim_drives["aileron_right"] < -0.01


@pytest.mark.parametrize("kind", KINDS)
def test_a_given_start_repeats_a_turn(kind: str) -> None:
    """The start that a trim has found, given as the flight's own, is steady too.

    Its wake leaves at the given angle of attack; that of a chain's trim at the rigid model's.
    """
    constant = {"roll_trim_drive": "none", "yaw_trim_drive": "none", "turn_rate_rad_s": 0.3, "climb_rad": 0.1}
    found = flown(kind, constant).trim
    start = {
        "alpha_rad": found.alpha[0],
        "bank_rad": found.bank[0],
        "force_b_n": found.force_B[0].tolist(),
        "moment_b_n_m": found.moment_B[0].tolist(),
    }
    options = {"start": "given", "duration_s": 1.0, "output_step_s": 0.1, "channels": ["p", "q", "r", "beta"]}
    again = flown(kind, constant | {"start": start}, **options)
    for name, values in again.trajectory.extra.items():
        assert np.ptp(values) < (2e-5 if kind == "equivalent" else 1e-6), name
    np.testing.assert_allclose(again.trim.bank, found.bank)


def test_what_bending_takes_from_ailerons_is_told() -> None:
    """An equivalent model has the rigid model's aileron: on soft wings a constant moment does the rest."""
    soft = finned()
    for wing in soft["surfaces"][:2]:
        wing["material"] = {**wing["material"], "youngs_modulus_pa": 3e7}
    found = flown("equivalent", {"sideslip_rad": 0.1}, aircraft=aircraft_of(soft))
    told = [w for w in found.warnings if w.code == "constant_trim_moment" and "rolling" in w.message]
    assert len(told) == 1
    assert "flexible model" in told[0].hint
    assert abs(found.trim.moment_B[0, 0]) > 1.0
    exact = flown("flexible", {"sideslip_rad": 0.1}, aircraft=aircraft_of(soft))
    assert abs(exact.trim.moment_B[0, 0]) < 1e-6
    assert abs(exact.trim_drives["aileron_left"]) > 1.5 * abs(found.trim_drives["aileron_left"])
