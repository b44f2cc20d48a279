"""The comparison with MuJoCo is one of the same flight, at equal error; and its outcome."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.against_mujoco import ERROR_RAD, MAX_STEPS, against_mujoco, min_steps
from benchmarks.forced_tree import (
    OUTPUT_S,
    SWEEPS_RAD,
    airless_model,
    at_output_times,
    attitude_error,
    fly_in_lanes,
    plan_in_steps,
    start,
)
from benchmarks.setting import QUICK, bench_of
from morphcore.frames import quaternion_from_euler
from morphcore.models.equivalent import physical_guess

mujoco_tree = pytest.importorskip("benchmarks.mujoco_tree", reason="comes with the extra `oracles`")


def test_both_programs_fly_the_same_flight() -> None:
    """Converged attitudes agree to a hundredth of the error at which speed is compared, and wings do bend.

    MuJoCo by Runge and Kutta in steps of a tenth of a millisecond, ours in steps of half a millisecond.
    """
    model = airless_model(bench_of(QUICK), links=2)
    guess = physical_guess(model)
    state = start(model, 1)
    flown = fly_in_lanes(model, guess, plan_in_steps(model, 5e-4), state, record_rows=model.state_rows)
    flight = mujoco_tree.ForcedMujoco(model, guess, "rk4")
    attitudes = flight.attitudes(1e-4)
    error = attitude_error(at_output_times(flown)[..., 0], attitudes)
    print(f"{error:.1e} rad; joints to {np.abs(flown[:, 13:19]).max():.2f} rad")
    assert error < 0.01 * ERROR_RAD
    assert np.abs(flown[:, 13:19]).max() > 0.02
    assert attitude_error(attitudes[:1], attitudes[-1:]) > 0.3
    hinges = [flight.data.joint(f"hinge_{i}").qpos[0] for i in range(2)]
    np.testing.assert_allclose(hinges, SWEEPS_RAD, atol=1e-5, err_msg="the hinges go where they are sent")


def test_no_python_and_no_contact_in_a_step() -> None:
    """A flight in two calls ends where the one in pieces does; nothing of MuJoCo's idle parts takes part."""
    model = airless_model(bench_of(QUICK), links=1)
    flight = mujoco_tree.ForcedMujoco(model, physical_guess(model), "implicitfast")
    last = flight.attitudes(1e-3)[-1]
    flight.reset(1e-3)
    flight.fly(1e-3)
    np.testing.assert_array_equal(flight.data.qpos[3:7], last)
    assert (flight.model.ngeom, flight.data.ncon, flight.data.nefc, flight.model.nsensor) == (0, 0, 0, 0)


@pytest.mark.parametrize("needed", [1, 2, 3, 37, 64, 1000])
def test_fewest_steps_finds_the_longest_step(needed: int) -> None:
    """The least number whose error is below the bound is found; where none is, none is made up."""

    def error(steps: int) -> float:
        return float("nan") if steps < needed / 3 else ERROR_RAD * (needed - 0.5) / steps

    assert min_steps(error) == needed
    assert min_steps(lambda steps: error(steps) * MAX_STEPS * 2) is None


def test_attitude_error_is_the_angle_between() -> None:
    """A turn by a small or a large angle about any axis, and the quaternion's other sign."""
    base = quaternion_from_euler(0.3, -0.2, 1.0)[None]
    for angle in (1e-9, 1e-4, 0.5, 2.5):
        turned = quaternion_from_euler(0.3, -0.2, 1.0 + angle)[None]
        assert attitude_error(base, -turned) == pytest.approx(angle, rel=1e-6)
    assert attitude_error(base[..., None], base[..., None]) == 0.0


def test_steps_divide_the_output_times() -> None:
    """Attitudes are taken at the same times whatever the step."""
    model = airless_model(bench_of(QUICK), links=1)
    guess = physical_guess(model)
    coarse, fine = (
        at_output_times(fly_in_lanes(model, guess, plan_in_steps(model, OUTPUT_S / n), start(model, 1)))
        for n in (10, 40)
    )
    assert coarse.shape == fine.shape == (21, 4, 1)
    assert attitude_error(coarse, fine) < ERROR_RAD


@pytest.mark.slow
@pytest.mark.timed
def test_thirty_times_mujoco_in_a_batch_and_never_slower_alone() -> None:
    """At 1e-4 rad of attitude, four links a wing, one core, against MuJoCo's best integrator."""
    bench = bench_of(replace(QUICK, rounds=5))
    found = against_mujoco(bench)
    print(found)
    assert found["agreement_rad"] < 0.01 * ERROR_RAD
    assert found["batch_ratio"] >= 30.0
    assert found["single_ratio"] >= 1.0
