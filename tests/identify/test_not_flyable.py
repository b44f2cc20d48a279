"""A search whose best model flies nothing has no answer: an error with its cause, and no model anywhere."""

from __future__ import annotations

import json
import pickle
from typing import Any

import numpy as np
import pytest

from morphcore.errors import InvalidInput, NotFlyable
from morphcore.identify import Identification, SearchSettings, identify
from morphcore.identify.study import Study
from morphcore.models.parameters_document import parameters_document, parameters_from_document
from morphcore.search.swarm import SwarmSettings
from morphdata.identify import Bounds, EquivalentModel, IdentifySearch
from tests.geometry.test_obstacle import with_modulus
from tests.identify.flights import (
    example,
    reference_aircraft,
    reference_documents,
    reference_flight,
    shortened,
)
from tests.optimise.morphs import last as last_of_morph
from tests.optimise.morphs import optimisation

SOFT = with_modulus(0, 2.1)  # GPa where Pa are asked for
SWARM = SearchSettings(method="pso", seed=1, swarm=SwarmSettings(particles=4, generations=1))
TWO = EquivalentModel(links_per_wing=2)
TRAIN = shortened(example("rate_0.8"), 60)


def ended(run: Any) -> bytes:
    """The last checkpoint of a run."""
    *_, step = run.steps()
    return bytes(step.checkpoint)


def test_a_soft_wing_is_the_cause() -> None:
    """The error names wing and field, says what to check, and survives a process pool."""
    run = Identification(SOFT, reference_flight(), [TRAIN], TWO, SWARM)
    checkpoint = ended(run)
    with pytest.raises(NotFlyable) as caught:
        run.result(checkpoint)
    error = pickle.loads(pickle.dumps(caught.value))  # noqa: S301 - our own
    assert (error.code, error.pointer) == (
        "not_flyable",
        "/aircraft/surfaces/0/material/youngs_modulus_pa",
    )
    assert "right wing" in error.hint
    assert TRAIN.name in error.message


def test_the_best_so_far_of_nothing_holds_no_model() -> None:
    """A cancelled search that has not flown yet says so, keeps no model, and nothing begins from it."""
    run = Identification(SOFT, reference_flight(), [TRAIN], TWO, SWARM)
    checkpoint = next(iter(run.steps())).checkpoint
    document = json.loads(json.dumps(run.best_so_far(checkpoint).to_document(), allow_nan=False))
    assert document["model"] is None
    assert document["uncertainty"]["interval_95"] == {}
    assert document["warnings"][0]["code"] == "not_flyable"
    with pytest.raises(InvalidInput) as caught:
        parameters_from_document(document, "/search/warm_start/parameters")
    assert caught.value.pointer == "/search/warm_start/parameters/model"
    # a result from before, which has the model beside flights that are not there
    old = {**document, "model": parameters_document(run.space.decode(run.space.guess))}
    with pytest.raises(InvalidInput):
        parameters_from_document(old)
    old["fit"][0]["J_identified"] = 0.1
    assert parameters_from_document(old).links == 2


def test_bounds_that_let_nothing_fly_are_the_cause() -> None:
    """A wing that is right and bounds that make it soft: the hint is about the bounds."""
    soft = TWO.model_copy(update={"bounds": Bounds(stiffness_nm_rad=[1e-3, 1e-2])})
    with pytest.raises(NotFlyable) as caught:
        identify(
            *reference_documents(),
            [TRAIN],
            model=soft,
            search=IdentifySearch(method="pso", particles=4, generations=1),
        )
    assert caught.value.pointer == "/model/bounds"


def test_a_held_out_flight_may_diverge(monkeypatch: pytest.MonkeyPatch) -> None:
    """The model is an answer all the same: a warning points to the sample, whose errors are null."""
    held_out = shortened(example("asymmetric", "held_out"), 60)
    run = Identification(reference_aircraft(), reference_flight(), [TRAIN, held_out], TWO, SWARM)
    checkpoint = ended(run)
    from morphcore.identify import result

    flown = result._attitudes

    def lost(model: Any, batch: Any, cases: Any, start: Any) -> Any:
        """The same flights, but the second one's second half."""
        attitudes = flown(model, batch, cases, start)
        for attitude in attitudes[1:]:  # of the guess and the best; the rigid model flies alone
            attitude[1:, 30:] = np.nan
        return attitudes

    monkeypatch.setattr(result, "_attitudes", lost)
    document = run.result(checkpoint).to_document()
    assert document["model"]["links_per_wing"] == 2
    (warning,) = [w for w in document["warnings"] if w["code"] == "diverged"]
    assert warning["pointer"] == "/samples/1"
    assert f"{held_out.time_s[30]:.2f} s" in warning["message"]
    assert document["fit"][1]["J_identified"] is None
    json.dumps(document, allow_nan=False)


def test_a_study_keeps_the_sizes_that_fly() -> None:
    """Of a soft wing the rigid model alone flies: it is recommended, the other row holds no model."""
    run = Study(SOFT, reference_flight(), [TRAIN], links=(2, 1), search=SWARM)
    found = run.result(ended(run))
    rows = {row.links_per_wing: row for row in found.rows}
    assert found.recommended.links_per_wing == 1
    assert (rows[2].model, rows[2].flight_s, rows[2].J_train) == (None, None, None)
    assert rows[2].warnings[0]["code"] == "not_flyable"
    assert rows[1].flight_s is not None
    with pytest.raises(NotFlyable):
        _ = rows[2].batch
    document = found.to_document()
    assert document["warnings"] == rows[1].warnings
    json.dumps(document, allow_nan=False)


def test_a_study_of_nothing_that_flies_fails() -> None:
    """Without any size that flies there is nothing to recommend."""
    run = Study(SOFT, reference_flight(), [TRAIN], links=(2, 3), search=SWARM)
    with pytest.raises(NotFlyable) as caught:
        run.result(ended(run))
    assert caught.value.pointer == "/aircraft/surfaces/0/material/youngs_modulus_pa"


def test_a_morph_that_never_flies_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where every flight diverges, a search ends with an error, and its best so far holds no schedule."""
    from morphcore.optimise.flights import MorphFlights

    flown = MorphFlights._one

    def lost(self: MorphFlights, *args: Any, **options: Any) -> Any:
        """The same flight, but its second half."""
        attitude, torque = flown(self, *args, **options)
        attitude[attitude.shape[0] // 2 :] = np.nan
        return attitude, torque

    monkeypatch.setattr(MorphFlights, "_one", lost)
    run = optimisation()
    document = run.best_so_far(next(iter(run.steps())).checkpoint).to_document()
    assert document["schedule"] is None
    assert document["variation"]["optimum"]["equivalent"] is None
    assert "not_flyable" in [warning["code"] for warning in document["warnings"]]
    json.dumps(document, allow_nan=False)
    with pytest.raises(NotFlyable):
        last_of_morph(optimisation())


def test_joints_that_are_too_soft_are_named() -> None:
    """An optimisation with a model whose joints carry nothing: its parameters are the cause, not the wing."""
    run = optimisation(links=2)
    soft = run.parameters.changed(stiffness_nm_rad=1e-3 * run.parameters["stiffness_nm_rad"])
    weak = type(run)(
        reference_aircraft(), reference_flight(), soft, morph=run.morph, limits=run.limits, verify="none"
    )
    with pytest.raises(NotFlyable) as caught:
        last_of_morph(weak)
    assert caught.value.pointer == "/model/parameters/stiffness_nm_rad"
    assert "joint 1" in caught.value.hint
