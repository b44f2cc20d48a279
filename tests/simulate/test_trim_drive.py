"""Trim by a drive: the pitching moment vanishes, the drive holds the angle found, and speed matters."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

from morphcore.errors import InvalidInput
from morphcore.export.formats import ExportedModel
from morphcore.frames import quaternion_from_euler
from morphcore.identify.cost import costs, sample_cases
from morphcore.models.equivalent import ChainModel, chain_model, physical_guess
from morphcore.models.parameters_document import parameters_document
from morphcore.simulate.common_path import common_path
from morphcore.simulate.flight import Simulation
from morphcore.simulate.plan import flight_plan
from morphcore.simulate.request import simulation_from_document
from morphcore.simulate.schedule import ConstantRate, Hold
from morphcore.simulate.trim import trim, trimmed_state
from morphdata.base import Document
from morphdata.export import ExportRequest
from morphdata.lattice import Lattice
from morphdata.optimize import OptimizeRequest
from morphdata.simulate import SimulateRequest
from tests.models.chains import aircraft_of, flight_of
from tests.oracles.dynamics import bias, mass_matrix
from tests.oracles.fresh import FreshModel
from tests.simulate.flights import fly, fly_free, fly_trimmed, steps
from tests.simulate.tailed_aircraft import FLIGHT, document, rigid

COARSE = Lattice(chordwise=2, spanwise=8)
BY_TAIL = FLIGHT | {"trim_drive": "incidence"}
SPEED = FLIGHT["airspeed_m_s"]


def flown(kind: str, flight: dict[str, Any], schedules: Any = None, **options: Any) -> Simulation:
    """A tenth of a second in one kind of model."""
    aircraft, resolved = aircraft_of(document()), flight_of(flight)
    model: Any = kind
    if kind == "equivalent":
        model = physical_guess(chain_model(aircraft, resolved, 3, COARSE))
    more = {"duration_s": 0.1, "lattice": COARSE, "elements": 4} | options
    return fly(aircraft, resolved, schedules or {}, model=model, **more)


@pytest.mark.parametrize(("kind", "left"), [("rigid", 1e-8), ("flexible", 1e-8), ("equivalent", 0.03)])
def test_the_drive_balances_the_moment(kind: str, left: float) -> None:
    """Of the moment that would be needed without the drive, nothing is left, and trim holds in flight.

    A chain flies at the angle of the rigid model, so that all parameter sets of a batch share a lattice:
    a few per cent are left, as its start reports. The angles are found again among the drives' histories.
    """
    without, found = flown(kind, FLIGHT), flown(kind, BY_TAIL)
    assert abs(found.trim.moment_B[0, 1]) < left * abs(without.trim.moment_B[0, 1])
    assert set(found.trim_drives) == {"incidence_right", "incidence_left"}
    for name, angle in found.trim_drives.items():
        assert -0.06 < angle < -0.005
        np.testing.assert_array_equal(found.trajectory.drives[name], angle)
    assert np.abs(found.trajectory.euler - found.trajectory.euler[0]).max() < 1e-6
    assert not without.trim_drives


def test_a_hinge_held_at_the_angle_found_needs_no_moment() -> None:
    """Without a trim drive, the tail held at the angle found gives the same trim."""
    angle = flown("rigid", BY_TAIL).trim_drives["incidence_left"]
    held, found = flown("rigid", FLIGHT, {"incidence": Hold(angle)}), flown("rigid", BY_TAIL)
    np.testing.assert_allclose(held.trim.moment_B, 0.0, atol=1e-8)
    np.testing.assert_allclose(held.trim.alpha, found.trim.alpha, rtol=0.0, atol=1e-10)
    np.testing.assert_allclose(held.trim.force_B, found.trim.force_B, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("kind", ["rigid", "equivalent", "flexible"])
def test_a_history_of_the_drive_is_an_increment(kind: str) -> None:
    """The drive moves from the angle found by as much as its history moves, wherever that begins."""
    angle = flown(kind, BY_TAIL).trim_drives["incidence_left"]
    answers = []
    for first in (0.0, 0.1):
        schedule = {"incidence": ConstantRate(first, first - 0.05, 0.05, ramp_s=0.02)}
        answer = flown(kind, BY_TAIL, schedule)
        history = answer.trajectory.drives["incidence_left"]
        assert history[0] == pytest.approx(angle, abs=1e-8)
        assert history[-1] == pytest.approx(angle - 0.05, abs=1e-8)
        answers.append(answer.trajectory.euler)
    np.testing.assert_allclose(answers[0], answers[1], rtol=0.0, atol=1e-10)
    assert np.ptp(answers[0][:, 1]) > 1e-3  # the tail pitches the aircraft


def test_one_side_trims_too() -> None:
    """A drive's own name moves that drive alone, by about twice as much; the other side holds."""
    both = flown("rigid", BY_TAIL)
    one = flown("rigid", FLIGHT | {"trim_drive": "incidence_left"})
    assert set(one.trim_drives) == {"incidence_left"}
    assert one.trim_drives["incidence_left"] == pytest.approx(2 * both.trim_drives["incidence_left"], rel=0.1)
    np.testing.assert_array_equal(one.trajectory.drives["incidence_right"], 0.0)
    assert abs(one.trim.moment_B[0, 1]) < 1e-8


