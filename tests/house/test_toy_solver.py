"""A search method added in one module: it identifies and optimises to the end, and resumes to the bit."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from morphcore.errors import InvalidInput
from morphcore.identify import Identification, SearchSettings
from morphcore.optimise import Limits
from morphcore.optimise.settings import ScheduleSettings
from morphcore.search import methods
from morphcore.search.solver import Batch, Outcome, Problem, Solver
from morphdata.identify import EquivalentModel
from tests.identify.flights import example, reference_aircraft, reference_flight, shortened
from tests.optimise.morphs import SHORT, optimisation

State = dict[str, Any]  # a plain value


class RandomSearch(Solver[State, Outcome]):
    """Draws points evenly from the box, a batch at a time: all that a method has to be."""

    name = "random"

    def __init__(self, problem: Problem[Any], settings: Any) -> None:
        self._problem, self._seed = problem, settings.seed

    def init(self, known: Outcome) -> State:
        """Nothing drawn yet."""
        return {"drawn": 0, "coordinates": known.points.shape[1]}

    def ask(self, state: State) -> Batch:
        """Twenty points."""
        unit = np.random.default_rng([self._seed, state["drawn"]]).uniform(size=(20, state["coordinates"]))
        return Batch(self._problem.box.from_unit(self._problem.arranged(unit)))

    def tell(self, state: State, outcome: Outcome) -> State:  # noqa: ARG002 - it learns nothing
        """Go on to the next batch."""
        return {**state, "drawn": state["drawn"] + 1}

    def done(self, state: State) -> bool:
        """Three batches are enough."""
        return bool(state["drawn"] == 3)


@pytest.fixture(autouse=True)
def _registered(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(methods, "METHODS", dict(methods.METHODS))
    methods.register("random", RandomSearch)


def identification(method: str = "random") -> Identification:
    """One flight, two links."""
    settings = SearchSettings(method=method, seed=4)  # type: ignore[arg-type]
    samples = [shortened(example("rate_0.8"), 60)]
    return Identification(
        reference_aircraft(), reference_flight(), samples, EquivalentModel(links_per_wing=2), settings
    )


def timeless(document: dict[str, Any]) -> dict[str, Any]:
    """A result document without what a clock put into it."""
    search = {name: value for name, value in document["search"].items() if not name.endswith("_s")}
    return {**document, "search": search, "cost": None}


def test_it_identifies_and_resumes() -> None:
    """The job's result holds its steps; cut off after the second it ends as the whole does."""
    run = identification()
    steps = list(run.steps())
    whole = run.result(steps[-1].checkpoint).to_document()
    assert [row["phase"] for row in whole["search"]["history"]] == ["baseline", "random", "random", "random"]
    assert whole["search"]["finished"]
    assert whole["search"]["method"] == "random"
    resumed = identification()
    *_, last = resumed.steps(steps[1].checkpoint)
    assert timeless(resumed.result(last.checkpoint).to_document()) == timeless(whole)


def test_others_fly_its_batches() -> None:
    """A spread job needs nothing of the method: its batches are flown in parts, to the same steps."""
    steps = list(identification().steps())
    step = steps[0]
    for expected in steps[1:]:
        run = identification()
        task = run.task(step.checkpoint)
        assert task is not None
        step = run.tell(step.checkpoint, np.concatenate([run.task_costs(part) for part in task.parts(2)]))
        assert replace(step, checkpoint=b"") == replace(expected, checkpoint=b"")


@pytest.mark.parametrize(
    "limits", [Limits(max_rate_rad_s=0.9), Limits(max_rate_rad_s=0.9, max_hinge_torque_nm=560.0)]
)
def test_it_optimises_within_the_limits_and_resumes(limits: Limits) -> None:
    """Its schedules are drawn back to the limits, the torque's too, without knowing of any."""
    settings = ScheduleSettings(method="random", seed=4)  # type: ignore[arg-type]
    run = optimisation(SHORT, limits, search=settings)
    steps = list(run.steps())
    whole = run.result(steps[-1].checkpoint).to_document()
    assert "random" in {row["phase"] for row in whole["search"]["history"]}
    assert whole["reached"]["optimum"]["max_rate_rad_s"] <= 0.9
    if limits.max_hinge_torque_nm is not None:
        assert whole["reached"]["optimum"]["max_hinge_torque_nm"] <= 560.0
    resumed = optimisation(SHORT, limits, search=settings)
    *_, last = resumed.steps(steps[len(steps) // 2].checkpoint)
    assert timeless(resumed.result(last.checkpoint).to_document()) == timeless(whole)


def test_schedules_are_searched_by_the_same_strategies() -> None:
    """CMA-ES, which identifications use, lowers the variation of a morph too."""
    settings = ScheduleSettings(method="cma", seed=4)  # type: ignore[arg-type]
    run = optimisation(
        search=replace(settings, evolution=replace(settings.evolution, particles=8, generations=4))
    )
    steps = list(run.steps())
    assert {step.phase for step in steps} == {"baseline", "evolution"}
    equivalent = [step.best_cost for step in steps if "equivalent" in step.message]
    assert equivalent[-1] < equivalent[0]


def test_an_unknown_method_is_named() -> None:
    """With the methods that there are."""
    with pytest.raises(InvalidInput, match="magic") as caught:
        next(identification("magic").steps())
    assert "hybrid, least_squares, pso, random" in caught.value.hint
