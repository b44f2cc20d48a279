"""Links per wing, and lift factors, that differ by surface."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from morphcore.aero.kernels.loads import L_LIFT
from morphcore.errors import InvalidInput
from morphcore.models.equivalent import (
    ChainModel,
    ParameterBatch,
    fitted,
    lane_constants,
    physical_guess,
)
from morphcore.models.kernels.layout import LINKS_C
from morphcore.models.parameters_document import parameters_document, parameters_from_document
from morphcore.multibody.kernels.articulated import LINK_ROWS
from morphcore.simulate.flight import Simulation
from morphcore.simulate.schedule import ConstantRate
from morphdata.links import LinksPerWing
from tests.models.test_every_surface_its_own import (
    LATTICE,
    NAMES,
    ORDERS,
    ROUND_OFF_RAD,
    aircraft,
    flight,
)
from tests.models.test_every_surface_its_own import chain as four_surfaces
from tests.simulate.flights import fly

UNLIKE: LinksPerWing = {"wing": 4, "tail": 1}
MIRROR_RAD = 1e-9
SIDES = {"left": ConstantRate(0.0, 0.2, 0.5), "right": ConstantRate(0.0, 0.3, 0.5)}


def chain(links: LinksPerWing, names: tuple[str, ...] = NAMES, **change: dict[str, Any]) -> ChainModel:
    """The equivalent model of wings and a flexible tail."""
    return four_surfaces(names, links, **change)


def apart(model: ChainModel, wing: float = 1.05, tail: float = 0.9) -> ParameterBatch:
    """The physical guess with lift factors of the wing and of the tail."""
    return physical_guess(model, apart=("tail",)).changed(lift_factor=np.array([[wing, tail]]))


def flown(
    batch: ParameterBatch,
    names: tuple[str, ...] = NAMES,
    sides: dict[str, ConstantRate] = SIDES,
    **change: dict[str, Any],
) -> Simulation:
    """A short morph."""
    return fly(
        aircraft(names, **change), flight(), sides, model=batch, duration_s=0.4, step_s=0.01, lattice=LATTICE
    )


def test_a_tail_of_one_link_is_a_rigid_tail() -> None:
    """Wings of four links and a tail of one, by name, and the same with a tail that is declared rigid."""
    stiff: dict[str, Any] = {name: {"flexible": False} for name in NAMES[2:]}
    by_name, declared = chain(UNLIKE), chain(4, **stiff)
    assert by_name.surfaces[:, 1].tolist() == declared.surfaces[:, 1].tolist() == [4, 4, 1, 1]
    one = flown(physical_guess(by_name)).trajectory.euler
    other = flown(physical_guess(declared), **stiff).trajectory.euler
    np.testing.assert_allclose(one, other, rtol=0.0, atol=1e-14)


def test_equal_numbers_by_name_are_one_number() -> None:
    """The same model to the bit, whichever names a pair goes by."""
    one, every = chain(3), [{"wing": 3, "tail": 3}, {"left wing": 3, "tail": 3}, dict.fromkeys(NAMES, 3)]
    for links in every:
        model = chain(links)
        assert model.links_per_wing == 3
        for ours, theirs in zip(_constants(model), _constants(one), strict=True):
            np.testing.assert_array_equal(ours, theirs)


def _constants(model: ChainModel) -> tuple[Any, Any]:
    found = lane_constants(model, physical_guess(model), 0.01)
    return found.rows, found.ranges


def test_a_number_for_a_rigid_surface_is_one() -> None:
    """It may be named, with the one link that it is, and says nothing more."""
    stiff: dict[str, Any] = {name: {"flexible": False} for name in NAMES[2:]}
    assert chain(UNLIKE, **stiff).links_per_wing == chain({"wing": 4}, **stiff).links_per_wing == 4
    with pytest.raises(InvalidInput) as caught:
        chain({"wing": 4, "tail": 2}, **stiff)
    assert caught.value.pointer == "/model/links_per_wing/tail"
    assert "rigid" in caught.value.message


@pytest.mark.parametrize(
    ("links", "pointer", "words"),
    [
        ({"wing": 4}, "", ("'tail'", "wing, tail")),
        ({"wing": 4, "tail": 1, "fin": 1}, "/fin", ("'fin'", "wing, tail")),
        ({"wing": 4, "right wing": 3, "tail": 1}, "/right wing", ("'right wing'", "once")),
        ({"wing": 17, "tail": 1}, "/wing", ("17", "16")),
        ({"wing": 4.5, "tail": 1}, "/wing", ("4.5", "whole")),
    ],
)
def test_wrong_names_and_numbers_are_refused_with_those_to_use(
    links: Any, pointer: str, words: tuple[str, ...]
) -> None:
    """The field, and what to write instead."""
    with pytest.raises(InvalidInput) as caught:
        chain(links)
    assert caught.value.pointer == f"/model/links_per_wing{pointer}"
    assert all(word in f"{caught.value.message} {caught.value.hint}" for word in words), str(caught.value)


def test_the_order_of_surfaces_changes_nothing() -> None:
    """Neither with other links of the tail, nor with a lift factor of its own."""
    first, *others = [flown(apart(chain({"wing": 3, "tail": 2}, names)), names) for names in ORDERS]
    for other in others:
        np.testing.assert_allclose(
            other.trajectory.euler, first.trajectory.euler, rtol=0.0, atol=ROUND_OFF_RAD
        )


def test_mirror_images() -> None:
    """A morph and its mirror image: pitch is the same, roll and yaw change their signs."""
    batch = apart(chain(UNLIKE))
    one = flown(batch).trajectory.euler
    other = flown(batch, sides={"left": SIDES["right"], "right": SIDES["left"]}).trajectory.euler
    np.testing.assert_allclose(other * (-1.0, 1.0, -1.0), one, rtol=0.0, atol=MIRROR_RAD)
    assert np.abs(one[:, 0]).max() > 1e-3


def test_half_an_aircraft_has_the_values_of_the_whole() -> None:
    """Links and lift factors of each surface, by the name of either side."""
    whole = chain(UNLIKE, NAMES[::-1])
    half = whole.half
    assert half is not None
    assert half.surfaces[:, 1].tolist() == [1, 4]
    for key in ("tail", "right tail", "left tail"):
        batch = replace(apart(whole), apart=(key,))
        for number, surface in enumerate(half.aircraft.surfaces):
            own = half.on_surface(batch, number)["lift_factor"]
            assert own.tolist() == ([0.9] if "tail" in surface.name else [1.05])


def test_lift_factors_reach_the_links_of_their_surfaces() -> None:
    """Rigid surfaces included; what has no factor of its own has the shared one."""
    stiff: dict[str, Any] = {name: {"flexible": False} for name in NAMES[2:]}
    model = chain(2, **stiff)
    rows = lane_constants(model, apart(model), 0.01).rows[0, :, 0]
    links = rows[LINKS_C : LINKS_C + LINK_ROWS * model.links].reshape(model.links, -1)
    assert links[:, L_LIFT].tolist() == [1.05] * 4 + [0.9] * 2


def test_one_factor_for_all_is_a_factor_each() -> None:
    """A document with the shared factor, and one that names every surface with it, fly alike to the bit."""
    model = chain(2)
    shared = physical_guess(model).changed(lift_factor=np.array([1.07]))
    document = parameters_document(shared)
    assert "lift_factors" not in document["aero"]
    named = json.loads(json.dumps(document))
    named["aero"]["lift_factors"] = {"wing": 1.07, "tail": 1.07}
    np.testing.assert_array_equal(
        flown(parameters_from_document(named)).trajectory.euler, flown(shared).trajectory.euler
    )


@pytest.mark.parametrize("links", [UNLIKE, {"wing": 2, "tail": 3}, 3])
@pytest.mark.parametrize("separate", [False, True])
def test_documents_hold_every_surface(links: LinksPerWing, separate: bool) -> None:  # noqa: FBT001
    """Written and read, parameters are the same; each surface lists as many links as it has."""
    model = chain(links)
    batch = physical_guess(model, separate_wings=separate, apart=("tail",))
    batch = batch.changed(lift_factor=np.array([[1.05, 0.9]]))
    document = json.loads(json.dumps(parameters_document(batch)))
    assert document["links_per_wing"] == links
    assert document["aero"]["lift_factors"] == {"tail": 0.9}
    tail = document["surfaces"]["right tail"]
    expected = links if isinstance(links, int) else links["tail"]
    assert (len(tail["division"]), len(tail["stiffness_nm_rad"])) == (expected, expected - 1)
    read = fitted(model, parameters_from_document(document))
    assert (read.surfaces, read.set_links, read.apart) == (batch.surfaces, batch.set_links, batch.apart)
    for name, values in batch.values.items():
        np.testing.assert_allclose(read[name], values, rtol=1e-15)


@pytest.mark.parametrize(
    ("change", "pointer"),
    [
        ({"links_per_wing": {"wing": 3, "tail": 1}}, "/model/surfaces/right wing/division"),
        ({"links_per_wing": {"wing": 4}}, "/model/links_per_wing"),
        ({"links_per_wing": 4}, "/model/surfaces/right tail/division"),
        ({"surfaces": None}, "/model/surfaces"),
    ],
)
def test_documents_that_contradict_themselves_are_refused(change: dict[str, Any], pointer: str) -> None:
    """Other numbers than the surfaces have, and numbers by surface without surfaces."""
    document = parameters_document(physical_guess(chain(UNLIKE))) | change
    with pytest.raises(InvalidInput) as caught:
        parameters_from_document(document)
    assert caught.value.pointer == pointer


def test_a_factor_of_no_surface_is_refused() -> None:
    """With the names to use."""
    model = chain(2)
    with pytest.raises(InvalidInput) as caught:
        fitted(model, replace(apart(model), apart=("fin",)))
    assert caught.value.pointer == "/model/parameters/aero/lift_factors/fin"
    assert "wing, tail" in caught.value.hint


def test_parameters_of_other_numbers_of_links_are_refused() -> None:
    """Before anything is flown."""
    with pytest.raises(InvalidInput, match="4 links of wing, 1 of tail"):
        fitted(chain(4), physical_guess(chain(UNLIKE)))
