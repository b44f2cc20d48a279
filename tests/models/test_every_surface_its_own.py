"""Every surface has its own stiffness, damping, drag and chord; only mirror images share."""

from __future__ import annotations

import itertools
import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from morphcore.aero.kernels.loads import L_DRAG
from morphcore.errors import InvalidInput
from morphcore.geometry.aircraft import Aircraft, Flight
from morphcore.identify import Identification, IdentifyResult, SearchSettings
from morphcore.identify.cost import fly_attitudes, sample_cases, shared_trims
from morphcore.identify.parameters import search_space
from morphcore.models.equivalent import (
    ChainModel,
    ParameterBatch,
    chain_model,
    fitted,
    lane_constants,
    physical_guess,
)
from morphcore.models.kernels.layout import LINKS_C
from morphcore.models.links import joint_stiffness, link_edges
from morphcore.models.parameters_document import parameters_document, parameters_from_document
from morphcore.multibody.kernels.articulated import LINK_ROWS
from morphcore.simulate.flight import Simulation
from morphcore.simulate.schedule import ConstantRate
from morphcore.simulate.trajectory import Trajectory
from morphdata import aircraft as documents
from morphdata.identify import EquivalentModel
from morphdata.lattice import Lattice
from morphdata.links import LinksPerWing
from tests.models.chains import example_flight
from tests.simulate.flights import fly

LATTICE = Lattice(chordwise=1, spanwise=4)  # the laws hold on any
# the lattice's equations in another order: 1e-13 of the loads, and an aircraft that leaves its trim by itself
ROUND_OFF_RAD = 1e-10
# a descent amplifies round-off by what the samples do not see
FIT_ROUND_OFF = 1e-5


def surface(name: str, **more: Any) -> dict[str, Any]:
    """A surface of the left or the right, as its name says."""
    side, part = name.split()
    sign = 1.0 if side == "right" else -1.0
    own: dict[str, Any] = {
        "wing": {
            "span_m": 3.0, "chord_m": 0.4, "thickness_m": 0.05, "profile_drag": 0.01,
            "hinge": {"axis": "z", "position_m": [0.2, 0.3 * sign, 0.0]},
        },
        "tail": {
            "span_m": 1.0, "chord_m": 0.25, "thickness_m": 0.02, "profile_drag": 0.03,
            "position_m": [-2.4, 0.1 * sign, -0.2],
        },
    }[part]  # fmt: skip
    material = {"density_kg_m3": 300.0, "youngs_modulus_pa": 2e9, "stiffness_damping_s": 0.004}
    return {"name": name, "side": side, "material": material, **own, **more}


NAMES = ("right wing", "left wing", "right tail", "left tail")
ORDERS = [NAMES, NAMES[::-1], ("left tail", "right wing", "right tail", "left wing")]


def aircraft(names: tuple[str, ...] = NAMES, **change: dict[str, Any]) -> Aircraft:
    """Wings and a flexible tail of another stiffness, drag and chord."""
    document = {
        "fuselage": {"length_m": 5.0, "width_m": 0.5, "height_m": 0.5, "density_kg_m3": 60.0},
        "surfaces": [surface(name, **change.get(name, {})) for name in names],
    }
    return Aircraft.of(documents.Aircraft.parse(document))


def flight() -> Flight:
    """Slower than the examples'."""
    return replace(example_flight(), airspeed_m_s=70.0, start=None)


def chain(names: tuple[str, ...] = NAMES, links: LinksPerWing = 2, **change: dict[str, Any]) -> ChainModel:
    """The equivalent model."""
    return chain_model(aircraft(names, **change), flight(), links, LATTICE)


def flown(names: tuple[str, ...], model: Any) -> Simulation:
    """A short asymmetric morph; the fixed tail looks at no schedule."""
    sides = {"left": ConstantRate(0.0, 0.2, 0.5), "right": ConstantRate(0.0, 0.3, 0.5)}
    return fly(
        aircraft(names), flight(), sides, model=model, duration_s=0.4, step_s=0.01, lattice=LATTICE,
        elements=4,
    )  # fmt: skip


