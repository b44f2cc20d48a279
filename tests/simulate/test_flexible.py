"""Flights of the flexible model: laws, convergence, limits shared with the others, the sample flights."""

from __future__ import annotations

import importlib
import json
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from morphcore.aero.moving_lattice import acting_circulation
from morphcore.errors import FlightDiverged, InvalidInput, TrimNotFound
from morphcore.geometry.aircraft import Aircraft, Flight
from morphcore.models.equivalent import chain_model, physical_guess
from morphcore.simulate.flexible import Stepper
from morphcore.simulate.flight import ModelChoice, Simulation, flight_steps
from morphcore.simulate.kernels.flexible_step import lag_after
from morphcore.simulate.schedule import ConstantRate, Hold, Tabulated
from morphcore.simulate.trajectory import Trajectory, load_trajectory
from morphcore.stopping import Interrupted
from morphdata.lattice import Lattice, VortexCore
from tests.models.chains import EXAMPLES, aircraft_of, example_aircraft, example_flight, flight_of
from tests.simulate.flights import fly

Array = NDArray[np.float64]
flexible = importlib.import_module("morphcore.simulate.flexible")  # `morphcore.simulate` is a function
SMOOTHED = Lattice(core=VortexCore(law="smoothed"))
MORPH = ConstantRate(0.0, 1.0, 2.0, start_s=0.1)


def changed(
    aircraft: dict[str, Any], flight: dict[str, Any] | None = None, **of_wings: object
) -> tuple[Aircraft, Flight]:
    """The example with some entries replaced; material entries of all wings by keyword."""
    document = json.loads((EXAMPLES / "aircraft.json").read_text()) | aircraft
    for surface in document["surfaces"]:
        surface["material"] |= of_wings
    condition = json.loads((EXAMPLES / "flight.json").read_text()) | (flight or {})
    return aircraft_of(document), flight_of(condition)


@cache
def flown(step_s: float = 0.001, elements: int = 10) -> Array:
    """Pitch in the conditions of train_rate_0.5 up to 0.8 s."""
    found = fly(
        example_aircraft(),
        example_flight(),
        sample("train_rate_0.5"),
        model="flexible",
        step_s=step_s,
        elements=elements,
        duration_s=0.8,
    )
    return found.trajectory.theta


@cache
def sample(name: str) -> Trajectory:
    """One of the example flights."""
    return load_trajectory(EXAMPLES / f"{name}.csv")


def test_a_trimmed_aircraft_flies_on() -> None:
    """With its wings at rest it stays in level flight: 1e-8 rad over a second."""
    found = fly(
        example_aircraft(), example_flight(), {"left": Hold(), "right": Hold()}, model="flexible",
        duration_s=1.0, step_s=0.005,
    )  # fmt: skip
    departure = found.trajectory.euler - found.trajectory.euler[0]
    assert np.abs(departure).max() < 1e-8
    assert np.ptp(found.trajectory.extra["z"]) < 1e-6


def test_halving_the_step_changes_nothing() -> None:
    """Attitude at 1 ms and at 0.5 ms differ by less than 1e-5 rad (required: 1e-4)."""
    assert np.abs(flown(0.001) - flown(0.0005)).max() < 1e-5


