"""One flight with `simulate`: kinematics, symmetry, limits, files, refusals."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from morphcore.errors import FlightDiverged, InvalidInput, TrimNotFound
from morphcore.frames import euler_rates
from morphcore.geometry.aircraft import Aircraft, Flight
from morphcore.models.equivalent import ParameterBatch, chain_model, physical_guess
from morphcore.models.kinematics import tip_positions
from morphcore.simulate.flight import write_trajectory_csv
from morphcore.simulate.plan import flight_plan
from morphcore.simulate.schedule import ConstantRate, Hold, Schedule, Tabulated
from morphcore.simulate.time_grid import time_grid
from morphcore.simulate.trajectory import Trajectory, load_trajectory
from morphdata.aircraft import load_aircraft
from morphdata.environment import Environment, Gust, Turbulence
from morphdata.flight import load_flight
from morphdata.lattice import Lattice
from tests.simulate.flights import fly

SAMPLES = ("train_rate_0.2", "train_rate_0.5", "train_rate_0.8", "train_asymmetric")
COARSE = Lattice(chordwise=2, spanwise=6)
EASY = {
    "duration_s": 1.0,
    "lattice": COARSE,
}  # a short flight over a coarse lattice: the laws do not need more
MORPH = ConstantRate(0.0, 0.5, 0.8, start_s=0.1)


@pytest.fixture(scope="module")
def aircraft(examples: Path) -> Aircraft:
    """The example aircraft."""
    return Aircraft.of(load_aircraft(examples / "aircraft.json"))


@pytest.fixture(scope="module")
def flight(examples: Path) -> Flight:
    """The example flight condition."""
    return Flight.of(load_flight(examples / "flight.json"))


@pytest.fixture(scope="module")
def guess(aircraft: Aircraft, flight: Flight) -> ParameterBatch:
    """Three links a wing, from beam theory."""
    return physical_guess(chain_model(aircraft, flight, 3, COARSE))


def _history(trajectory: Trajectory, *names: str) -> NDArray[np.float64]:
    return np.stack([trajectory.extra[name] for name in names], axis=1)


def test_a_trimmed_aircraft_with_its_wings_at_rest_flies_on(
    aircraft: Aircraft, flight: Flight, guess: ParameterBatch
) -> None:
    """Nothing changes but the place; the tips stay where static equilibrium has them.

    Tolerance: Newton's iteration ends at 1e-11 rad, and an aircraft without a tail leaves its trim by itself.
    """
    flown = fly(aircraft, flight, [Hold(), Hold()], model=guess, **EASY).trajectory
    np.testing.assert_allclose(flown.euler, np.tile(flown.euler[0], (flown.time_s.size, 1)), atol=1e-8)
    np.testing.assert_allclose(flown.extra["x"], flight.airspeed_m_s * flown.time_s, rtol=1e-9, atol=1e-9)
    assert np.ptp(flown.extra["tip_left_z"]) < 1e-8
    assert np.all(flown.extra["tip_left_z"] < -0.05), "the wing bends up"


@pytest.mark.parametrize("name", SAMPLES)
def test_channels_agree_with_one_another(
    examples: Path, aircraft: Aircraft, flight: Flight, guess: ParameterBatch, name: str
) -> None:
    """Velocity is the rate of place, and body rates those of the Euler angles, by differences of the rows.

    Central differences over 10 ms rows err by h^2/6 of the third derivative: 1e-3 of the largest rate here.
    """
    sample = load_trajectory(examples / f"{name}.csv")
    flown = fly(aircraft, flight, sample, model=guess, lattice=COARSE).trajectory
    np.testing.assert_allclose(flown.time_s, sample.time_s, atol=1e-12)
    np.testing.assert_allclose(flown.sweep_left, sample.sweep_left, atol=1e-12)
    np.testing.assert_allclose(flown.sweep_right, sample.sweep_right, atol=1e-12)

    def differences(values: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray((values[2:] - values[:-2]) / (2 * 0.01))

    velocity = _history(flown, "vx", "vy", "vz")
    np.testing.assert_allclose(differences(_history(flown, "x", "y", "z")), velocity[1:-1], atol=5e-2)
    rates = euler_rates(flown.euler, _history(flown, "p", "q", "r"))
    np.testing.assert_allclose(differences(flown.euler), rates[1:-1], atol=4e-3)


def test_tips_are_where_the_links_put_them(aircraft: Aircraft, flight: Flight, guess: ParameterBatch) -> None:
    """Tip columns against the poses of all links at the hinge angles themselves."""
    flown = fly(aircraft, flight, [ConstantRate(0.6, 0.9, 0.8), Hold(0.3)], model=guess, **EASY)
    chain = chain_model(aircraft, flight, 3, COARSE)
    plan = flight_plan(chain, [Hold(0.6), Hold(0.3)], time_grid([0.0, 0.01, 0.02]))
    tips_B = tip_positions(chain, guess, plan.hinges[0], flown.trim.q_joint)[0]
    assert flown.trajectory.extra["tip_right_z"][0] == pytest.approx(tips_B[0, 2], abs=1e-12)
    assert flown.trajectory.extra["tip_left_z"][0] == pytest.approx(tips_B[1, 2], abs=1e-12)
    rigid = fly(aircraft, flight, [ConstantRate(0.6, 0.9, 0.8), Hold(0.3)], **EASY).trajectory
    assert np.all(rigid.extra["tip_right_z"] == 0.0), "a rigid wing sweeps in its plane"


def test_mirrored_morph_gives_mirrored_flight(
    aircraft: Aircraft, flight: Flight, guess: ParameterBatch
) -> None:
    """Left and right exchanged: roll and yaw change their sign, pitch does not, to round-off.

    Tolerance: round-off of 1e-16 grows with the unstable roll and yaw of a tailless aircraft.
    """
    one = fly(aircraft, flight, {"right": MORPH, "left": Hold()}, model=guess, **EASY).trajectory
    other = fly(aircraft, flight, {"right": Hold(), "left": MORPH}, model=guess, **EASY).trajectory
    assert np.abs(one.phi).max() > 0.01, "the morph rolls the aircraft"
    np.testing.assert_allclose(other.euler, one.euler * [-1.0, 1.0, -1.0], atol=1e-9)
    np.testing.assert_allclose(other.extra["tip_left_z"], one.extra["tip_right_z"], atol=1e-9)


def test_stiff_joints_tend_to_the_rigid_model(
    aircraft: Aircraft, flight: Flight, guess: ParameterBatch
) -> None:
    """Joints a million times stiffer bend a million times less: the flight is the rigid model's.

    Without profile drag: that acts at the middle of each link, and a rigid wing is one long link.
    """
    equal = np.full_like(guess["division"], 1.0 / 3.0)  # of whole strips of the lattice
    guess = guess.changed(profile_drag=np.zeros((1, 1)), division=equal)
    one_link = physical_guess(chain_model(aircraft, flight, 1, COARSE))
    stiff = guess.changed(
        stiffness_nm_rad=1e6 * guess["stiffness_nm_rad"], damping_nms_rad=1e6 * guess["damping_nms_rad"]
    )
    schedules = [MORPH, Hold()]
    rigid = fly(
        aircraft, flight, schedules, model=one_link.changed(profile_drag=np.zeros((1, 1))), **EASY
    ).trajectory
    almost = fly(aircraft, flight, schedules, model=stiff, **EASY).trajectory
    soft = fly(aircraft, flight, schedules, model=guess, **EASY).trajectory
    np.testing.assert_allclose(almost.euler, rigid.euler, atol=1e-6)
    assert np.abs(soft.euler - rigid.euler).max() > 1e-3


def test_steady_wind_only_carries_the_flight_along(
    aircraft: Aircraft, flight: Flight, guess: ParameterBatch
) -> None:
    """Galileo: in a uniform wind the attitude is the same and the place differs by wind times time.

    Tolerance: the state holds velocities against the ground, whose step error differs, far below 1e-5.
    """
    wind = np.array([5.0, -3.0, 1.0])
    still = fly(aircraft, flight, [MORPH, MORPH], model=guess, **EASY).trajectory
    windy = fly(aircraft, replace(flight, wind_N=wind), [MORPH, MORPH], model=guess, **EASY).trajectory
    np.testing.assert_allclose(windy.euler, still.euler, atol=1e-7)
    drift = _history(windy, "x", "y", "z") - _history(still, "x", "y", "z")
    np.testing.assert_allclose(drift, still.time_s[:, None] * wind, atol=2e-5)


def test_gusts_and_turbulence_move_the_aircraft(aircraft: Aircraft, flight: Flight) -> None:
    """An upward gust lifts it; turbulence needs a generator, and the same seed gives the same flight."""
    hold = [Hold(), Hold()]
    gust = Environment(gust=Gust(amplitude_m_s=5.0, gradient_m=30.0, start_s=0.2))
    calm = fly(aircraft, flight, hold, **EASY).trajectory
    lifted = fly(aircraft, flight, hold, environment=gust, **EASY).trajectory
    before = lifted.time_s <= 0.2
    np.testing.assert_allclose(lifted.theta[before], calm.theta[before], atol=1e-9)
    assert lifted.extra["vz"].min() < -0.1

    rough = Environment(turbulence=Turbulence(wind_20ft_m_s=7.7, sigma_high_m_s=1.5))
    with pytest.raises(InvalidInput, match="generator"):
        fly(aircraft, flight, hold, environment=rough, **EASY)
    shaken = [
        fly(aircraft, flight, hold, environment=rough, rng=np.random.default_rng(7), **EASY).trajectory.theta
        for _ in range(2)
    ]
    np.testing.assert_array_equal(*shaken)
    assert np.ptp(shaken[0]) > 1e-5


def test_the_given_start_is_taken(aircraft: Aircraft, flight: Flight) -> None:
    """With start="given" the flight begins at the measured angle of attack, with the measured thrust."""
    flown = fly(aircraft, flight, [Hold(), Hold()], start="given", **EASY)
    assert flight.start is not None
    assert flown.trajectory.theta[0] == pytest.approx(flight.start.alpha_rad, abs=1e-15)
    np.testing.assert_array_equal(flown.trim.force_B[0], flight.start.force_B)


def test_a_sample_is_followed_as_its_schedules_are(
    examples: Path, aircraft: Aircraft, flight: Flight
) -> None:
    """Handing over a sample is the same as handing over its interpolated sweeps."""
    sample = load_trajectory(examples / "train_asymmetric.csv")
    schedules = {
        "left": Tabulated(sample.time_s, sample.sweep_left),
        "right": Tabulated(sample.time_s, sample.sweep_right),
    }
    one = fly(aircraft, flight, sample, lattice=COARSE).trajectory
    other = fly(aircraft, flight, schedules, duration_s=sample.duration_s, lattice=COARSE).trajectory
    np.testing.assert_array_equal(one.euler, other.euler)


def test_written_flights_are_read_back(
    tmp_path: Path, examples: Path, aircraft: Aircraft, flight: Flight
) -> None:
    """The file has the example flights' columns in their order and holds nine digits."""
    flown = fly(aircraft, flight, [MORPH, Hold()], **EASY).trajectory
    write_trajectory_csv(flown, tmp_path / "flight.csv")
    header = (tmp_path / "flight.csv").read_text().splitlines()[0]
    assert header == (examples / "train_rate_0.5.csv").read_text().splitlines()[0]
    read = load_trajectory(tmp_path / "flight.csv")
    np.testing.assert_allclose(read.euler, flown.euler, rtol=1e-8, atol=1e-12)
    np.testing.assert_allclose(read.extra["x"], flown.extra["x"], rtol=1e-8)


