"""More flights never hurt: models of generated aircraft predict flights of their flexible models.

Ten aircraft whose stiffness, span, mass and speed differ from the examples' by up to half, one to five
flights to fit, two held out: an asymmetric one and a symmetric one of another kind of schedule.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from morphcore import identify
from tests.identify.generated import HELD_OUT, TRAINING, flexible, generated

MEDIAN, WORST = 5e-5, 2e-4  # of J / J_rigid on the flights held out
WORSE = 1.2  # factor by which a further flight to fit may raise J of one held out
EXCEPTIONS = (
    "slow aircraft that bend little miss 4e-4 of the small J of their rigid models, 2e-3 from a single flight"
)


@cache
def held_out(seed: int, flights: int) -> dict[str, float]:
    """J / J_rigid on each flight held out, from a number of flights to fit."""
    names = list(TRAINING)[:flights]
    samples = [flexible(seed, name) for name in names]
    samples += [flexible(seed, name, "held_out") for name in HELD_OUT]
    fits = identify(*generated(seed), samples).to_document()["fit"]
    return {fit["sample"]: fit["J_identified"] / fit["J_rigid"] for fit in fits if fit["role"] == "held_out"}


@pytest.mark.slow
@pytest.mark.parametrize("seed", [5, 6])
def test_two_aircraft_are_predicted_from_two_flights(seed: int) -> None:
    """Every flight held out, within the worst figure of the law."""
    found = held_out(seed, 2)
    print(seed, found)
    assert max(found.values()) <= WORST


@pytest.mark.extended
@pytest.mark.slow
def test_the_median_over_ten_aircraft() -> None:
    """Over ten aircraft and one to five flights to fit, all angles."""
    ratios = [
        ratio for seed in range(10) for flights in range(1, 6) for ratio in held_out(seed, flights).values()
    ]
    print(np.percentile(ratios, [0, 25, 50, 75, 95, 100]))
    assert np.median(ratios) <= MEDIAN


@pytest.mark.extended
@pytest.mark.slow
@pytest.mark.xfail(strict=True, reason=EXCEPTIONS)
def test_the_worst_of_ten_aircraft() -> None:
    """The same, of the flight that is predicted worst."""
    ratios = [
        ratio for seed in range(10) for flights in range(1, 6) for ratio in held_out(seed, flights).values()
    ]
    assert max(ratios) <= WORST


@pytest.mark.extended
@pytest.mark.slow
@pytest.mark.xfail(
    strict=True, reason="predictions of 5e-6 of the rigid model's J wander by more than a fifth"
)
def test_a_further_flight_worsens_no_prediction() -> None:
    """J of a flight held out rises by a fifth at most when a flight is added to those to fit."""
    for seed in range(10):
        for flights in range(2, 6):
            before, after = held_out(seed, flights - 1), held_out(seed, flights)
            for name in HELD_OUT:
                assert after[name] <= WORSE * before[name], (seed, flights, name)
