"""Channels beside the angles, the start of a flight, and what is refused."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from morphcore import Trajectory
from morphcore.errors import InvalidInput
from morphcore.identify.cost import fly_readings, moved_start, reduced_errors, sample_cases, shared_trims
from morphcore.identify.identification import Identification
from morphcore.identify.measurement import START, Openness, measured
from morphcore.models.equivalent import chain_model, lane_constants
from morphcore.simulate.batch import fly_batch
from morphcore.simulate.trim import trimmed_state
from morphdata.identify import EquivalentModel
from morphdata.measurement import Measurement, foreign_channels
from tests.identify.disturbed import (
    CHANNELS,
    LINKS,
    TRAINING,
    fitted,
    flown,
    noisy,
    space,
    truth,
)
from tests.identify.flights import reference_aircraft, reference_flight

# what cubic interpolation and differences of a 10 ms grid may leave, as a share of a channel's range
CHANNEL_TOLERANCE = 1e-3
RATE_SIGMA, TIP_SIGMA, ANGLE_SIGMA = 5e-4, 5e-4, 1e-4


def channels(**sigma: float) -> Any:
    """Channels of a measurement with their sigmas."""
    return {name: {"sigma": value} for name, value in sigma.items()}


@pytest.mark.parametrize("name", TRAINING)
def test_channels_of_a_batch_are_those_of_a_single_flight(name: str) -> None:
    """The batch, which flies one half of a symmetric flight, reads what `simulate` reports row by row."""
    sample = flown(name)
    model = chain_model(reference_aircraft(), reference_flight(), LINKS)
    measurement = Measurement(channels=channels(**dict.fromkeys(sample.channels, 1.0)))
    (case,) = sample_cases(model, [sample], 0.01)
    case = replace(case, given=measured(sample, measurement, Openness()))
    ((_, found),) = shared_trims(model, truth(), [case], "trim")
    values = fly_readings(model, truth(), case, found).at(sample.time_s[None])[0][0]
    assert case.setup.channels[3:] == tuple(sample.channels)
    assert {"p", "tip_left_z", "tip_z_right_wing"} < set(sample.channels)
    assert len(sample.channels) > len(CHANNELS)
    for number, channel in enumerate(case.setup.channels):
        expected = case.setup.values[:, number]
        allowed = CHANNEL_TOLERANCE * np.ptp(expected) + 1e-9
        np.testing.assert_allclose(values[:, number], expected, rtol=0.0, atol=allowed, err_msg=channel)


def test_readings_between_the_rows_are_those_of_a_finer_flight() -> None:
    """Interpolated to the middles of 10 ms steps, the attitude is that of the grid which has them."""
    sample = flown("asymmetric")
    model = chain_model(reference_aircraft(), reference_flight(), LINKS)
    setup = measured(sample, Measurement(), Openness(delay=True))
    coarse, fine = (replace(sample_cases(model, [sample], step)[0], given=setup) for step in (0.01, 0.005))
    middles = sample.time_s[None, :-1] + 0.005
    seen = []
    for case in (coarse, fine):
        ((_, found),) = shared_trims(model, truth(), [case], "trim")
        seen.append(fly_readings(model, truth(), case, found).at(middles)[0])
    # the flights differ by their step: they agree as well between the rows as at them
    np.testing.assert_allclose(seen[0], seen[1], rtol=0.0, atol=5e-5)


def test_rates_and_tips_tell_the_torsion_stiffness() -> None:
    """Beside the angles they at least halve its standard error, and nothing is biased."""
    rng = np.random.default_rng(1)
    samples = []
    for number, name in enumerate(TRAINING):
        sample = noisy(flown(name), ANGLE_SIGMA, number)
        sigma = {c: TIP_SIGMA if c.startswith("tip") else RATE_SIGMA for c in sample.channels}
        read = {c: v + rng.normal(0.0, sigma[c], v.size) for c, v in sample.channels.items()}
        samples.append(replace(sample, channels=read))
    angles = channels(phi=ANGLE_SIGMA, theta=ANGLE_SIGMA, psi=ANGLE_SIGMA)
    more = channels(p=RATE_SIGMA, q=RATE_SIGMA, r=RATE_SIGMA, tip_left_z=TIP_SIGMA, tip_right_z=TIP_SIGMA)
    alone = fitted(samples, Measurement(channels=angles))
    both = fitted(samples, Measurement(channels={**angles, **more}))
    print(alone.standard_error, both.standard_error, alone.relative, both.relative)
    assert both.standard_error[1] < 0.5 * alone.standard_error[1]
    assert np.all(np.abs(both.relative) < 3.0 * both.standard_error)


def test_left_out_sigmas_are_those_of_the_noise() -> None:
    """Estimated from the rows and then from the residuals, they are what was added, within a fifth."""
    samples = [
        replace(sample, channels={"q": sample.channels["q"] + np.random.default_rng(k).normal(0.0, 1e-3, n)})
        for k, (sample, n) in enumerate(
            (noisy(flown(name), ANGLE_SIGMA, k), flown(name).time_s.size) for k, name in enumerate(TRAINING)
        )
    ]
    found = fitted(samples, Measurement.parse({"channels": {"theta": {}, "phi": {}, "psi": {}, "q": {}}}))
    sigma = found.measurement("asymmetric")["sigma"]
    assert sigma["q"] == pytest.approx(1e-3, rel=0.2)
    assert sigma["theta"] == pytest.approx(ANGLE_SIGMA, rel=0.2)


def started(name: str, change: tuple[float, ...]) -> Trajectory:
    """The true model's flight from a start off its trim, flown in the whole aircraft without readings."""
    sample = flown(name)
    model = chain_model(reference_aircraft(), reference_flight(), LINKS)
    (case,) = sample_cases(model, [sample], 0.01, whole=[True])
    ((_, found),) = shared_trims(model, truth(), [case], "trim")
    constants = lane_constants(model, truth(), case.plan.grid.step_s)
    constants.set_thrust(found.force_B, found.moment_B)
    state = moved_start(
        trimmed_state(model, truth(), case.plan, found), np.array([[0.0, found.alpha[0], 0.0]]), change
    )
    flight = [chunk.rows for chunk in fly_batch(model, case.plan, constants, state, record_rows=4)]
    w, x, y, z = np.concatenate(flight)[case.plan.grid.at, :, 0].T
    phi = np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    psi = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return replace(sample, phi=phi, theta=np.arcsin(2 * (w * y - x * z)), psi=psi, channels={})


