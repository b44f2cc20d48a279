"""Identification from start to end: known parameters, resumption, interruption, documents, errors."""

from __future__ import annotations

import itertools
import json
import os
import subprocess
import sys
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from morphcore.errors import InvalidInput
from morphcore.identify import (
    Identification,
    Interrupted,
    SearchSettings,
    Step,
    identification_from_request,
)
from morphcore.identify.cost import costs, evaluate, sample_cases, shared_trims
from morphcore.identify.parameters import search_space
from morphcore.models.equivalent import chain_model, physical_guess
from morphcore.search.checkpoint import UnreadableCheckpoint
from morphcore.search.evolution import EvolutionSettings
from morphcore.search.swarm import SwarmSettings
from morphcore.simulate.time_grid import STEP_S
from morphcore.threads import thread_count
from morphdata.identify import EquivalentModel, IdentifyRequest
from tests.identification_request import identification
from tests.identify.flights import (
    EXAMPLES,
    chosen_rows,
    example,
    reference_aircraft,
    reference_flight,
    shortened,
    synthetic,
)

TWO = EquivalentModel(links_per_wing=2)
QUICK = SearchSettings(seed=3, screen=32, starts=3, iterations=6)
SWARM = SearchSettings(method="pso", seed=3, swarm=SwarmSettings(particles=16, generations=4))
EVOLUTION = SearchSettings(method="cma", seed=3, evolution=EvolutionSettings(particles=16, generations=4))


def quick(search: SearchSettings = QUICK, **options: Any) -> Identification:
    """A small identification: two links, one second of one flight."""
    samples = [shortened(example("rate_0.8"), 120)]
    return Identification(reference_aircraft(), reference_flight(), samples, TWO, search, **options)


def last(run: Identification, checkpoint: bytes | None = None) -> Step:
    """The last step of a run."""
    *_, step = run.steps(checkpoint)
    return step


def without_times(document: dict[str, Any]) -> dict[str, Any]:
    """A result document without what a clock put into it."""
    search = {key: value for key, value in document["search"].items() if key != "wall_s"}
    return {**document, "search": search, "cost": None}


def test_finds_the_parameters_that_flew_the_sample() -> None:
    """From flights of a two-link model with known parameters, the identification flies as they did.

    What the attitudes determine well (flap stiffness, lift factor) comes back within 3 per cent; J falls by
    five orders.
    """
    model = chain_model(reference_aircraft(), reference_flight(), 2)
    space = search_space(model)
    truth = space.guess + np.random.default_rng(2).normal(0.0, 0.25, space.dimension)
    batch = space.decode(np.clip(truth, space.lower, space.upper))
    samples = [
        synthetic(batch, name="together"),
        synthetic(batch, name="apart", left_rad=0.3, right_rad=0.5),
    ]
    # with the step that flew the samples: another would leave its own error in J
    same_step = TWO.model_copy(update={"step_s": STEP_S})
    run = Identification(
        reference_aircraft(), reference_flight(), samples, same_step, replace(QUICK, iterations=25)
    )
    result = run.result(last(run).checkpoint)
    for fit in result.fits:
        assert fit.J("identified") < 1e-5 * fit.J("initial")  # type: ignore[operator]
    found = result.parameters
    np.testing.assert_allclose(
        found["stiffness_nm_rad"][0, 0, 0, 0], batch["stiffness_nm_rad"][0, 0, 0, 0], rtol=0.03
    )
    np.testing.assert_allclose(found["lift_factor"], batch["lift_factor"], rtol=0.03)


