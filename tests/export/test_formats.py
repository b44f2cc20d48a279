"""Exported models: read back by other programs' readers, they are the model, to the last digit."""

from __future__ import annotations

import io
import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.io import loadmat

from morphcore import export, simulate
from morphcore.errors import InvalidInput
from morphcore.export.formats import Export
from morphcore.geometry.aircraft import Aircraft, Flight
from morphcore.models.equivalent import ChainModel, ParameterBatch, chain_model, fitted
from morphcore.models.parameters_document import parameter_batch, parameters_document
from morphcore.simulate.schedule import Hold
from morphdata.export import ExportRequest, ModelFile
from morphdata.formats import FORMATS
from morphdata.lattice import Lattice
from morphdata.version import VERSION
from tests.models.chains import EXAMPLES, motion_of, random_batch, random_hinges, random_state
from tests.multibody.trees import Builder
from tests.oracles.chain_tree import chain_tree
from tests.oracles.dynamics import mass_matrix
from tests.oracles.tree import FLAP, LAG, TORSION, Tree, spatial_inertia

COARSE = {"chordwise": 1, "spanwise": 4}
NAMES = [each.name for each in FORMATS]
FIT = [{"sample": "rate_0.5", "role": "train", "J_identified": 1e-4}]

Arrays = dict[str, Any]


def vehicle() -> dict[str, Any]:
    """The example's wings with axes of their own, and a fixed rigid tail of a tapered planform."""
    documents = {name: json.loads((EXAMPLES / f"{name}.json").read_text()) for name in ("aircraft", "flight")}
    for wing in documents["aircraft"]["surfaces"]:
        wing |= {"elastic_axis_offset_m": 0.02, "mass_axis_offset_m": 0.03}
    tail = {
        "name": "tail", "side": "right", "span_m": 1.0, "root_chord_m": 0.3, "tip_chord_m": 0.2,
        "thickness_m": 0.03, "position_m": [-2.0, 0.0, 0.0], "flexible": False,
        "material": documents["aircraft"]["surfaces"][0]["material"],
    }  # fmt: skip
    documents["aircraft"]["surfaces"].append(tail)
    return documents


@cache
def model() -> tuple[ChainModel, ParameterBatch]:
    """Three links a wing with parameters away from beam theory."""
    request = ExportRequest.parse({**vehicle(), "model": {"parameters": _any_parameters()}, "format": "json"})
    chain = chain_model(Aircraft.of(request.aircraft), Flight.of(request.flight), 3, Lattice(**COARSE))
    return chain, random_batch(np.random.default_rng(5), chain, 1)


def _any_parameters() -> dict[str, Any]:
    return {
        "links_per_wing": 1, "division": [1.0], "stiffness_nm_rad": [], "damping_nms_rad": [],
        "aero": {"profile_drag": 0.0, "lag_s": 0.0},
    }  # fmt: skip


@cache
def written(name: str) -> bytes:
    """The model in one format, as the operation writes it."""
    _, batch = model()
    known = {**parameters_document(batch), "lattice": COARSE, "step_s": 0.005, "start": "trim"}
    request = {
        **vehicle(),
        "model": {"parameters": known},
        "format": name,
        "origin": {"id": "model_1", "fit": FIT},
    }
    return Export(ExportRequest.parse(request)).data()


def npz() -> Arrays:
    """The groups of the npz file; nothing in it is pickled."""
    groups: Arrays = {}
    with np.load(io.BytesIO(written("npz")), allow_pickle=False) as archive:
        for key in archive:
            group, _, name = key.partition(".")
            groups.setdefault(group, {})[name] = archive[key]
    return groups