@pytest.mark.slow
@pytest.mark.parametrize("declared", [True, None])
def test_a_flight_need_not_begin_in_trim(*, declared: bool | None) -> None:
    """Attitude, rates and speed off the trim are found with the model, declared or not."""
    change = (0.01, -0.008, 0.03, 0.02, -0.01, 0.5, 0.3, -0.2)
    samples = [started(name, change) for name in TRAINING]
    bias = None if declared is None else False
    found = fitted(samples, Measurement(initial_state=declared, bias=bias, delay=bias))
    np.testing.assert_allclose(found.relative, 0.0, atol=0.03)
    start = found.measurement("asymmetric")["initial_state"]
    np.testing.assert_allclose([start[name]["value"] for name in START], change, rtol=0.02)


def test_nuisances_are_eliminated_exactly() -> None:
    """At any parameters the reduced errors are those that no change of bias or delay can lower further."""
    sample = noisy(flown("asymmetric", late_s=0.02), ANGLE_SIGMA, 3)
    model = chain_model(reference_aircraft(), reference_flight(), LINKS)
    setup = measured(sample, Measurement(), Openness(bias=("phi", "theta", "psi"), delay=True))
    (case,) = sample_cases(model, [sample], 0.01)
    case = replace(case, given=setup)
    batch = space().decode(space().guess)
    ((_, found),) = shared_trims(model, batch, [case], "trim")
    left = reduced_errors(model, batch, case, found)
    error, slope = left.error[0], left.slope[0]
    np.testing.assert_allclose(error.sum(axis=0), 0.0, atol=1e-10)
    step_s = np.sum(error * slope) / np.sum(slope**2)
    assert abs(step_s) < 1e-5


@pytest.mark.parametrize(
    ("measurement", "pointer"),
    [
        ({"channels": {"q": {"sigma": 0.0}}}, "/measurement/channels/q/sigma"),
        ({"channels": {"quark": {}}}, "/measurement/channels/quark"),
        ({"channels": {"x": {}}}, "/measurement/channels/x"),
        ({"channels": {"hinge_torque_sweep_left": {}}}, "/measurement/channels/hinge_torque_sweep_left"),
        ({"channels": {}}, "/measurement/channels"),
        ({"loss": "cauchy"}, "/measurement/loss"),
        ({"biases": True}, "/measurement/biases"),
    ],
)
def test_a_measurement_that_makes_no_sense_is_refused(measurement: dict[str, Any], pointer: str) -> None:
    """Where the field stands is said."""
    with pytest.raises(InvalidInput) as caught:
        Measurement.parse(measurement, "/measurement")
    assert caught.value.pointer == pointer


def test_a_channel_of_no_surface_is_refused_with_those_there_are() -> None:
    """By service and library alike, before anything is flown."""
    measurement = Measurement.parse({"channels": {"tip_z_tail": {"sigma": 1e-3}, "tip_z": {"sigma": 1e-3}}})
    with pytest.raises(InvalidInput) as caught:
        Identification(reference_aircraft(), reference_flight(), [flown("rate_0.8")], measurement=measurement)
    assert [fault.pointer for fault in caught.value.faults] == [
        "/measurement/channels/tip_z_tail",
        "/measurement/channels/tip_z",
    ]
    assert "tip_z_right_wing, tip_z_left_wing" in caught.value.hint
    one_side = replace(reference_aircraft(), surfaces=reference_aircraft().surfaces[:1])
    surfaces = [(each.name, each.side, bool(each.hinges)) for each in one_side.surfaces]
    tips = Measurement.parse({"channels": {"tip_left_z": {}, "tip_right_z": {}, "q": {}}})
    (fault,) = foreign_channels(tips, surfaces)
    assert fault.pointer == "/measurement/channels/tip_left_z"


def test_a_channel_that_a_sample_lacks_is_refused() -> None:
    """Of a sample to fit; one that is held out may do without."""
    sample = flown("rate_0.8")
    without = replace(sample, name="without", channels={})
    measurement = Measurement.parse({"channels": {"q": {"sigma": 1e-3}}})

    def run(*samples: Trajectory) -> Identification:
        return Identification(
            reference_aircraft(),
            reference_flight(),
            samples,
            EquivalentModel(links_per_wing=LINKS),
            measurement=measurement,
        )

    with pytest.raises(InvalidInput) as caught:
        run(sample, without)
    assert caught.value.pointer == "/samples/1"
    assert run(sample, replace(without, role="held_out")).measurement is measurement
