"""Bounds that nobody asked for give way to the flights, within what physics allows; requested ones do not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from morphcore.identify import Identification, IdentifyResult, SearchSettings
from morphcore.identify.parameters import search_space
from morphcore.models.equivalent import chain_model, physical_guess
from morphcore.search.least_squares import LeastSquares
from morphcore.search.solver import Box
from morphcore.simulate.time_grid import STEP_S
from morphcore.simulate.trajectory import Trajectory
from morphdata.identify import EquivalentModel
from tests.identify.flights import reference_aircraft, reference_flight, shortened, synthetic
from tests.search.problems import Formula, content, searched, through_bytes

Array = NDArray[np.float64]

LIFT = 1.7  # beyond the default bounds, 0.6 to 1.5
CORRECTIONS = ("lift_factor", "ac_offset_m", "lag_s")


def distances(points: Array) -> Array:
    """Residuals whose minimum is at (3, -0.5, 9)."""
    return np.asarray(points - np.array([3.0, -0.5, 9.0]))


def descent(limits: Box | None) -> tuple[Formula, LeastSquares]:
    """A descent in a box of one unit either way."""
    problem = Formula(distances, np.full(3, -1.0), np.full(3, 1.0), np.zeros((1, 3)))
    return problem, LeastSquares(problem, 60, limits=limits)


def test_a_descent_reaches_a_minimum_beyond_its_box() -> None:
    """As far as the limits let it; where there are none, the box is hard."""
    limits = Box(np.full(3, -5.0), np.full(3, 5.0))
    np.testing.assert_allclose(searched(*descent(limits))[-1].best, [3.0, -0.5, 5.0], atol=1e-6)
    np.testing.assert_allclose(searched(*descent(None))[-1].best, [1.0, -0.5, 1.0], atol=1e-6)


def test_only_what_is_pushed_against_gives_way() -> None:
    """The box that is reported holds the point, and is as it was where nothing pushed."""
    box = searched(*descent(Box(np.full(3, -5.0), np.full(3, 5.0))))[-1].solver.box
    np.testing.assert_array_equal(box.lower, [-1.0, -1.0, -1.0])
    assert 3.0 < box.upper[0] <= 5.0
    np.testing.assert_array_equal(box.upper[1:], [1.0, 5.0])


def test_a_widened_search_resumes_to_the_bit() -> None:
    """The box is part of the state."""
    problem, solver = descent(Box(np.full(3, -5.0), np.full(3, 5.0)))
    states = searched(problem, solver)
    for state in states[:-1]:
        assert content(searched(problem, solver, through_bytes(state))[-1]) == content(states[-1])


def test_physical_limits_hold_the_bounds_of_every_parameter() -> None:
    """Nothing can be widened to less; what has no limits of its own keeps its bounds."""
    space = search_space(chain_model(reference_aircraft(), reference_flight(), 3))
    assert np.all(space.limits.lower <= space.lower)
    assert np.all(space.limits.upper >= space.upper)
    wider = (space.limits.lower < space.lower) | (space.limits.upper > space.upper)
    assert wider.all()
    hard = search_space(
        chain_model(reference_aircraft(), reference_flight(), 3), bounds={"lift_factor": (0.8, 1.2)}
    )
    at = hard.names.index("lift_factor")
    assert (hard.limits.lower[at], hard.limits.upper[at]) == (hard.lower[at], hard.upper[at])


def strong_lift() -> Trajectory:
    """A flight whose lift lies beyond what a search looks at first."""
    batch = physical_guess(chain_model(reference_aircraft(), reference_flight(), 1))
    flown = synthetic(batch.changed(lift_factor=np.array([LIFT])), right_rad=0.5)
    return shortened(replace(flown, name="strong lift"), 80)


def found(bounds: dict[str, list[float]] | None = None) -> IdentifyResult:
    """What is identified from it."""
    model = EquivalentModel(
        links_per_wing=1, aero_coefficients=list(CORRECTIONS), bounds=bounds, step_s=STEP_S
    )
    search = SearchSettings(method="least_squares", iterations=20)
    run = Identification(reference_aircraft(), reference_flight(), [strong_lift()], model, search)
    *_, last = run.steps()
    return run.result(last.checkpoint)


def test_flights_find_a_parameter_beyond_its_default_bounds() -> None:
    """To within one per cent; no warning speaks of a bound, and the result says what gave way."""
    result = found()
    document = result.to_document()
    assert result.parameters["lift_factor"][0] == pytest.approx(LIFT, rel=0.01)
    assert document["uncertainty"]["at_bound"] == []
    assert "at_bound" not in {warning["code"] for warning in document["warnings"]}
    assert "lift_factor" in document["search"]["widened"]


def test_bounds_that_were_asked_for_are_hard() -> None:
    """The fit ends at the bound, which is listed and warned of."""
    result = found({"lift_factor": [0.6, 1.5]})
    document = result.to_document()
    assert result.parameters["lift_factor"][0] == pytest.approx(1.5, rel=1e-6)
    assert "lift_factor" in document["uncertainty"]["at_bound"]
    assert "at_bound" in {warning["code"] for warning in document["warnings"]}
    assert "lift_factor" not in document["search"]["widened"]