def test_half_an_aircraft_trims_like_the_whole() -> None:
    """Halved and whole models have one trim and one flight, within 1e-9 rad, while wings and tail move."""
    model = chain_model(aircraft_of(document()), flight_of(BY_TAIL), 2, COARSE)
    schedules = [ConstantRate(0.0, 0.3 if name.startswith("sweep") else -0.02, 0.3) for name in _names(model)]
    answers = []
    for may_halve in (False, True):
        plan = flight_plan(model, schedules, steps(0.4, 0.005), may_halve=may_halve)
        assert plan.halved is may_halve
        answers.append(fly_trimmed(plan.flown(model), plan, physical_guess(model)).euler)
    np.testing.assert_allclose(answers[1], answers[0], rtol=0.0, atol=1e-9)


def _names(model: ChainModel) -> list[str]:
    return [hinge.drive for hinge in model.aircraft.hinges]


@pytest.mark.parametrize("kind", ["rigid", "flexible"])
def test_a_drive_without_authority_is_refused(kind: str) -> None:
    """A tail that may not turn far enough: the error names the drive and the moment that is left."""
    hinge = document()["surfaces"][2]["hinge"]
    aircraft = aircraft_of(
        _with_hinges(min_rad=-0.005, max_rad=0.005, position_m=hinge["position_m"], axis="y")
    )
    with pytest.raises(InvalidInput) as caught:
        fly(aircraft, flight_of(BY_TAIL), {}, model=kind, duration_s=0.1, lattice=COARSE, elements=2)
    assert caught.value.pointer == "/flight/trim_drive"
    assert "-0.005 rad" in str(caught.value)
    assert "authority" in caught.value.hint


def _with_hinges(**hinge: Any) -> dict[str, Any]:
    changed = document()
    for surface in changed["surfaces"][2:]:
        x, y, z = surface["hinge"]["position_m"]
        surface["hinge"] = hinge | {"position_m": [x, y, z]}
    return changed


def test_a_history_beyond_the_range_from_the_trim_is_refused() -> None:
    """In range by itself, but not from the angle found."""
    for kind in ("rigid", "flexible"):
        with pytest.raises(InvalidInput) as caught:
            flown(kind, BY_TAIL, {"incidence": ConstantRate(0.0, -0.295, 0.05, ramp_s=0.02)})
        assert caught.value.pointer == "/flight/trim_drive"
        assert "-0.3" in str(caught.value)


def test_a_drive_that_the_aircraft_lacks_is_refused() -> None:
    """By every request at the same pointer, with the names there are; by the library too."""
    request = {
        "aircraft": document(), "flight": FLIGHT | {"trim_drive": "elevator"},
        "model": {"kind": "rigid"}, "schedules": {}, "duration_s": 0.2,
    }  # fmt: skip
    with pytest.raises(InvalidInput) as caught:
        SimulateRequest.parse(request)
    assert "/flight/trim_drive" in str(caught.value)
    with pytest.raises(InvalidInput) as caught:
        flown("rigid", FLIGHT | {"trim_drive": "elevator"})
    assert caught.value.pointer == "/flight/trim_drive"
    assert "incidence_left" in caught.value.hint


def test_documents_carry_the_angles() -> None:
    """A result has the angles found; without a trim drive it warns of the moment that nothing supplies."""
    request: Document | dict[str, Any] = {
        "aircraft": document(), "flight": BY_TAIL, "schedules": {}, "duration_s": 0.2,
        "model": {"kind": "rigid", "lattice": {"chordwise": 2, "spanwise": 8}},
    }  # fmt: skip
    result = simulation_from_document(request).result().to_document()
    angle = flown("rigid", BY_TAIL).trim_drives["incidence_left"]
    assert result["trim"]["drives_rad"] == {"incidence_right": angle, "incidence_left": angle}
    assert [warning["code"] for warning in result["warnings"]] == ["apparent_mass_left_out"]
    result = simulation_from_document(request | {"flight": FLIGHT}).result().to_document()
    assert "drives_rad" not in result["trim"]
    assert [warning["code"] for warning in result["warnings"]] == [
        "apparent_mass_left_out",
        "constant_trim_moment",
    ]


