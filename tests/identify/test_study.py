"""The study over the number of links: resumption, interruption, time, requests, and the example flights."""

from __future__ import annotations

import itertools
import json
from typing import Any

import numpy as np
import pytest

from morphcore.errors import InvalidInput
from morphcore.identify import Identification, Interrupted, SearchSettings, Step
from morphcore.identify.study import Study, study, study_from_request
from morphcore.identify.study_timing import ROUNDS, timed_flight
from morphcore.search.checkpoint import UnreadableCheckpoint
from morphdata.identify import EquivalentModel, IdentifySearch
from morphdata.study import StudyRequest
from tests.identification_request import identification
from tests.identify.flights import (
    example,
    reference_aircraft,
    reference_documents,
    reference_flight,
    shortened,
)
from tests.simulate.flights import fly

QUICK = SearchSettings(seed=3, screen=16, starts=2, iterations=3)
TRAIN = shortened(example("rate_0.8"), 80)
HELD_OUT = shortened(example("asymmetric", "held_out"), 80)
CLOCKED = ("wall_s", "identify_s", "flight_s", "plan_s")


def quick(*links: int, search: SearchSettings = QUICK, **options: Any) -> Study:
    """A small study: 0.8 s of one flight to fit, as much of another one held out."""
    return Study(
        reference_aircraft(),
        reference_flight(),
        [TRAIN, HELD_OUT],
        links=links or (1, 2),
        search=search,
        **options,
    )


def timeless(value: Any) -> Any:
    """A document without what a clock put into it, the sentence that cites it included."""
    if isinstance(value, dict):
        return {key: timeless(item) for key, item in value.items() if key not in (*CLOCKED, "reason")}
    return [timeless(item) for item in value] if isinstance(value, list) else value


@pytest.fixture(scope="module")
def undisturbed() -> tuple[Study, list[Step]]:
    """A small study that went through, with all its steps."""
    run = quick()
    return run, list(run.steps())


def test_resumes_from_any_step_to_the_identical_result(undisturbed: tuple[Study, list[Step]]) -> None:
    """A study cut off within an identification, between two, or while timing ends as the undisturbed one."""
    run, steps = undisturbed
    whole = timeless(run.result(steps[-1].checkpoint).to_document())
    first_result = next(i for i, step in enumerate(steps) if step.phase == "result")
    for cut in (1, first_result - 1, first_result, len(steps) - 3):
        resumed = quick()
        *_, ended = resumed.steps(steps[cut].checkpoint)
        assert timeless(resumed.result(ended.checkpoint).to_document()) == whole


def test_each_row_is_the_identification_of_its_own(undisturbed: tuple[Study, list[Step]]) -> None:
    """The study finds, for each number of links, what an identification alone finds, to the bit."""
    run, steps = undisturbed
    rows = run.result(steps[-1].checkpoint).to_document()["rows"]
    assert [row["links_per_wing"] for row in rows] == [1, 2]
    for row in rows:
        settings = EquivalentModel(links_per_wing=row["links_per_wing"])
        alone = Identification(reference_aircraft(), reference_flight(), [TRAIN, HELD_OUT], settings, QUICK)
        *_, last = alone.steps()
        found = alone.result(last.checkpoint).to_document()
        assert row["model"] == found["model"]
        assert row["fit"] == found["fit"]
        assert row["flights"] == found["search"]["flights"]
        assert row["J_train"] == found["fit"][0]["J_identified"]
        assert row["J_held_out"] == found["fit"][1]["J_identified"]
        assert row["rms_rad"] == pytest.approx(found["fit"][1]["rms_rad"])
        assert row["parameters"] == alone.space.dimension
    assert [row["bodies"] for row in rows] == [3, 5]


def test_progress_rises_to_the_end(undisturbed: tuple[Study, list[Step]]) -> None:
    """Fraction, steps and flights rise; the last steps are the timing rounds; the flights add up."""
    run, steps = undisturbed
    for name in ("fraction", "generation", "flights"):
        values = [getattr(step, name) for step in steps]
        assert values == sorted(values), name
    assert steps[-1].fraction == 1.0
    assert all(step.fraction < 1.0 for step in steps[:-1])
    assert [step.phase for step in steps[-ROUNDS:]] == ["timing"] * ROUNDS
    found = run.result(steps[-1].checkpoint)
    assert steps[-1].flights == sum(row.flights for row in found.rows)
    assert found.search["finished"]