def test_what_a_step_keeps_does_not_show(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fresh influence in every iteration and a fresh inverse in every step fly the same: 1e-9 rad."""
    kept = flown()
    coefficients, fly_to = flexible.Stepper.coefficients, flexible.FlexibleRun.fly_to

    def exact(rule: flexible.Stepper, lag_time: Array) -> Any:
        return coefficients(rule, lag_time, still=0.0)

    def renewing(run: flexible.FlexibleRun, row: int) -> None:
        while run.row < row:
            run._scratch.inverse[:] = 0.0  # so that each step requests one
            fly_to(run, run.row + 1)

    monkeypatch.setattr(flexible.Stepper, "coefficients", exact)
    monkeypatch.setattr(flexible.FlexibleRun, "fly_to", renewing)
    fresh = fly(
        example_aircraft(), example_flight(), sample("train_rate_0.5"), model="flexible", duration_s=0.8
    )  # fmt: skip
    assert np.abs(fresh.trajectory.theta - kept).max() < 1e-9


def test_the_stepper_is_of_second_order() -> None:
    """Half the step, a quarter of the error."""
    errors = [np.abs(flown(h) - flown(0.0005)).max() for h in (0.005, 0.0025)]
    assert 3.0 < errors[0] / errors[1] < 5.5


def test_doubling_the_elements_changes_nothing() -> None:
    """Ten elements a wing hold attitude to 1e-5 rad against twenty (required: 1e-3)."""
    assert np.abs(flown() - flown(elements=20)).max() < 1e-5


def test_mirrored_morph_gives_mirrored_flight() -> None:
    """Roll and yaw change sign, pitch does not; to the Newton iteration's tolerance."""
    slow, fast = ConstantRate(0.0, 0.3, 0.6), ConstantRate(0.0, 0.5, 0.5)
    there, back = (
        fly(
            example_aircraft(), example_flight(), {"left": left, "right": right}, model="flexible",
            duration_s=0.8, step_s=0.004,
        ).trajectory
        for left, right in ((slow, fast), (fast, slow))
    )  # fmt: skip
    assert np.ptp(there.phi) > 1e-2
    np.testing.assert_allclose(back.euler, there.euler * [-1.0, 1.0, -1.0], atol=1e-7)


def test_stiff_wings_fly_as_the_rigid_model() -> None:
    """Five hundred times as stiff, the beams agree with the links: two programs, one aircraft, 1 mrad.

    What is left is the rigid model's lattice, frozen along zero incidence (0.4 mrad against a fresh one).
    """
    stiff = changed({}, youngs_modulus_pa=1e12)
    beams, links = (
        fly(*stiff, {"left": MORPH, "right": MORPH}, model=model, duration_s=1.5, step_s=step).trajectory
        for model, step in (("flexible", 0.0025), ("rigid", 0.005))
    )
    assert np.ptp(links.theta) > 0.1
    assert np.abs(beams.theta - links.theta).max() < 1e-3


def with_axis(axis: str) -> dict[str, Any]:
    """The example's surfaces on hinges of another axis."""
    surfaces = json.loads((EXAMPLES / "aircraft.json").read_text())["surfaces"]
    for surface in surfaces:
        surface["hinge"]["axis"] = axis
    return {"surfaces": surfaces}


def with_tail() -> dict[str, Any]:
    """Tapered wings with offset axes, and a fixed rigid tail."""
    surfaces = json.loads((EXAMPLES / "aircraft.json").read_text())["surfaces"]
    for surface, side in zip(surfaces[:2], ("right", "left"), strict=True):
        tail = {name: value for name, value in surface.items() if name != "hinge"}
        tail |= {"name": f"tail {side}", "side": side, "flexible": False, "position_m": [-2.2, 0.0, -0.3]}
        surfaces.append(tail | {"span_m": 0.9})
        surface.pop("chord_m")
        surface |= {"root_chord_m": 0.35, "tip_chord_m": 0.25, "elastic_axis_offset_m": 0.02}
    return {"surfaces": surfaces}


@pytest.mark.parametrize(
    ("aircraft", "final_rad"), [(with_axis("x"), 0.6), (with_axis("y"), 0.03), (with_tail(), 0.8)]
)
def test_other_aircraft_fly_as_the_rigid_model_does(aircraft: dict[str, Any], final_rad: float) -> None:
    """Folding, twisting, tapered with a tail: nothing in the beams is made for sweep alone; stiff, 2 mrad."""
    stiff, morph = changed(aircraft, youngs_modulus_pa=1e12), ConstantRate(0.0, final_rad, 0.6)
    beams, links = (
        fly(*stiff, {"left": morph, "right": morph}, model=model, duration_s=0.8, step_s=step).trajectory
        for model, step in (("flexible", 0.005), ("rigid", 0.005))
    )
    assert np.ptp(links.theta) > 5e-3
    np.testing.assert_allclose(beams.theta, links.theta, atol=2e-3)
    np.testing.assert_allclose(beams.extra["vz"], links.extra["vz"], atol=0.3)


def test_chains_of_more_links_tend_to_the_beams() -> None:
    """Tip deflection at trim: nominal chains stand for the whole beam, and miss it as 1 / (n - 1)^2.

    Three links are within 5 per cent. Of eight, the rest is what chains and beams differ in besides the
    number of links: 1 per cent, the chain's lattice is not bent.
    """
    beams = trimmed_tip(simulate_hold("flexible"))
    tips = {}
    for links in (2, 3, 5, 8):
        chain = chain_model(example_aircraft(), example_flight(), links)
        tips[links] = trimmed_tip(simulate_hold(physical_guess(chain)))
    print(f"tips: beams {beams:.4f}, chains {tips}")
    assert tips[3] == pytest.approx(beams, rel=0.05)
    assert tips[8] == pytest.approx(beams, rel=0.01)
    missing = {
        links: (tips[8] - tip) / (1.0 / (links - 1) ** 2 - 1.0 / 49)
        for links, tip in tips.items()
        if links < 8
    }
    assert missing[3] == pytest.approx(missing[5], rel=0.1)
    assert 0.0 < missing[2] < missing[3]


def test_flights_of_more_links_tend_to_the_beams() -> None:
    """An asymmetric morph: nominal chains fly as the beams, three links within 1 mrad, eight within 0.15.

    Articulated rigid links and beam elements share no dynamics. Roll and pitch flown are 12 and 197 mrad. Of
    the error in pitch, what the number of links brings falls as 1 / (n - 1)^2: extrapolated from three and
    five links it is 0.1 mrad, which the chains' unbent lattice leaves.
    """
    aircraft, flight = example_aircraft(), example_flight()
    morphs = {"left": MORPH, "right": ConstantRate(0.0, 0.8, 1.6, start_s=0.1)}
    beams = fly(aircraft, flight, morphs, model="flexible", duration_s=1.5, step_s=0.0025).trajectory.euler
    chains = {
        n: fly(
            aircraft, flight, morphs, model=physical_guess(chain_model(aircraft, flight, n)), duration_s=1.5
        ).trajectory.euler
        for n in (2, 3, 5, 8)
    }
    errors = {n: np.abs(chains[n] - beams).max(axis=0) for n in chains}
    print(errors)
    assert errors[3].max() <= 1e-3
    assert errors[8].max() <= 1.5e-4
    assert errors[2][1] > errors[3][1] > errors[5][1] > errors[8][1]
    extrapolated = (16.0 * chains[5] - 4.0 * chains[3]) / 12.0
    np.testing.assert_allclose(extrapolated, beams, atol=1e-4)


def test_a_flight_may_begin_amid_a_morph() -> None:
    """Hinges already in motion at the start: stiff beams and links feel the same, 2 mrad in half a second."""
    stiff = changed({}, youngs_modulus_pa=1e12)
    moving = Tabulated(np.linspace(0.0, 1.0, 101), 0.5 * np.linspace(0.0, 1.0, 101))
    beams, links = (
        fly(*stiff, {"left": moving, "right": moving}, model=model, duration_s=0.5, step_s=step).trajectory
        for model, step in (("flexible", 0.0025), ("rigid", 0.005))
    )
    np.testing.assert_allclose(beams.theta - beams.theta[0], links.theta - links.theta[0], atol=2e-3)
    assert np.ptp(links.theta) > 0.02


def simulate_hold(model: ModelChoice) -> Simulation:
    """A moment of level flight."""
    return fly(
        example_aircraft(), example_flight(), {"left": Hold(), "right": Hold()}, model=model, duration_s=0.05
    )


def trimmed_tip(found: Simulation) -> float:
    """Tip deflection at the start, m, up positive."""
    return -float(found.trajectory.extra["tip_right_z"][0])


def test_free_fall_without_air_keeps_momentum() -> None:
    """In thin air and unaccelerated, a morph moves the centre of mass of the whole by nothing but gravity."""
    aircraft, flight = changed(
        {},
        {
            "air_density_kg_m3": 1e-9,
            "start": {"alpha_rad": 0.0, "force_b_n": [0, 0, 0], "moment_b_n_m": [0, 0, 0]},
        },
    )
    tracked = fly(
        aircraft, flight, {"left": MORPH, "right": MORPH}, model="flexible", duration_s=2.4, step_s=0.002,
        start="given",
    ).trajectory  # fmt: skip
    # symmetric about the plane of motion: nothing rolls, yaws or drifts aside, and pitch returns to rest
    assert np.abs(tracked.phi).max() < 1e-9
    assert np.abs(tracked.extra["y"]).max() < 1e-9
    # with the wings locked again the fuselage falls with g: the centre of mass was at rest relative to it
    late = tracked.time_s > 2.2
    fall = np.gradient(tracked.extra["vz"], tracked.time_s)[late]
    np.testing.assert_allclose(fall[1:-1].mean(), 9.81, rtol=2e-3)


@pytest.mark.parametrize("name", ["train_rate_0.2", "train_rate_0.5", "train_rate_0.8"])
@pytest.mark.slow
def test_sample_flights_are_predicted(name: str) -> None:
    """An independent program's flights, nominal properties, own trim, nothing fitted: pitch RMS <= 3 mrad.

    With the vortex core that such programs have ("smoothed", 0.05 of the chord; DECISIONS 9).
    """
    found = predicted(name, "smoothed")
    assert -float(found.extra["tip_left_z"][0]) == pytest.approx(0.273, rel=0.05)
    assert rms(found.theta - sample(name).theta) <= 3e-3
    assert found.theta[0] == pytest.approx(0.0623, rel=0.02)


@pytest.mark.slow
def test_the_asymmetric_sample_is_predicted() -> None:
    """Each Euler angle within 5 per cent of its range."""
    found, measured = predicted("train_asymmetric", "smoothed"), sample("train_asymmetric")
    off = np.abs(found.euler - measured.euler).max(axis=0)
    assert np.all(off <= 0.05 * np.ptp(measured.euler, axis=0))


@pytest.mark.slow
def test_the_undistorted_lattice_differs_by_its_trim() -> None:
    """The thin core trims 6 mrad higher than the samples, and most of its pitch error is that offset."""
    found, measured = predicted("train_rate_0.5", "line"), sample("train_rate_0.5")
    error = found.theta - measured.theta
    assert found.theta[0] == pytest.approx(0.0684, abs=2e-4)
    assert 3e-3 < rms(error) < 10e-3


@cache
def predicted(name: str, law: str) -> Trajectory:
    """A sample's sweep flown in the flexible model."""
    lattice = Lattice(core=VortexCore(law=law))  # type: ignore[arg-type]
    return fly(
        example_aircraft(), example_flight(), sample(name), model="flexible", lattice=lattice
    ).trajectory


def rms(error: Array) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(error**2)))