def test_exports_carry_the_angles() -> None:
    """The reference trim of an export has the hinges where the trim found them."""
    model = chain_model(aircraft_of(document()), flight_of(BY_TAIL), 2, COARSE)
    known = parameters_document(physical_guess(model)) | {"lattice": COARSE.to_document()}
    request = ExportRequest.parse(
        {"aircraft": document(), "flight": BY_TAIL, "model": {"parameters": known}, "format": "json"}
    )
    table = ExportedModel.of(request).tables["trim"]
    angle = flown("rigid", BY_TAIL).trim_drives["incidence_left"]
    np.testing.assert_allclose(table["hinge_rad"], [0.0, 0.0, angle, angle], rtol=0.0, atol=1e-9)


def test_a_morph_holds_the_trim_drive() -> None:
    """A path of the sweep has the tail at the angle found; a path that moves the tail itself is refused."""
    model = chain_model(aircraft_of(document()), flight_of(BY_TAIL), 1, COARSE)
    sweeps = ("sweep_right", "sweep_left")
    path = common_path(model, 0.0, 0.3, drives=sweeps, may_halve=True)
    schedule = ConstantRate(0.0, 0.3, 0.2)
    grid = steps(0.3, 0.005)
    shared = path.plan(model, schedule, grid)
    alone = flight_plan(model, [schedule, schedule, Hold(), Hold()], grid, may_halve=True)
    np.testing.assert_array_equal(shared.angles, alone.angles)
    batch = physical_guess(model)
    flights = [fly_trimmed(plan.flown(model), plan, batch).euler for plan in (shared, alone)]
    np.testing.assert_allclose(*flights, rtol=0.0, atol=1e-6)  # lattices interpolated between other nodes
    with pytest.raises(InvalidInput) as caught:
        common_path(model, 0.0, 0.3, drives=("incidence_right", "incidence_left"))
    assert caught.value.pointer == "/flight/trim_drive"


def test_an_optimisation_of_the_trim_drive_is_refused() -> None:
    """Its request says that the drive cannot both trim and morph."""
    model = chain_model(aircraft_of(document()), flight_of(BY_TAIL), 2, COARSE)
    request = {
        "aircraft": document(), "flight": BY_TAIL,
        "model": {"parameters": parameters_document(physical_guess(model))},
        "morph": {"drive": "incidence", "final_rad": 0.1, "duration_s": 0.5},
    }  # fmt: skip
    with pytest.raises(InvalidInput) as caught:
        OptimizeRequest.parse(request)
    assert "/flight/trim_drive" in str(caught.value)
    request["morph"]["drive"] = "sweep"
    OptimizeRequest.parse(request)


