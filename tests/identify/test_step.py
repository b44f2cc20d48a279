"""The time step of an identification: asked for, or the longest that the flights to fit allow."""

from __future__ import annotations

from dataclasses import replace

import pytest

from morphcore.geometry.aircraft import Aircraft
from morphcore.identify import Identification, SearchSettings
from morphcore.identify.study import Study
from morphcore.simulate.step_choice import CANDIDATES_S
from morphcore.simulate.time_grid import STEP_S
from morphcore.stopping import Interrupted
from morphdata.identify import EquivalentModel
from tests.identify.flights import example, reference_aircraft, reference_flight, shortened

TWO = EquivalentModel(links_per_wing=2)
FLIGHT = shortened(example("rate_0.8"), 90)
QUICK = SearchSettings(iterations=1)


def softened(factor: float) -> Aircraft:
    """The example aircraft with wings so many times as stiff."""
    aircraft = reference_aircraft()
    return replace(
        aircraft,
        surfaces=tuple(
            replace(
                surface,
                material=surface.material.model_copy(
                    update={"youngs_modulus_pa": factor * surface.material.youngs_modulus_pa}
                ),
            )
            for surface in aircraft.surfaces
        ),
    )


def run(aircraft: Aircraft, model: EquivalentModel = TWO, search: SearchSettings = QUICK) -> Identification:
    """An identification from one short flight."""
    return Identification(aircraft, reference_flight(), [FLIGHT], model, search)


@pytest.mark.parametrize(("factor", "expected_s"), [(1.0, 0.01), (0.25, 0.005)])
def test_a_soft_aircraft_flies_in_shorter_steps(factor: float, expected_s: float) -> None:
    """The reference takes the longest step; wings that bend four times as far move too far in one."""
    searched = run(softened(factor))
    assert searched.step_s == expected_s
    assert all(case.plan.grid.step_s == pytest.approx(expected_s) for case in searched.cases)


def test_the_result_holds_the_step_used() -> None:
    """Later flights of the model take it from there; what was asked for stays open in the settings."""
    searched = run(softened(0.25))
    *_, last = searched.steps()
    assert searched.result(last.checkpoint).to_document()["model"]["step_s"] == 0.005
    assert searched.settings.step_s is None


@pytest.mark.parametrize("step_s", [0.01, 0.004])
def test_a_step_asked_for_is_kept(step_s: float) -> None:
    """Whatever the choice would be."""
    searched = run(softened(0.25), EquivalentModel(links_per_wing=2, step_s=step_s))
    assert searched.step_s == step_s
    *_, last = searched.steps()
    assert searched.result(last.checkpoint).to_document()["model"]["step_s"] == step_s


def test_a_resumed_search_flies_the_same_steps() -> None:
    """Another process chooses the same step from the same inputs, and ends at the same J to the bit."""
    search = SearchSettings(iterations=2)
    first, *_, last = run(softened(0.25), search=search).steps()
    *_, resumed = run(softened(0.25), search=search).steps(first.checkpoint)
    assert resumed.best_cost == last.best_cost


def test_held_out_flights_have_no_say() -> None:
    """The step follows from the flights to fit alone."""
    hard = replace(shortened(example("asymmetric"), 90), role="held_out")
    searched = Identification(softened(0.25), reference_flight(), [FLIGHT, hard], TWO, QUICK)
    assert searched.step_s == run(softened(0.25)).step_s


def test_without_a_trim_the_default_is_flown() -> None:
    """Wings that fold before they carry: nothing can be compared, and the search may still find others."""
    assert run(softened(0.01)).step_s == STEP_S


def test_the_choice_checks_a_stop() -> None:
    """It gives up at once, before anything is flown, and is made anew by who comes later."""
    searched = run(softened(0.25))
    with pytest.raises(Interrupted):
        next(searched.steps(stop=lambda: True))
    assert searched.step_s == 0.005


def test_every_number_of_links_chooses_its_own() -> None:
    """A study's rows hold each model's step: the one that an identification alone takes."""
    aircraft = softened(0.25)
    study = Study(aircraft, reference_flight(), [FLIGHT], links=(1, 2), search=QUICK)
    *_, last = study.steps()
    steps = [row.model["step_s"] for row in study.result(last.checkpoint).rows]
    assert steps == [run(aircraft, EquivalentModel(links_per_wing=n)).step_s for n in (1, 2)]
    assert steps[0] > steps[1], "a rigid wing needs none shorter"
    assert set(steps) <= set(CANDIDATES_S)