def rebuilt(found: Arrays) -> Tree:
    """The multibody tree of a file's arrays, by what their description says alone."""
    links, joints, hinges = found["links"], found["joints"], found["hinges"]
    inertias = [
        (mass, centre, inertia)
        for mass, centre, inertia in zip(
            links["mass_kg"], links["centre_of_mass_m"], links["inertia_kg_m2"], strict=True
        )
    ]
    fuselage = found["fuselage"]
    base = spatial_inertia(fuselage["mass_kg"], fuselage["centre_of_mass_m"], fuselage["inertia_kg_m2"])
    of_surface = {int(surface): k for k, surface in enumerate(hinges["surface_index"])}
    outboard = {int(link): j for j, link in enumerate(joints["outboard_link_index"])}
    for link, (mass, centre, inertia) in enumerate(inertias):  # fixed first links are the fuselage's
        if link not in outboard and int(links["surface_index"][link]) not in of_surface:
            base = base + spatial_inertia(mass, centre + links["origin_m"][link], inertia)
    builder = Builder()
    builder.base(base)
    body, first_arm = 0, np.zeros(3)
    for link, (mass, centre, inertia) in enumerate(inertias):
        where = links["origin_m"][link]
        if link in outboard:
            if int(joints["inboard_link_index"][outboard[link]]) in outboard:
                arm = where
            else:  # on a first link, whose body's origin is its hinge
                arm = where + first_arm
            springs = list(
                zip(
                    joints["stiffness_nm_rad"][outboard[link]],
                    joints["damping_nms_rad"][outboard[link]],
                    strict=True,
                )
            )
            body = builder.joint(body, FLAP, 1.0, arm, np.zeros((6, 6)), springs[0])
            body = builder.joint(body, TORSION, 1.0, np.zeros(3), np.zeros((6, 6)), springs[1])
            body = builder.joint(
                body, LAG, 1.0, np.zeros(3), spatial_inertia(mass, centre, inertia), springs[2]
            )
        elif int(links["surface_index"][link]) in of_surface:
            k = of_surface[int(links["surface_index"][link])]
            pivot, axis = hinges["position_m"][k], hinges["axis"][k]
            number = int(np.abs(axis).argmax())
            first_arm = where - pivot
            body = builder.hinge(
                0, number, float(axis[number]), pivot, spatial_inertia(mass, centre + first_arm, inertia)
            )
    return builder.tree()


def test_a_second_implementation_has_the_mass_matrix_of_the_model() -> None:
    """Rebuilt from the arrays alone, the textbook tree moves like the one built by slices of the wings.

    Lengths, masses, centres, inertias, hinges and joints are all in the mass matrix of random attitudes.
    """
    chain, batch = model()
    tree, expected = rebuilt(npz()), chain_tree(chain, batch)
    np.testing.assert_allclose(tree.stiffness, expected.stiffness, rtol=1e-14)
    np.testing.assert_allclose(tree.damping, expected.damping, rtol=1e-14)
    rng = np.random.default_rng(6)
    for _ in range(3):
        motion = motion_of(chain, random_hinges(rng, chain), random_state(rng, chain, 1)[0])
        matrix = mass_matrix(expected, motion)
        np.testing.assert_allclose(
            mass_matrix(tree, motion), matrix, rtol=0.0, atol=1e-12 * np.abs(matrix).max()
        )


def test_the_reference_trim_is_where_a_held_flight_begins() -> None:
    """Angle of attack, thrust and joint angles of the file are those that `simulate` flies level with."""
    chain, batch = model()
    saved = ModelFile.parse(json.loads(written("json")))
    flown = simulate(
        saved.aircraft, saved.flight, {"sweep": Hold()}, model=batch, duration_s=0.1,
        lattice=Lattice(**COARSE), step_s=0.005,
    )  # fmt: skip
    trim = npz()["trim"]
    assert trim["alpha_rad"] == pytest.approx(flown.trim.alpha[0], abs=1e-10)
    np.testing.assert_allclose(trim["force_n"], flown.trim.force_B[0], rtol=1e-8, atol=1e-6)
    np.testing.assert_allclose(trim["moment_nm"], flown.trim.moment_B[0], rtol=1e-8, atol=1e-6)
    np.testing.assert_allclose(trim["joint_rad"].ravel(), flown.trim.q_joint[0], atol=1e-10)
    assert np.ptp(flown.trajectory.theta) < 1e-6, "it is an equilibrium"
    assert chain.joints == trim["joint_rad"].shape[0]


def test_matlab_files_hold_what_npz_files_hold() -> None:
    """Structs of the same names and values; indices count from one, names are cell arrays."""
    found = loadmat(io.BytesIO(written("mat")), simplify_cells=True)
    for group, table in npz().items():
        assert set(found[group]) == set(table)
        for name, values in table.items():
            own = found[group][name]
            if values.dtype.kind == "U":
                assert np.asarray(own).tolist() == values.tolist()
            else:
                shift = 1 if name.endswith("_index") else 0
                np.testing.assert_array_equal(np.squeeze(values) + shift, np.squeeze(own), err_msg=name)
    assert found["hinges"]["drive"].tolist() == ["sweep_right", "sweep_left"]