def uneven(model: ChainModel, *, separate_wings: bool) -> ParameterBatch:
    """Parameters of which no two sets are alike, by the names of their surfaces."""
    guess = physical_guess(model, separate_wings=separate_wings)
    assert guess.surfaces is not None
    factor = np.array([1.0 + 0.03 * len(names[0]) + 0.1 * ("left" in names[0]) for names in guess.surfaces])
    return guess.changed(
        stiffness_nm_rad=guess["stiffness_nm_rad"] * factor[:, None, None],
        damping_nms_rad=guess["damping_nms_rad"] * factor[:, None, None] ** 2,
        ac_offset_m=np.array([0.01]),
        lift_factor=np.array([1.1]),
    )


@pytest.mark.parametrize("kind", ["rigid", "shared", "separate", "flexible"])
def test_the_order_of_surfaces_changes_nothing(kind: str) -> None:
    """Thrust, incidence and attitude are those of any other order to round-off, in every kind of model."""
    found = []
    for names in ORDERS:
        model = chain(names)
        choice: Any = {
            "shared": uneven(model, separate_wings=False),
            "separate": uneven(model, separate_wings=True),
        }.get(kind, kind)
        found.append(flown(names, choice))
    first, *others = found
    for other in others:
        for name in ("alpha", "force_B", "moment_B"):
            scale = np.abs(first.trim.force_B).max() if name != "alpha" else 1.0
            np.testing.assert_allclose(
                getattr(other.trim, name), getattr(first.trim, name), rtol=0.0, atol=1e-9 * scale
            )
        np.testing.assert_allclose(
            other.trajectory.euler, first.trajectory.euler, rtol=0.0, atol=ROUND_OFF_RAD
        )


def test_the_guess_is_each_beam_s_own() -> None:
    """k = EI / l and c = beta k of each surface, its own drag; images share, in a set of their names."""
    model = chain(ORDERS[2])
    guess = physical_guess(model)
    assert guess.surfaces == (("right wing", "left wing"), ("right tail", "left tail"))
    for k, names in enumerate(guess.surfaces):
        part = next(s for s in model.aircraft.surfaces if s.name == names[0])
        beam = joint_stiffness(part, link_edges(guess["division"][:, k], part.span_m))
        np.testing.assert_array_equal(guess["stiffness_nm_rad"][:, k], beam)
        np.testing.assert_array_equal(guess["damping_nms_rad"][:, k], 0.004 * beam)
        assert guess["profile_drag"][0, k] == part.profile_drag


def test_drag_of_a_rigid_model_is_each_surface_s_own() -> None:
    """Without lift and with the wings straight, the drag area is the sum of the surfaces'."""
    still = replace(flight(), gravity_m_s2=0.0)
    for names in ORDERS:
        rows = lane_constants(
            chain_model(aircraft(names), still, 1, LATTICE), physical_guess(chain(names, links=1)), 0.01
        ).rows
        areas = rows[0, LINKS_C : LINKS_C + 4 * LINK_ROWS, 0].reshape(4, LINK_ROWS)[:, L_DRAG]
        expected = [s.profile_drag * s.area_m2 for s in aircraft(names).surfaces]
        np.testing.assert_allclose(areas, expected, rtol=1e-12)


def test_lengths_and_times_are_in_proportion_to_chords() -> None:
    """An offset of the aerodynamic centre and a lag are those of the largest surface, wherever it stands."""
    for names in ORDERS:
        model = chain(names)
        batch = physical_guess(model).changed(ac_offset_m=np.array([0.02]), lag_s=np.array([0.004]))
        tail, wing = (model.on_surface(batch, names.index(f"right {part}")) for part in ("tail", "wing"))
        assert wing["ac_offset_m"][0] == 0.02
        assert wing["lag_s"][0] == 0.004
        assert tail["ac_offset_m"][0] == pytest.approx(0.02 * 0.25 / 0.4)
        assert tail["lag_s"][0] == pytest.approx(0.004 * 0.25 / 0.4)