def longitudinal(model: ChainModel, start: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Matrix (4, 4) of small departures of u, w, q and theta from trim, and the trimmed values.

    Independent of the lanes: a lattice anew in each state, on the tree with the dense dynamics. Its tail is
    turned by the secant method until trim needs no moment. Derivatives are central differences.
    """
    fresh = FreshModel(model, physical_guess(model))

    def trimmed(angle: float) -> Any:
        return fresh.trimmed(np.array([0.0, 0.0, angle, angle]))

    low, high = start[2], start[2] + 0.01
    for _ in range(8):
        moments = [trimmed(angle)[0].moment_B[1] for angle in (low, high)]
        if abs(moments[1]) < 1e-9:
            break
        low, high = high, high - moments[1] * (high - low) / (moments[1] - moments[0])
    found, state = trimmed(high)
    hinges = np.stack([[0.0, 0.0, high, high], np.zeros(4), np.zeros(4)], axis=1)

    def rates(x: np.ndarray) -> np.ndarray:
        u, w, q, theta = x
        moved = replace(
            state,
            quaternion=quaternion_from_euler(0.0, theta, 0.0),
            twist_B=np.array([0.0, q, 0.0, u, 0.0, w]),
        )
        motion = fresh.motion(moved, hinges)
        loads = fresh.loads(motion, None)
        loads.wrench[0] += np.concatenate([found.moment_B, found.force_B])
        h = bias(fresh.tree, motion, loads.wrench, np.array([0.0, 0.0, 9.81]))
        a = np.linalg.solve(mass_matrix(fresh.tree, motion), -h)
        return np.array([a[3], a[5], a[1], q])

    at = np.array([SPEED * np.cos(found.alpha), SPEED * np.sin(found.alpha), 0.0, found.alpha])
    probes = 1e-4 * np.eye(4)
    return np.stack([(rates(at + p) - rates(at - p)) / 2e-4 for p in probes], axis=1), at


def crossings(time_s: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Times at which values change sign, interpolated."""
    k = np.flatnonzero(values[:-1] * values[1:] < 0.0)
    return time_s[k] + (time_s[k + 1] - time_s[k]) * values[k] / (values[k] - values[k + 1])


def test_a_tailed_aircraft_has_a_phugoid() -> None:
    """One per cent too fast, it swings as an independent longitudinal integration says; no moment helps it.

    The period is 11.7 s in flight, within 1 per cent of the integration. With a constant trim moment instead,
    which does not grow with speed, there is no phugoid: the flight does not swing back in the same time.
    """
    aircraft, grid = rigid(aircraft_of(document())), steps(30.0, 0.01)
    speeds = {}
    for name in ("incidence", None):
        model = chain_model(aircraft, flight_of(FLIGHT | {"trim_drive": name}), 1, COARSE)
        batch, plan = physical_guess(model), flight_plan(model, [Hold()] * 4, grid)
        found = trim(model, batch, plan).require()
        state = trimmed_state(model, batch, plan, found)
        state[0, 7:10] *= 1.01
        flight = fly_free(model, plan, batch, state, force_B=found.force_B, moment_B=found.moment_B)
        speeds[name] = np.linalg.norm(flight.states[:, 0, 7:10], axis=1) - SPEED
        if name is not None:
            matrix, at = longitudinal(model, plan.angles[0])
    step, x, linear = expm(0.01 * matrix), 0.01 * np.array([at[0], at[1], 0.0, 0.0]), []
    for _ in grid.times_s:
        linear.append((at[0] * x[0] + at[1] * x[1]) / SPEED)
        x = step @ x
    own, wanted = (crossings(grid.times_s, np.asarray(v)) for v in (speeds["incidence"], linear))
    assert own.size == wanted.size == 5
    assert 2.0 * np.diff(own).mean() == pytest.approx(2.0 * np.diff(wanted).mean(), rel=0.01)
    np.testing.assert_allclose(own, wanted, rtol=0.015)
    assert crossings(grid.times_s, speeds[None]).size < 3


def test_a_tailed_aircraft_has_a_short_period() -> None:
    """A pitch rate decays as the independent integration says, within half a per cent (asked: 3).

    Eigenvalues -11.9 +- 7.6 rad/s. Its derivatives are of steady flow, so the flight is one without lag.
    """
    aircraft, grid = rigid(aircraft_of(document())), steps(1.5, 0.005)
    model = chain_model(aircraft, flight_of(BY_TAIL), 1, COARSE)
    batch = physical_guess(model).changed(lag_s=np.zeros(1))
    plan = flight_plan(model, [Hold()] * 4, grid)
    found = trim(model, batch, plan).require()
    state = trimmed_state(model, batch, plan, found)
    state[0, 5] += 0.02
    flight = fly_free(model, plan, batch, state, force_B=found.force_B, moment_B=found.moment_B)
    matrix, _ = longitudinal(model, plan.angles[0])
    step, x, rates = expm(0.005 * matrix), np.array([0.0, 0.0, 0.02, 0.0]), []
    for _ in range(flight.states.shape[0]):
        rates.append(x[2])
        x = step @ x
    error = flight.states[:, 0, 5] - rates
    assert np.sqrt(np.mean(error**2)) < 0.005 * np.sqrt(np.mean(np.square(rates)))


def test_a_sample_of_such_a_flight_is_flown_again() -> None:
    """The recorded flight as a sample, tail column and all: the model that flew it has no cost.

    The tail's column counts from its first value, which is the angle found; without the trim drive, the same
    column is an angle, and the moment that is left makes no difference either.
    """
    aircraft, flight = aircraft_of(document()), flight_of(BY_TAIL)
    model = chain_model(aircraft, flight, 3, COARSE)
    guess = physical_guess(model)
    schedules = {"sweep": ConstantRate(0.0, 0.3, 0.4), "incidence": ConstantRate(0.0, -0.02, 0.3)}
    more = {"duration_s": 0.6, "lattice": COARSE, "step_s": 0.005}
    sample = fly(aircraft, flight, schedules, model=guess, **more).trajectory
    for resolved in (flight, flight_of(FLIGHT)):
        again = chain_model(aircraft, resolved, 3, COARSE)
        (case,) = sample_cases(again, [sample], 0.005)
        assert float(costs(again, guess, [case], "trim")[0]) < 1e-9 * sample.time_s.size
