"""`max_seconds` counts from the first second: while a step is chosen, and within a step of the search."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import pytest

from morphcore.identify import Identification, SearchSettings
from morphcore.identify.study import Study
from morphcore.optimise import ScheduleOptimisation
from morphcore.search.swarm import SwarmSettings
from morphcore.simulate.time_grid import STEP_S
from morphcore.stopping import Deadline, Interrupted, listening, say
from morphdata.identify import EquivalentModel, Method
from tests.identify.flights import example, reference_aircraft, reference_flight, shortened
from tests.identify.test_step import softened
from tests.optimise.morphs import optimisation

TWO = EquivalentModel(links_per_wing=2)
FLIGHT = shortened(example("rate_0.8"), 90)
NO_TIME = 1e-9
GRACE_S = 20.0  # for what is always flown, and for a busy machine; hours would be asked for


def hopeless(method: Method = "pso", **settings: Any) -> Identification:
    """A search that would take hours, on wings that ask for a shorter step than the default."""
    swarm = SwarmSettings(particles=50_000, generations=1000)
    search = SearchSettings(method=method, swarm=swarm, **settings)
    return Identification(softened(0.25), reference_flight(), [FLIGHT], TWO, search)


def test_a_deadline_says_whose_stop_it_was() -> None:
    """Time that is up, or somebody else's question; without seconds only that."""
    now = iter([0.0, 4.9, 5.0, 5.1])
    deadline = Deadline(5.0, clock=lambda: next(now))
    assert [deadline(), deadline(), deadline.passed] == [False, True, True]
    requested = Deadline(None, lambda: True)
    assert (requested(), requested.passed) == (True, False)


@pytest.mark.parametrize("method", ["pso", "hybrid"])
def test_a_search_without_time_flies_the_guess_and_ends(method: Method) -> None:
    """The step that nobody had the time to choose is the default, and the result says so."""
    run = hopeless(method, max_seconds=NO_TIME)
    begin = time.monotonic()
    steps = list(run.steps())
    assert time.monotonic() - begin < GRACE_S
    assert [step.phase for step in steps] == ["baseline"]
    assert steps[0].fraction == 1.0
    document = run.best_so_far(steps[0].checkpoint).to_document()
    assert document["model"]["step_s"] == STEP_S
    assert document["search"]["finished"]


def test_a_generation_ends_when_the_time_is_up() -> None:
    """Fifty thousand models are not waited for; what is known by then is the result."""
    run = hopeless(max_seconds=3.0)
    begin = time.monotonic()
    steps = list(run.steps())
    assert time.monotonic() - begin < 3.0 + GRACE_S
    assert steps[-1].fraction == 1.0
    assert run.best_so_far(steps[-1].checkpoint).search["finished"]


def test_a_resumed_search_keeps_the_step_of_its_first_attempt() -> None:
    """A step taken for want of time stays: the checkpoint holds it, another process does not choose again."""
    run = hopeless(max_seconds=NO_TIME)
    (only,) = run.steps()
    again = hopeless(max_seconds=NO_TIME)
    assert again.best_so_far(only.checkpoint).to_document()["model"]["step_s"] == STEP_S
    assert again.step_s == STEP_S


def test_a_stop_is_no_deadline() -> None:
    """Who cancels gets the exception, with time left or without."""
    for seconds in (NO_TIME, 1000.0, None):
        with pytest.raises(Interrupted):
            list(hopeless(max_seconds=seconds).steps(stop=lambda: True))


def test_a_study_without_time_ends() -> None:
    """Each number of links flies its guess in the default step."""
    search = SearchSettings(method="pso", swarm=SwarmSettings(50_000, 1000), max_seconds=NO_TIME)
    study = Study(softened(0.25), reference_flight(), [FLIGHT], links=(1, 2), model=TWO, search=search)
    *_, last = study.steps()
    assert [row.model["step_s"] for row in study.result(last.checkpoint).rows] == [STEP_S, STEP_S]


def test_an_optimisation_without_time_ends() -> None:
    """It flies what it has to; the step of its flights is in the checkpoint too."""
    run = optimisation()
    hurried = ScheduleOptimisation(
        run.aircraft,
        run.flight,
        run.parameters,
        morph=run.morph,
        limits=run.limits,
        search=replace(run.search, max_seconds=NO_TIME, iterations=1000, screen=1000),
        verify="none",
    )
    begin = time.monotonic()
    *_, last = hurried.steps()
    assert time.monotonic() - begin < 2 * GRACE_S
    assert last.fraction == 1.0
    assert hurried.step_s == STEP_S


@pytest.mark.parametrize("begin", [hopeless, optimisation])
def test_progress_is_reported_before_the_first_step(begin: Callable[..., Any]) -> None:
    """Who listens hears what is prepared from the first moment, the choice of the time step among it."""
    heard: list[str] = []
    steps: Iterator[Any] = begin().steps(stop=lambda: bool(heard))
    with listening(heard.append), pytest.raises(Interrupted):
        next(steps)
    assert "choosing the time step" in heard[0]
    say("nobody listens")
    assert len(heard) == 1


def test_flights_beyond_the_limit_are_refused_by_a_search() -> None:
    """Samples that nobody read from a file are judged as well: ten minutes, and no more."""
    sample = example("rate_0.8")
    slow = replace(sample, time_s=1000.0 * sample.time_s)
    with pytest.raises(Exception, match="the flight takes 1740 s") as caught:
        Identification(reference_aircraft(), reference_flight(), [slow])
    assert "rows are 10 s apart" in caught.value.hint  # type: ignore[attr-defined]