def test_the_given_start_is_taken() -> None:
    """Angle of attack, force and moment of the flight's start; the wings settle to them."""
    flight = example_flight()
    assert flight.start is not None
    found = fly(
        example_aircraft(), flight, {"left": Hold(), "right": Hold()}, model="flexible", start="given",
        duration_s=0.1, lattice=SMOOTHED, step_s=0.005,
    )  # fmt: skip
    assert found.trajectory.theta[0] == pytest.approx(flight.start.alpha_rad)
    np.testing.assert_allclose(found.trim.force_B[0], flight.start.force_B)
    # the sample's own lattice and the smoothed core agree on the trim, so little happens
    assert np.ptp(found.trajectory.theta) < 1e-3


def test_a_flight_can_be_watched_and_stopped() -> None:
    """Steps report a rising fraction; `stop` ends the flight between two of them."""
    requested = []

    def stop() -> bool:
        requested.append(True)
        return len(requested) > 3

    steps = flight_steps(
        example_aircraft(), example_flight(), {"left": Hold(), "right": Hold()}, model="flexible",
        duration_s=1.0, stop=stop,
    )  # fmt: skip
    fractions = []
    with pytest.raises(Interrupted):
        fractions += [step.fraction for step in steps]
    assert len(requested) == 4
    del fractions