def test_a_mirrored_aircraft_flies_the_mirrored_flight() -> None:
    """With left and right exchanged, parameters too, roll and yaw change their sign and pitch does not."""

    def mirrored(name: str) -> str:
        return name.replace("left", "RIGHT").replace("right", "left").replace("RIGHT", "right")

    model = chain()
    batch = uneven(model, separate_wings=True)
    assert batch.surfaces is not None
    other = replace(
        batch, surfaces=tuple(tuple(mirrored(name) for name in names) for names in batch.surfaces)
    )
    angles = []
    for choice, (left, right) in ((batch, (0.2, 0.3)), (other, (0.3, 0.2))):
        sides = {"left": ConstantRate(0.0, left, 0.5), "right": ConstantRate(0.0, right, 0.5)}
        angles.append(
            fly(
                aircraft(), flight(), sides, model=choice, duration_s=0.4, step_s=0.01, lattice=LATTICE
            ).trajectory.euler
        )
    assert np.abs(angles[0][:, [0, 2]]).max() > 1e-3
    np.testing.assert_allclose(
        angles[1], angles[0] * np.array([-1.0, 1.0, -1.0]), rtol=0.0, atol=ROUND_OFF_RAD
    )


def sample(names: tuple[str, ...], batch: ParameterBatch) -> Trajectory:
    """An asymmetric flight of known parameters."""
    time_s = np.linspace(0.0, 0.4, 41)
    rest = np.zeros_like(time_s)
    left, right = (ConstantRate(0.0, final, 0.3).motion(time_s).angle for final in (0.2, 0.3))
    blank = Trajectory("known", time_s, {"sweep_left": left, "sweep_right": right}, rest, rest, rest)
    model = chain(names)
    ((case, found),) = shared_trims(model, batch, sample_cases(model, [blank]), "trim")
    euler = fly_attitudes(model, batch, case, found)[0]
    return replace(blank, phi=euler[:, 0], theta=euler[:, 1], psi=euler[:, 2])


def identified(names: tuple[str, ...], flown_as: Trajectory, **options: Any) -> IdentifyResult:
    """A short descent."""
    run = Identification(
        aircraft(names), flight(), [flown_as],
        EquivalentModel(links_per_wing=2, lattice=LATTICE, step_s=0.01, **options),
        SearchSettings(method="least_squares", iterations=3),
    )  # fmt: skip
    checkpoint = b""
    for step in run.steps():
        checkpoint = step.checkpoint
    return run.result(checkpoint)


@pytest.mark.parametrize("separate_wings", [False, True])
def test_identified_parameters_do_not_depend_on_the_order(separate_wings: bool) -> None:  # noqa: FBT001
    """Names, values, intervals and document, whichever surface comes first."""
    truth = sample(NAMES, uneven(chain(), separate_wings=separate_wings))
    first, second = (identified(names, truth, separate_wings=separate_wings) for names in ORDERS[1:])
    documents = [found.to_document() for found in (first, second)]
    surfaces = [document["model"]["surfaces"] for document in documents]
    assert list(surfaces[0]) == list(surfaces[1])
    prefixes = {name.split(".")[0] for name in documents[0]["uncertainty"]["standard_error"]}
    assert {"right wing", "right tail"} <= prefixes
    assert ("left tail" in prefixes) is separate_wings
    assert documents[0]["uncertainty"]["coordinates"] == documents[1]["uncertainty"]["coordinates"]
    assert first.parameters.surfaces == second.parameters.surfaces or not separate_wings
    of_first, of_second = (document["uncertainty"] for document in documents)
    assert of_first["value"].keys() == of_second["value"].keys()
    for name, value in of_first["value"].items():
        # what the sample hardly determines is compared with its standard error
        error = of_first["standard_error"][name] or 0.0
        assert abs(of_second["value"][name] - value) <= max(FIT_ROUND_OFF * max(abs(value), error), 1e-7), (
            name
        )
    assert documents[0]["model"]["separate_wings"] is separate_wings


@pytest.mark.parametrize("separate_wings", [False, True])
def test_a_document_says_what_is_whose(separate_wings: bool) -> None:  # noqa: FBT001
    """Through JSON and back it is the same model, for the surfaces in another order too."""
    batch = uneven(chain(), separate_wings=separate_wings)
    document = json.loads(json.dumps(parameters_document(batch)))
    assert set(document["surfaces"]) == set(NAMES)
    assert document["surfaces"]["left tail"] == {"mirror_of": "right tail"} or separate_wings
    largest = "left wing" if separate_wings else "right wing"  # the first by name
    assert document["stiffness_nm_rad"] == document["surfaces"][largest]["stiffness_nm_rad"]
    read = parameters_from_document(document)
    assert read.surfaces == batch.surfaces
    model = chain(ORDERS[2])
    rows = [lane_constants(model, each, 0.01).rows for each in (batch, read)]
    np.testing.assert_allclose(rows[1], rows[0], rtol=1e-14)
    assert model.is_even(read) is not separate_wings


