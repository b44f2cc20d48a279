"""Lift factors of unlike surfaces that are freed where the flights tell them apart."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from morphcore.identify import Identification, IdentifyResult, SearchSettings
from morphcore.identify.cost import fly_attitudes, sample_cases, shared_trims
from morphcore.identify.evidence import left_out
from morphcore.identify.free_corrections import OWN_LIFT
from morphcore.identify.identification import VERSION
from morphcore.identify.rounds import Prepared
from morphcore.search.checkpoint import unpack
from morphcore.search.run import SearchState
from morphcore.simulate.trajectory import Trajectory
from morphdata.identify import EquivalentModel
from tests.identify.test_links_by_surface import LIFT, LINKS, NOISE_RAD, chain, samples, truth
from tests.models.test_every_surface_its_own import LATTICE, NAMES, aircraft, flight


def identification(flown: tuple[Trajectory, ...], **options: Any) -> Identification:
    """A descent from the physical guess, with what is left out decided from the flights."""
    return Identification(
        aircraft(), flight(), flown,
        EquivalentModel(**{"links_per_wing": LINKS, "lattice": LATTICE, "step_s": 0.01, **options}),
        SearchSettings(method="least_squares", iterations=8),
    )  # fmt: skip


def checkpoints(run: Identification, begin: bytes | None = None) -> list[bytes]:
    """Of all steps."""
    return [step.checkpoint for step in run.steps(begin)]


def further(checkpoint: bytes) -> tuple[str, ...]:
    """What a search has freed by a checkpoint."""
    prepared = unpack(checkpoint, VERSION, SearchState).prepared
    return prepared.further if isinstance(prepared, Prepared) else ()


@cache
def found() -> tuple[Identification, IdentifyResult, list[bytes]]:
    """From flights of an aircraft whose tail has another factor."""
    run = identification(samples())
    every = checkpoints(run)
    return run, run.result(every[-1]), every


def test_factors_that_differ_are_told_apart() -> None:
    """The search frees them by itself, says so, and finds them."""
    run, result, _ = found()
    document = result.to_document()
    assert run.further == (OWN_LIFT,)
    assert document["search"]["own_lift"] == ["tail"]
    value, error = (document["uncertainty"][name] for name in ("value", "standard_error"))
    for name, true in LIFT.items():
        assert abs(value[name] - true) <= 2.0 * error[name], name
    assert "tail.lift_factor" in run.space.names


def test_a_search_resumed_anywhere_ends_the_same() -> None:
    """Before and after the factors are freed, to the bit."""
    _, _, every = found()
    freed = next(k for k, each in enumerate(every) if further(each))
    for checkpoint in every[freed - 1 : freed + 1]:
        again = identification(samples())
        last = checkpoints(again, checkpoint)[-1]
        assert again.state(last).best.tolist() == again.state(every[-1]).best.tolist()


def test_factors_that_are_the_same_stay_one() -> None:
    """Flights of an aircraft with one factor: nothing is gained."""
    run = identification(tuple(_with_one_factor()))
    run.state(checkpoints(run)[-1])
    assert OWN_LIFT not in run.further
    assert "tail.lift_factor" not in run.space.names


def _with_one_factor() -> list[Trajectory]:
    model, rng = chain(), np.random.default_rng(3)
    batch = truth(model).changed(lift_factor=np.array([[1.1, 1.1]]))
    flown = []
    for each in samples():
        ((case, trim),) = shared_trims(model, batch, sample_cases(model, [each]), "trim")
        euler = fly_attitudes(model, batch, case, trim)[0]
        euler = euler + NOISE_RAD * rng.standard_normal(euler.shape)
        flown.append(replace(each, phi=euler[:, 0], theta=euler[:, 1], psi=euler[:, 2]))
    return flown


@pytest.mark.parametrize(("flights", "options"), [(2, {}), (3, {"own_lift": []}), (3, {"links_per_wing": 1})])
def test_what_is_not_tried(flights: int, options: dict[str, Any]) -> None:
    """Two flights cannot judge each other, a request decides by itself, and a rigid wing misses too much."""
    run = identification(samples()[:flights], **options)
    run.state(checkpoints(run)[-1])
    assert OWN_LIFT not in run.further


def test_j_of_flights_left_out() -> None:
    """Of a linear problem it is exact: each flight by a fit of the others."""
    rng = np.random.default_rng(1)
    error, jacobian, offset, weight = rng.normal(size=30), rng.normal(size=(30, 4)), rng.normal(size=4), 0.3
    expected = 0.0
    for own in np.split(np.arange(30), [8, 20]):
        others = np.setdiff1d(np.arange(30), own)
        rows = np.concatenate([jacobian[others], np.sqrt(weight) * np.eye(4)])
        right = np.concatenate([error[others], np.sqrt(weight) * offset])
        change = np.linalg.lstsq(rows, -right, rcond=None)[0]
        expected += np.sum((error[own] + jacobian[own] @ change) ** 2)
    assert left_out(error, jacobian, offset, weight, [8, 20, 30]) == pytest.approx(expected, rel=1e-10)


def test_aircraft_of_one_pair_have_nothing_to_tell() -> None:
    """Their unknowns are as ever."""
    alone = Identification(
        aircraft(NAMES[:2]), flight(), samples(), EquivalentModel(lattice=LATTICE, step_s=0.01)
    )
    assert OWN_LIFT not in alone.spare
