"""The paper's scenario: one aircraft with the examples, flights as the sample files fly them."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from morphcore.paper.scenario import (
    AIRCRAFT,
    FLIGHT,
    HELD_BEFORE_S,
    RAMP_S,
    PaperFlight,
    aircraft,
    flight,
    paper_flights,
    two_second_flight,
)
from morphcore.simulate.schedule import Schedule, scheduled
from morphcore.simulate.trajectory import load_trajectory


def moved(flight: PaperFlight) -> Schedule:
    """What both hinges do."""
    both = flight.schedules().both
    assert both is not None
    return scheduled(both)


def test_the_aircraft_is_that_of_the_examples(examples: Path) -> None:
    """Both are the same values, so the report works without a source tree."""
    assert json.loads((examples / "aircraft.json").read_text()) == AIRCRAFT
    assert aircraft().fuselage.mass_kg == 875.0


def test_the_flight_is_that_of_the_examples_trimmed_by_ourselves(examples: Path) -> None:
    """The same condition but for the start, which the independent program gave."""
    theirs = json.loads((examples / "flight.json").read_text())
    assert {name: value for name, value in theirs.items() if name != "start"} == FLIGHT
    assert flight().start is None


@pytest.mark.parametrize("name", ["rate_0.2", "rate_0.5", "rate_0.8"])
def test_fitted_flights_sweep_as_the_sample_files(examples: Path, name: str) -> None:
    """Hold, rate and duration agree with the independent program's rows.

    Its ramps are rounded, ours are straight: inside them the angles are up to 3 mrad apart, elsewhere equal
    to the digits that the file prints.
    """
    sample = load_trajectory(examples / f"train_{name}.csv")
    each = next(each for each in paper_flights() if each.name == name)
    apart = np.abs(moved(each).motion(sample.time_s).angle - sample.sweep_right)
    since = sample.time_s - HELD_BEFORE_S
    end = each.schedule["duration_s"]
    in_ramp = ((since > 0.0) & (since < RAMP_S)) | ((since > end - RAMP_S) & (since < end))
    assert apart[~in_ramp].max() < 1e-7
    assert apart.max() < 3e-3
    assert each.duration_s == pytest.approx(sample.duration_s, abs=0.011)


def test_six_flights_as_the_paper_has_them() -> None:
    """Three to identify on; to check, one between, one beyond, one quadratic; all end at 1 rad."""
    flights = paper_flights()
    assert [each.role for each in flights] == ["train"] * 3 + ["held_out"] * 3
    for each in (*flights, two_second_flight()):
        assert moved(each).motion([each.duration_s]).angle[0] == pytest.approx(1.0)
    assert two_second_flight().duration_s == 2.0