def test_a_document_says_it_all(undisturbed: tuple[Study, list[Step]]) -> None:
    """The document is plain JSON; J of the rigid model and positive times of flight are in it."""
    run, steps = undisturbed
    document = run.result(steps[-1].checkpoint).to_document()
    assert json.loads(json.dumps(document, allow_nan=False)) == document
    assert document["rigid"]["J_train"] == document["rows"][0]["fit"][0]["J_rigid"]
    assert document["rigid"]["J_held_out"] == document["rows"][0]["fit"][1]["J_rigid"]
    times = [row["flight_s"] for row in document["rows"]] + [document["rigid"]["flight_s"]]
    assert all(0.0 < seconds < 2.0 for seconds in times)
    assert document["cost"]["flight_duration_s"] == 2.0
    assert document["cost"]["threads"] == 1
    assert document["recommended"]["links_per_wing"] in (1, 2)


def test_the_models_of_a_study_fly(undisturbed: tuple[Study, list[Step]]) -> None:
    """A row's parameters fly the fitted sample with the J that the row states.

    Tolerance: the simulator makes a plan of its own, with rows where the sample has them.
    """
    run, steps = undisturbed
    row = run.result(steps[-1].checkpoint).row(2)
    flown = fly(reference_aircraft(), reference_flight(), TRAIN, model=row.batch).trajectory
    J = np.sum((flown.euler - TRAIN.euler) ** 2)
    assert row.J_train == pytest.approx(J, rel=1e-6)


def test_every_step_has_rows(undisturbed: tuple[Study, list[Step]]) -> None:
    """A study cut off anywhere gives what is known: finished rows, and the best so far of the running one."""
    run, steps = undisturbed
    first = run.best_so_far(steps[0].checkpoint)
    assert [row.finished for row in first.rows] == [False]
    assert first.recommended.links_per_wing is None
    second = next(i for i, step in enumerate(steps) if step.phase == "result") + 2
    begun = run.best_so_far(steps[second].checkpoint)
    assert [row.finished for row in begun.rows] == [True, False]
    assert begun.recommended.links_per_wing == 1, "one that is not finished is not recommended"
    assert begun.rows[1].flight_s is None
    assert not begun.search["finished"]
    assert json.dumps(begun.to_document(), allow_nan=False)


def test_stop_interrupts_between_chunks(undisturbed: tuple[Study, list[Step]]) -> None:
    """A stop that turns true ends the study at once, in a search as in a round of timing."""
    requested = itertools.count()
    with pytest.raises(Interrupted):
        list(quick().steps(stop=lambda: next(requested) > 5))
    _, steps = undisturbed
    with pytest.raises(Interrupted):
        list(quick().steps(steps[-3].checkpoint, stop=lambda: True))


def test_the_time_is_divided_by_unknowns() -> None:
    """Four unknowns and eleven share 85 s as 5 to 12; what the first leaves over the second one has.

    The clock jumps by four seconds at every look, so that the searches end by their budgets.
    """
    ticks = itertools.count(0.0, 4.0)
    run = quick(search=SearchSettings(seed=3, screen=16, starts=2, iterations=40, max_seconds=85.0),
                clock=lambda: next(ticks))  # fmt: skip
    steps = list(run.steps())
    rows = run.result(steps[-1].checkpoint).rows
    assert all(row.finished for row in rows)
    assert rows[0].identify_s == pytest.approx(85.0 * 5 / 17, abs=4.0)
    assert rows[1].identify_s <= 85.0


def test_the_timed_flight_lasts_two_seconds() -> None:
    """It follows the sweep that moves most, from its start, and is held where a shorter sample ends."""
    slow, fast = example("rate_0.2"), shortened(example("rate_0.8"), 101)
    flight = timed_flight(reference_aircraft(), [slow, fast])
    assert flight.duration_s == pytest.approx(2.0)
    np.testing.assert_allclose(flight.sweep_left[:101], fast.sweep_left, atol=1e-12)
    np.testing.assert_array_equal(flight.sweep_left[101:], fast.sweep_left[-1])