def test_columns_of_strangers_run_nothing(tmp_path: Path, aircraft: Aircraft, flight: Flight) -> None:
    """A column named like a formula becomes text before a spreadsheet sees it."""
    flown = fly(aircraft, flight, [Hold(), Hold()], **EASY).trajectory
    odd = replace(flown, extra={"=1+1": flown.phi, "@now": flown.phi, "p": flown.phi}, channels={})
    write_trajectory_csv(odd, tmp_path / "odd.csv")
    assert (tmp_path / "odd.csv").read_text().splitlines()[0].endswith(",'=1+1,'@now,p")


def test_a_wing_without_stiffness_is_no_flight(
    aircraft: Aircraft, flight: Flight, guess: ParameterBatch
) -> None:
    """Too soft to carry the aircraft: no trim. Joints that push away from rest: divergence, with its time."""
    soft = guess.changed(
        stiffness_nm_rad=1e-4 * guess["stiffness_nm_rad"], damping_nms_rad=0.0 * guess["damping_nms_rad"]
    )
    with pytest.raises(TrimNotFound):
        fly(aircraft, flight, [MORPH, Hold()], model=soft, **EASY)
    soft = guess.changed(stiffness_nm_rad=-guess["stiffness_nm_rad"])
    with pytest.raises(FlightDiverged) as caught:
        fly(aircraft, flight, [MORPH, MORPH], model=soft, start="given", **EASY)
    assert 0.0 <= caught.value.time_s < 1.0


