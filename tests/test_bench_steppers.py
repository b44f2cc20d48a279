"""Candidate time steppers: their tableaus, their order, and the shipped one against its compiled self."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from benchmarks.stage import Course, Stages
from benchmarks.steppers import FORMER, SHIPPED, STEPPERS
from benchmarks.work_precision import work_precision, work_precision_plot, work_precision_table
from morphcore.frames import euler_from_quaternion
from morphcore.geometry.aircraft import Aircraft, Flight
from morphcore.models.equivalent import physical_guess
from morphcore.simulate.trajectory import load_trajectory
from morphcore.simulate.trim import trim
from morphdata.aircraft import load_aircraft
from morphdata.flight import load_flight
from tests.models.chains import Swing
from tests.simulate.flights import example_model, fly_trimmed, plan_of

SWINGS = (Swing(0.5, np.pi / 2), Swing(0.35, np.pi / 2))
DURATION_S = 0.2
ORDER = {"linearly implicit Euler": 1}  # of the others: two at least


def course_of(model):
    """A course of swinging wings and the trim at its start."""
    plan = plan_of(model, SWINGS, DURATION_S, 0.00125)
    course = Course(model, SWINGS, plan)
    return course, trim(model, physical_guess(model), plan).require()


@pytest.fixture(scope="module")
def swinging():
    """Model, course and trim of two links a wing."""
    model = example_model(2)
    return model, *course_of(model)


@pytest.fixture(scope="module")
def fine(swinging):
    """Attitude of a flight that all candidates converge to."""
    return attitude(swinging, "ROS2, extrapolated 1-2", 0.001)


def attitude(swinging, name, step_s):
    """Euler angles (k, 3) every 20 ms of a stepper's flight."""
    model, course, found = swinging
    stages = Stages(model, physical_guess(model), course, found)
    flown = [u[:4, 0] for u in STEPPERS[name](stages, step_s, round(DURATION_S / step_s))]
    return euler_from_quaternion(np.stack(flown)[:: round(0.02 / step_s)])


def test_compiled_step_is_the_stepper_in_python(swinging):
    """The kernel and the few lines of Python that say the same agree to round-off.

    Not in the first half step of the lag states, which differ by what a step of 10 ms moves them: 1e-6 rad.
    """
    model, _, _ = swinging
    for step_s, off_rad in ((0.01, 1e-6), (0.005, 3e-7)):
        compiled = fly_trimmed(model, plan_of(model, SWINGS, DURATION_S, step_s)).euler[:, 0]
        python = attitude(swinging, SHIPPED, step_s)
        np.testing.assert_allclose(compiled[:: round(0.02 / step_s)], python, rtol=0, atol=off_rad)


@pytest.mark.parametrize(
    "name", [name if name == SHIPPED else pytest.param(name, marks=pytest.mark.slow) for name in STEPPERS]
)
def test_every_candidate_converges_with_its_order(swinging, fine, name):
    """Halving the step divides the error by two to its order at least, to the same attitude for all.

    Below 1e-8 rad stands what a course's lattice, looked up linearly along the path, adds.
    """
    coarse, half = (np.abs(attitude(swinging, name, step) - fine).max() for step in (0.005, 0.0025))
    assert coarse / half > 0.85 * 2.0 ** ORDER.get(name, 2) or coarse < 1e-8
    assert coarse < 2e-3


class Small:
    """Stages of a small nonlinear system u' = J u - u^3 / 2 behind a quaternion that rests, with any A."""

    def __init__(self, A):
        self.A = A
        self.first = np.concatenate([[1.0, 0.0, 0.0, 0.0], FIRST])[:, None]
        self.first_lag = None
        self.course = self
        self.start_s = 0.0

    def mean_acceleration(self, _begin, _end):
        """No hinge moves."""
        return np.zeros(0)

    def __call__(self, _time_s, _acceleration, u, lag, implicit_s=0.0, slope=None):
        """k = f(u) + A (implicit_s k + slope)."""
        right = rates(u[4:, 0]) + (0.0 if slope is None else self.A @ slope[4:, 0])
        k = np.zeros_like(u)
        k[4:, 0] = np.linalg.solve(np.eye(FIRST.size) - implicit_s * self.A, right)
        return k, lag


FIRST = np.array([0.9, -0.4, 0.6])
JACOBIAN = np.array([[-1.0, 2.0, 0.3], [-2.0, -0.5, 0.4], [0.2, -0.6, -1.5]])
FOREIGN = np.array([[-3.0, 0.5, 1.0], [0.4, -2.0, 0.0], [-1.0, 0.7, -4.0]])  # nothing of the Jacobian
ANY_A = {**ORDER, "the same, extrapolated 1-2-3": 3, "ROS34PW2": 3, "ROS2, extrapolated 1-2": 3}


def rates(u):
    """Right side of the small system."""
    return JACOBIAN @ u - 0.5 * u**3


@pytest.mark.parametrize("name", STEPPERS)
def test_order_for_a_foreign_matrix(name):
    """With an A that is nothing of the Jacobian every W-method keeps its order, against a textbook solver."""
    exact = solve_ivp(lambda _, u: rates(u), (0.0, 1.0), FIRST, rtol=1e-12, atol=1e-13).y[:, -1]
    errors = []
    for steps in (100, 200):
        *_, last = STEPPERS[name](Small(FOREIGN), 1.0 / steps, steps)
        errors.append(np.abs(last[4:, 0] - exact).max())
    assert np.log2(errors[0] / errors[1]) > ANY_A.get(name, 2) - 0.15


@pytest.mark.slow
def test_diagram_and_table(examples: Path):
    """One stage in 10 ms errs by less than two do; counts are stages over time; the picture draws."""
    sample = load_trajectory(examples / "train_rate_0.8.csv")
    figures = work_precision(
        Aircraft.of(load_aircraft(examples / "aircraft.json")),
        Flight.of(load_flight(examples / "flight.json")),
        [sample],
        links=2,
        steppers={name: STEPPERS[name] for name in (SHIPPED, FORMER)},
        parts=(1, 2),
    )
    rows = figures["flights"][0]["steppers"]
    assert rows[FORMER]["stages_per_s"] == pytest.approx([200.0, 400.0])
    assert rows[SHIPPED]["stages_per_s"] == pytest.approx([100.0, 200.0], rel=0.01)  # and one at the start
    assert figures["holding"][SHIPPED]["step_s"] == pytest.approx(0.01)
    assert max(rows[SHIPPED]["error_rad"]) < max(rows[FORMER]["error_rad"])
    assert work_precision_table(figures)[0][0] == SHIPPED
    assert work_precision_plot(figures)["work_precision.svg"].startswith(b"<?xml")