@pytest.mark.parametrize("search", [QUICK, SWARM, EVOLUTION, replace(QUICK, method="least_squares")])
def test_resumes_from_any_step_to_the_identical_result(search: SearchSettings) -> None:
    """A search cut off after any step and begun again from its bytes ends as the undisturbed one."""
    steps = list(quick(search).steps())
    whole = without_times(quick(search).result(steps[-1].checkpoint).to_document())
    for cut in (0, len(steps) // 2, len(steps) - 2):
        resumed = quick(search)
        ended = last(resumed, steps[cut].checkpoint)
        assert without_times(resumed.result(ended.checkpoint).to_document()) == whole


def test_looks_elsewhere_only_where_the_guess_leads_to_a_poor_fit() -> None:
    """Two links descend from the physical guess to a good fit: no candidate is flown, whatever the seed.

    One link cannot fit a flexible wing: "hybrid" looks for another valley, "least_squares" does not, and what
    was found before is kept.
    """
    phases = [[row["phase"] for row in quick().state(last(quick()).checkpoint).history]]
    ends = {}
    for method in ("least_squares", "hybrid"):
        run = Identification(
            reference_aircraft(),
            reference_flight(),
            [shortened(example("rate_0.8"), 120)],
            EquivalentModel(links_per_wing=1),
            replace(QUICK, method=method),  # type: ignore[arg-type]
        )
        step = last(run)
        phases.append([row["phase"] for row in run.state(step.checkpoint).history])
        ends[method] = step.best_cost
    assert ["screen" in listed for listed in phases] == [False, False, True]
    assert ends["hybrid"] <= ends["least_squares"]


def test_every_step_has_a_result() -> None:
    """From the first step on there is a best so far; it only gets better, and the fraction rises to one."""
    run = quick()
    steps = list(run.steps())
    best = [step.best_cost for step in steps]
    assert all(after <= before for before, after in itertools.pairwise(best))
    fractions = [step.fraction for step in steps]
    assert fractions == sorted(fractions)
    assert fractions[-1] == 1.0
    first = run.result(steps[0].checkpoint).to_document()
    assert first["fit"][0]["J_identified"] == pytest.approx(first["fit"][0]["J_initial"])
    assert json.loads(json.dumps(first, allow_nan=False)) == first


def test_stop_interrupts_between_chunks() -> None:
    """A stop that turns true within a generation ends the search there; earlier steps stay valid."""
    requested = 0

    def stop() -> bool:
        nonlocal requested
        requested += 1
        return requested > 8

    run, done = quick(), []
    with pytest.raises(Interrupted):
        done.extend(run.steps(stop=stop))
    assert 9 <= requested < 9 + thread_count()  # each thread ends at its own next chunk


def test_time_budget_ends_the_search_with_its_best() -> None:
    """When ``max_seconds`` are used up the present step is the last, as a clock that jumps shows."""
    ticks = iter(range(0, 10**6, 60))
    run = quick(replace(QUICK, max_seconds=100.0), clock=lambda: float(next(ticks)))
    steps = list(run.steps())
    assert len(steps) == 2
    assert steps[-1].fraction == 1.0
    assert run.result(steps[-1].checkpoint).search["finished"]


def test_angles_are_compared_around_the_circle() -> None:
    """A heading of +179.9 degrees against -179.9 is an error of 0.2 degrees, not of 359.8."""
    model = chain_model(reference_aircraft(), reference_flight(), 1)
    batch = physical_guess(model)
    sample = synthetic(batch)
    turned = replace(sample, psi=sample.psi + np.pi - 1e-3)
    measured = replace(
        turned, psi=np.where(np.arange(turned.psi.size) > 0, turned.psi + 2e-3 - 2 * np.pi, turned.psi)
    )
    (case,) = sample_cases(model, [measured])
    ((_, found),) = shared_trims(model, batch, [case], "trim")
    errors = evaluate(model, batch, case, found).errors[0, :, 2]
    # what they have in common is the heading to begin with
    np.testing.assert_allclose(errors[1:] - errors[0], -2e-3, atol=1e-9)


def test_a_diverged_flight_costs_much_but_not_infinity() -> None:
    """Parameters with which nothing flies cost much but not infinity, and leave their neighbours alone."""
    model = chain_model(reference_aircraft(), reference_flight(), 2)
    guess = physical_guess(model)
    wild = guess.changed(lift_factor=np.array([1e6]))
    both = guess.changed(
        **{name: np.concatenate([value, wild[name]]) for name, value in guess.values.items()}
    )
    cases = sample_cases(model, [shortened(example("rate_0.8"), 60)])
    pair, alone = costs(model, both, cases, "trim"), costs(model, guess, cases, "trim")
    assert pair[0] == alone[0]
    assert 1.0 < pair[1] < 1e6


def test_uneven_sample_times_give_the_same_errors() -> None:
    """A sample with rows left out at random is met as well as the whole one.

    Tolerance: cubic interpolation between steps of 5 ms, far below a microradian on flights of a few hertz.
    """
    model = chain_model(reference_aircraft(), reference_flight(), 2)
    batch = physical_guess(model)
    sample = synthetic(batch)
    kept = np.sort(np.random.default_rng(4).choice(np.arange(1, sample.time_s.size - 1), 60, replace=False))
    kept = np.concatenate([[0], kept, [sample.time_s.size - 1]])
    thinned = chosen_rows(sample, kept)
    (whole,) = sample_cases(model, [sample])
    (uneven,) = sample_cases(model, [thinned])
    assert uneven.plan.grid.at is None
    # the same hinge motion: what is compared is the interpolation of the flight, not of the sweep
    same = replace(uneven, plan=replace(whole.plan, grid=replace(whole.plan.grid, at=None)))
    ((_, found),) = shared_trims(model, batch, [whole], "trim")
    assert np.abs(evaluate(model, batch, same, found).errors).max() < 1e-6


def test_held_out_samples_do_not_change_the_fit() -> None:
    """What is held out is reported, not fitted: the identified model is the same with and without it."""
    train, other = shortened(example("rate_0.8"), 120), shortened(example("rate_0.5", "held_out"), 120)
    results = []
    for samples in ([train], [train, other]):
        run = Identification(reference_aircraft(), reference_flight(), samples, TWO, QUICK)
        results.append(run.result(last(run).checkpoint).to_document())
    assert results[0]["model"] == results[1]["model"]
    assert [fit["role"] for fit in results[1]["fit"]] == ["train", "held_out"]


def test_one_link_has_only_corrections_to_find() -> None:
    """The rigid model can be identified too: without joints only the corrections that show are searched."""
    samples = [shortened(example("rate_0.8"), 60)]
    run = Identification(
        reference_aircraft(), reference_flight(), samples, EquivalentModel(links_per_wing=1), QUICK
    )
    document = run.result(last(run).checkpoint).to_document()
    assert run.space.names == ("lift_factor", "ac_offset_m", "lag_s")
    assert document["model"]["stiffness_nm_rad"] == []


def test_request_document_runs() -> None:
    """The body of POST /identify, as the clients send it, becomes an identification."""
    request = identification(
        "train_rate_0.8", links=2, search={"method": "pso", "particles": 4, "generations": 1}
    )
    run = identification_from_request(IdentifyRequest.parse(request))
    document = run.result(last(run).checkpoint).to_document()
    assert set(document) == {
        *("model", "fit", "uncertainty", "measurement", "search", "cost", "verdict", "warnings")
    }
    assert document["search"]["method"] == "pso"


def test_paper_preset_is_the_papers_swarm() -> None:
    """``preset: paper`` means 2500 particles with c1 = c2 = 1."""
    request = identification("train_rate_0.8", search={"preset": "paper", "generations": 20})
    search = identification_from_request(IdentifyRequest.parse(request)).search
    assert (search.method, search.swarm.particles, search.swarm.c1, search.swarm.c2) == (
        "pso",
        2500,
        1.0,
        1.0,
    )
    assert search.swarm.generations == 20


@pytest.mark.parametrize(
    ("change", "pointer"),
    [
        ({"samples": []}, "/samples"),
        ({"samples": "train"}, "/samples"),
        ({"model": {"links_per_wing": 17}}, "/model/links_per_wing"),
        ({"model": {"link_count": 3}}, "/model/link_count"),
        ({"model": {"lattice": {"chordwise": 0}}}, "/model/lattice/chordwise"),
        ({"model": {"lattice": {"core": {"law": "soft"}}}}, "/model/lattice/core/law"),
        ({"search": {"method": "magic"}}, "/search/method"),
        ({"search": {"seed": -1}}, "/search/seed"),
        ({"search": {"inertia": 1e400}}, "/search/inertia"),
        ({"flight": {"airspeed_m_s": 0.0}}, "/flight/airspeed_m_s"),
        ({"model": {"bounds": {"stiffness_nm_rad": [1]}}}, "/model/bounds/stiffness_nm_rad"),
        ({"thing": 1}, "/thing"),
    ],
)
def test_bad_requests_name_the_field(change: dict[str, Any], pointer: str) -> None:
    """What is wrong in a request is said with a pointer to it and a hint."""
    request = identification("train_rate_0.8") | change
    with pytest.raises(InvalidInput) as caught:
        identification_from_request(IdentifyRequest.parse(request))
    assert caught.value.pointer == pointer
    assert caught.value.hint


@pytest.mark.parametrize(
    ("column", "row", "value", "pointer"),
    [
        ("theta_rad", 5, float("nan"), "/samples/0/theta_rad/5"),
        ("time_s", 7, 0.0, "/samples/0/time_s/7"),
        ("sweep_left_rad", 9, 2.0, "/samples/0/sweep_left_rad/9"),
    ],
)
def test_bad_rows_are_named(column: str, row: int, value: float, pointer: str) -> None:
    """A bad number in a sample is named to its row."""
    request = identification("train_rate_0.8")
    request["samples"][0][column][row] = value
    with pytest.raises(InvalidInput) as caught:
        list(identification_from_request(IdentifyRequest.parse(request)).steps())
    assert caught.value.pointer == pointer


def test_a_damaged_checkpoint_is_refused() -> None:
    """Bytes that are no checkpoint give an error of the library, not of zip or JSON."""
    good = next(iter(quick().steps())).checkpoint
    for bad in (b"", b"nonsense", good[: len(good) // 2]):
        with pytest.raises(UnreadableCheckpoint):
            quick().best_so_far(bad)


def test_examples_are_what_the_tests_read() -> None:
    """The example flights stand where the documents say."""
    assert (EXAMPLES / "aircraft.json").exists()


def test_the_number_of_threads_does_not_change_the_answer() -> None:
    """One or two threads, of kernels and of linear algebra, give the same model and fit, to the bit."""
    code = (
        "import json;"
        "from morphcore.identify import identification_from_request as begin;"
        "from morphdata.identify import IdentifyRequest;"
        "from tests.identification_request import identification as ask;"
        "request = ask('train_rate_0.8', links=2, search={'particles': 24, 'generations': 3});"
        "run = begin(IdentifyRequest.parse(request), {threads});"
        "*_, step = run.steps(); found = run.result(step.checkpoint).to_document();"
        "print(json.dumps([found['model'], found['fit']]))"
    )
    answers = [
        subprocess.run(
            [sys.executable, "-c", code.replace("{threads}", threads)],
            cwd=EXAMPLES.parent,
            env=os.environ | {"OPENBLAS_NUM_THREADS": threads, "NUMBA_NUM_THREADS": threads},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for threads in ("1", "2")
    ]
    assert answers[0] == answers[1]