def test_half_an_aircraft_stands_for_pairs() -> None:
    """Wings and tail at half the cost, and to round-off what the whole aircraft does."""
    model = chain(ORDERS[2])
    batch = uneven(model, separate_wings=False)
    time_s = np.linspace(0.0, 0.4, 41)
    angle, rest = ConstantRate(0.0, 0.3, 0.3).motion(time_s).angle, np.zeros_like(time_s)
    blank = Trajectory("even", time_s, {"sweep": angle}, rest, rest, rest)
    angles = []
    for separate in (False, True):
        (case,) = sample_cases(model, [blank], separate_wings=separate)
        assert case.plan.halved is not separate
        ((_, found),) = shared_trims(model, batch, [case], "trim")
        angles.append(fly_attitudes(model, batch, case, found))
    np.testing.assert_allclose(angles[0], angles[1], rtol=0.0, atol=ROUND_OFF_RAD)


def test_one_set_for_all_is_a_factor_on_each_beam() -> None:
    """A flat document is of the largest pair; the tail is as far from its own beam theory, with its drag."""
    model = chain(ORDERS[1])
    guess = physical_guess(model)
    flat = {
        **parameters_document(guess),
        "stiffness_nm_rad": (2.0 * guess["stiffness_nm_rad"][0, 0]).tolist(),
    }
    flat.pop("surfaces")
    found = fitted(model, parameters_from_document(flat))
    np.testing.assert_allclose(found["stiffness_nm_rad"], 2.0 * guess["stiffness_nm_rad"], rtol=1e-12)
    for name in ("damping_nms_rad", "profile_drag", "division"):
        np.testing.assert_allclose(found[name], guess[name], rtol=1e-12)
    with pytest.raises(InvalidInput):
        lane_constants(model, parameters_from_document(flat), 0.01)


def test_wings_that_are_not_mirror_images_share_nothing() -> None:
    """A wing of another chord: each side has its own parameters, whether requested or not."""
    model = chain(NAMES[:2], **{"left wing": {"chord_m": 0.41}})
    assert search_space(model).dimension == 2 * 7 + 3 + 2
    guess = physical_guess(model)
    assert guess.surfaces == (("left wing",), ("right wing",))
    assert np.all(guess["stiffness_nm_rad"][0, 0, :, 0] > guess["stiffness_nm_rad"][0, 1, :, 0])


@pytest.mark.parametrize("missing", NAMES)
def test_parameters_of_another_aircraft_are_refused(missing: str) -> None:
    """Every flexible surface must be named."""
    batch = physical_guess(chain(), separate_wings=True)
    assert batch.surfaces is not None
    renamed = tuple(tuple(name.replace(missing, "fin") for name in names) for names in batch.surfaces)
    with pytest.raises(InvalidInput) as caught:
        chain().set_of(replace(batch, surfaces=renamed))
    assert caught.value.pointer == "/model/parameters/surfaces"
    assert missing in caught.value.message


@pytest.mark.parametrize("change", [{"right tail": {"mirror_of": "nobody"}}, {"left wing": {}}])
def test_documents_with_gaps_are_refused(change: dict[str, Any]) -> None:
    """An image of nothing, and a surface without parameters."""
    document = parameters_document(physical_guess(chain()))
    document["surfaces"] |= change
    with pytest.raises(InvalidInput) as caught:
        parameters_from_document(document)
    assert caught.value.pointer.startswith("/model/surfaces/")


def test_sets_are_the_same_in_every_order() -> None:
    """All 24 orders of four surfaces."""
    named = {tuple(physical_guess(chain(names)).surfaces or ()) for names in itertools.permutations(NAMES)}
    assert {tuple(group[0] for group in sets) for sets in named} == {("right wing", "right tail")}
