"""The speed of the flexible model's flights, on the machine at hand; `pytest -s -m slow` prints it."""

from __future__ import annotations

import time
from statistics import median

import pytest

from morphcore.simulate.flexible import FLEXIBLE_STEP_S
from morphcore.simulate.trajectory import load_trajectory
from tests.models.chains import EXAMPLES, example_aircraft, example_flight
from tests.simulate.flights import fly

FLIGHTS = ("train_rate_0.8", "train_asymmetric")
TRIES = 5  # a machine shared with others is slow at times: the median of these
PROMISED_S = 1.0e-3  # a step on one core, trim included; half of what the former stepper took


def time_per_step(name: str) -> tuple[float, float]:
    """Processor time per step (s, median) with trim, and how many seconds a flown second takes."""
    flight = load_trajectory(EXAMPLES / f"{name}.csv")
    fly(example_aircraft(), example_flight(), flight, model="flexible", duration_s=0.02)
    spent = []
    for _ in range(TRIES):
        begin = time.process_time()
        fly(example_aircraft(), example_flight(), flight, model="flexible")
        spent.append(time.process_time() - begin)
    duration = float(flight.time_s[-1] - flight.time_s[0])
    return median(spent) * FLEXIBLE_STEP_S / duration, median(spent) / duration


@pytest.mark.slow
@pytest.mark.timed
@pytest.mark.parametrize("name", FLIGHTS)
def test_a_step_keeps_its_time(name: str) -> None:
    """A step of 1 ms of the reference aircraft, ten elements a wing, takes less than twice what it did."""
    step_s, slowness = time_per_step(name)
    print(f"{name}: {1e3 * step_s:.3f} ms a step, {1.0 / slowness:.2f} times real time")
    assert step_s < PROMISED_S