BEYOND = ConstantRate(0.0, 1.4, 0.8)


@pytest.mark.parametrize(
    ("schedules", "arguments", "pointer"),
    [
        ([BEYOND, Hold()], {}, "/schedules/sweep_right"),
        ((Hold(), Hold()), {}, "/schedules"),  # of what?
        ({"fold": Hold()}, {}, "/schedules/fold"),
        ({"sweep": Hold(), "left": Hold()}, {}, "/schedules/left"),
        ([Hold(), Hold()], {"duration_s": None}, "/duration_s"),
        ([Hold(), Hold()], {"duration_s": float("nan")}, "/duration_s"),
        ([Hold(), Hold()], {"duration_s": 0.015}, "/output_step_s"),
        ([Hold(), Hold()], {"output_step_s": 1e-9}, "/output_step_s"),
        ([Hold(), Hold()], {"step_s": 0.0}, "/step_s"),
        ([Hold(), Hold()], {"model": "flexibel"}, "/model"),
    ],
)
def test_refusals_point_at_the_argument(
    aircraft: Aircraft, flight: Flight, schedules: list[Schedule], arguments: dict[str, Any], pointer: str
) -> None:
    """What cannot be flown is refused before it is flown, with the field and what to do."""
    with pytest.raises(InvalidInput) as caught:
        fly(aircraft, flight, schedules, **{**EASY, **arguments})
    assert caught.value.pointer == pointer
    assert caught.value.hint


def test_many_parameter_sets_are_not_one_flight(
    aircraft: Aircraft, flight: Flight, guess: ParameterBatch
) -> None:
    """A batch of two is refused here."""
    pair = guess.select(np.array([0, 0]))
    with pytest.raises(InvalidInput, match="2 parameter sets"):
        fly(aircraft, flight, [Hold(), Hold()], model=pair, **EASY)