def test_a_request_document_runs() -> None:
    """The body of POST /study is an identification's with a list of links; one to six if none is given."""
    request = identification("train_rate_0.8", search={"particles": 8, "generations": 1, "seed": 5})
    request["model"] = {"links_per_wing": [2, 1], "lattice": {"chordwise": 1, "spanwise": 4}}
    run = study_from_request(StudyRequest.parse(request))
    assert run.links == (2, 1)
    assert run.search.seed == 5
    *_, last = run.steps()
    rows = run.result(last.checkpoint).to_document()["rows"]
    assert [row["links_per_wing"] for row in rows] == [1, 2], "rows rise, in whatever order they were asked"
    assert rows[0]["model"]["lattice"]["chordwise"] == 1
    del request["model"]
    assert study_from_request(StudyRequest.parse(request)).links == (1, 2, 3, 4, 5, 6)


def test_bad_requests_name_the_field() -> None:
    """What is wrong in a request is said with a pointer to it and a hint."""
    lists = {
        "": [],
        "/1": [1, 17],
        "/0": [0],
        "/2": [1, 2, 1],
        "/3": [1, 2, 3, 2.5],
    }
    cases: list[tuple[Any, str]] = [(value, f"/model/links_per_wing{at}") for at, value in lists.items()]
    cases += [(3, "/model/links_per_wing"), ([True], "/model/links_per_wing/0")]
    for links, pointer in cases:
        request = identification("train_rate_0.8") | {"model": {"links_per_wing": links}}
        with pytest.raises(InvalidInput) as caught:
            study_from_request(StudyRequest.parse(request))
        assert caught.value.pointer == pointer
        assert caught.value.hint
    request = identification("train_rate_0.8")
    request["model"] = {"links_per_wing": [2, 6], "bounds": {"division": [0.2, 0.9]}}
    with pytest.raises(InvalidInput) as caught:
        study_from_request(StudyRequest.parse(request))
    assert caught.value.pointer == "/model/bounds/division/0", "six links have no room; two have"
    for request in ([], {"model": []}, identification("train_rate_0.8") | {"thing": 1}):
        with pytest.raises(InvalidInput):
            study_from_request(StudyRequest.parse(request))


def test_a_foreign_checkpoint_is_refused(undisturbed: tuple[Study, list[Step]]) -> None:
    """Bytes that are no checkpoint, or that of a study of other links, give an error of the library."""
    _, steps = undisturbed
    good = steps[2].checkpoint
    for bad in (b"", b"nonsense", b"{}", b"[1]", good[: len(good) // 2]):
        with pytest.raises(UnreadableCheckpoint):
            next(iter(quick().steps(bad)))
    with pytest.raises(UnreadableCheckpoint, match="links"):
        next(iter(quick(2, 3).steps(good)))


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
def test_the_example_flights_want_few_links(seed: int) -> None:
    """Fitted to three morphs at 0.2 to 0.8 rad/s, judged by an asymmetric one: two to four links.

    From one link to three J falls by more than a factor of 1000, fitted and held out, and every model of two
    links or more predicts the asymmetric flight with less than 1e-3 of the rigid model's J, three links every
    angle within 0.6 mrad. More links gain little, and harm little: of their parameters the flights, whose
    residuals are correlated, see a third with three links at least, less than a quarter with six. The cost
    of a flight rises with the links, by less than their number.
    """
    samples = [example(name) for name in ("rate_0.2", "rate_0.5", "rate_0.8")]
    samples.append(example("asymmetric", "held_out"))
    search = IdentifySearch(seed=seed)
    document = study(*reference_documents(), samples, search=search).to_document()
    for row in document["rows"]:
        print({name: value for name, value in row.items() if name not in ("fit", "model")})
    print(document["rigid"], document["recommended"])
    one, two, three, four, five, six = document["rows"]
    for role in ("J_train", "J_held_out"):
        assert three[role] < 1e-3 * one[role]
    for row in (two, three, four, five, six):
        assert row["J_held_out"] < 1e-3 * document["rigid"]["J_held_out"]
    assert max(three["rms_rad"].values()) < 0.6e-3
    assert three["unseen_directions"] < three["parameters"] * 2 / 3
    assert six["unseen_directions"] > six["parameters"] * 3 / 4
    assert six["J_held_out"] < 2.0 * three["J_held_out"]
    assert document["recommended"]["links_per_wing"] in (2, 3, 4)
    assert document["recommended"]["judged_by"] == "held_out"
    assert one["flight_s"] < six["flight_s"] < 6.0 * one["flight_s"]