def test_a_trim_that_stalls_in_its_last_digits_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    """A tolerance below round-off changes the flight by no more than the imbalance that is accepted."""
    trimming = importlib.import_module("morphcore.simulate.flexible_trim")

    def pitch() -> Array:
        held = {"left": Hold(), "right": Hold()}
        return fly(
            example_aircraft(), example_flight(), held, model="flexible", elements=2, duration_s=0.02
        ).trajectory.theta

    reached = pitch()
    monkeypatch.setattr(trimming, "TOLERANCE", 1e-18)
    np.testing.assert_allclose(pitch(), reached, rtol=0.0, atol=trimming.ACCEPTED)


def test_wings_too_weak_to_fly_say_so() -> None:
    """Wings without stiffness find no trim, or leave the model's domain: an error, never a number."""
    weak = changed({}, youngs_modulus_pa=2e6)
    with pytest.raises((TrimNotFound, FlightDiverged)):
        fly(*weak, {"left": MORPH, "right": MORPH}, model="flexible", duration_s=0.5, step_s=0.005)


def test_a_hinge_beyond_its_range_is_refused() -> None:
    """The same check as every model's."""
    far = ConstantRate(0.0, 1.5, 2.0)
    with pytest.raises(InvalidInput, match="beyond its range"):
        fly(
            example_aircraft(),
            example_flight(),
            {"left": far, "right": far},
            model="flexible",
            duration_s=2.5,
        )


def test_lag_follows_a_ramp_exactly() -> None:
    """For a circulation that rises straight, one long step of the lag equals many short ones."""
    times, before, after = np.array([[0.05], [0.01]]), 1.0, 3.0
    long, short = (Stepper(step_s).coefficients(times) for step_s in (0.1, 0.1 / 50.0))
    for k, start in enumerate((0.4, 0.9)):
        once = lag_after(start, before, after, long.decay[k, 0], long.mean[k, 0])
        lag = start
        for i in range(50):
            ends = (before + (after - before) * share / 50.0 for share in (i, i + 1))
            lag = lag_after(lag, *ends, short.decay[k, 0], short.mean[k, 0])
        assert once == pytest.approx(lag, rel=1e-12)
    # settled lag states change nothing: Jones' weights add up to one
    circulation = np.array([after])
    settled = acting_circulation(circulation, np.stack([circulation, circulation]))
    np.testing.assert_allclose(settled, circulation, rtol=1e-15)