def test_the_document_is_reloadable() -> None:
    """Aircraft, flight and model of the file are those that were exported, and so is what is made of it."""
    saved = ModelFile.parse(json.loads(written("json")))
    chain, batch = model()
    again = fitted(chain, parameter_batch(saved.model))
    for name, values in fitted(chain, batch).values.items():
        np.testing.assert_allclose(again[name], values, rtol=1e-15)
    assert (saved.origin.id, saved.origin.fit, saved.morphid_version) == ("model_1", FIT, VERSION)
    assert saved.model.step_s == 0.005
    document = json.loads(written("json"))
    whole = ExportRequest.parse({**vehicle(), "model": {"parameters": document}, "format": "json"})
    assert whole.model.known == saved.model


@pytest.mark.parametrize("name", NAMES)
def test_the_same_model_gives_the_same_bytes(name: str) -> None:
    """No date, no order of a hash, no path is in a file."""
    once = written(name)
    written.cache_clear()
    assert written(name) == once


@pytest.mark.parametrize("name", ["npz", "mat"])
def test_every_file_says_where_it_is_from(name: str) -> None:
    """Id, fit, version and notice are in it, and the documents that it was made of."""
    found = npz() if name == "npz" else loadmat(io.BytesIO(written("mat")), simplify_cells=True)
    origin = found["origin"]
    assert str(origin["model_id"]) == "model_1"
    assert json.loads(str(origin["fit"])) == FIT
    assert (str(origin["morphid_version"]), "MorphID" in str(origin["notice"])) == (VERSION, True)
    documents = {name: json.loads(str(text)) for name, text in found["documents"].items()}
    known = ExportRequest.parse({**documents, "model": {"parameters": documents["model"]}, "format": "npz"})
    assert known.model.known == ModelFile.parse(json.loads(written("json"))).model


def test_the_library_takes_what_it_gives(tmp_path: Path) -> None:
    """A batch, its document and a whole result give the same file but for the origin; a rigid model too."""
    _, batch = model()
    request = ExportRequest.parse({**vehicle(), "model": {"parameters": _any_parameters()}, "format": "npz"})
    document = {**parameters_document(batch), "lattice": COARSE}
    forms: list[Any] = [document, {"model": document, "fit": FIT}, request.model.known]
    files = [
        export(given, request.aircraft, request.flight, "json", tmp_path / f"{k}.json")
        for k, given in enumerate(forms)
    ]
    saved = [ModelFile.load(path) for path in files]
    assert saved[0].model == saved[1].model
    assert (saved[0].origin.fit, saved[1].origin.fit) == ([], FIT)
    assert saved[2].model.links_per_wing == 1
    path = export(forms[2], request.aircraft, request.flight, "npz", tmp_path / "rigid.npz")
    with np.load(path) as found:
        assert found["joints.stiffness_nm_rad"].shape == (0, 3)


def test_what_cannot_be_exported_is_named(tmp_path: Path) -> None:
    """An unknown format with those there are; a model of another aircraft at its place."""
    request = ExportRequest.parse({**vehicle(), "model": {"parameters": _any_parameters()}, "format": "npz"})
    known = request.model.known
    assert known is not None
    with pytest.raises(InvalidInput, match="zip") as caught:
        export(known, request.aircraft, request.flight, "zip", tmp_path / "model.zip")
    assert (caught.value.pointer, caught.value.hint) == ("/format", f"the formats are {', '.join(NAMES)}")
    other = {**_any_parameters(), "surfaces": {"canard": {
        "division": [1.0], "stiffness_nm_rad": [], "damping_nms_rad": [], "profile_drag": 0.0}}}  # fmt: skip
    with pytest.raises(InvalidInput) as caught:
        export(other, request.aircraft, request.flight, "npz", tmp_path / "model.npz")
    assert caught.value.pointer == "/model/parameters/surfaces"
    assert not list(tmp_path.iterdir())
