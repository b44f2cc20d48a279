"""The shape of a flight: poses and edges of all surfaces, enough to draw the bent aircraft."""

from __future__ import annotations

import io
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from morphcore.errors import InvalidInput
from morphcore.export.shape_files import shape_files
from morphcore.frames import rotation_from_quaternion
from morphcore.geometry.lattice import chord_points, surface_pose
from morphcore.models.equivalent import chain_model, physical_guess
from morphcore.simulate.shape import Shape
from morphdata.lattice import Lattice
from morphdata.points import Point
from morphdata.shape import FlownShape
from morphdata.simulate import SimulateRequest
from tests.app.request_documents import simulate_document
from tests.models.chains import Swing, example_aircraft, example_flight
from tests.simulate.flights import fly
from tests.simulate.test_loads import MODELS, flown, swept_aircraft

Array = np.ndarray[Any, Any]

COARSE = Lattice(chordwise=1, spanwise=4)
SMOOTH = [Swing(0.15, 5.0), Swing(0.1, 4.0)]


def shape_of(sweeps: list[Swing], kind: str = "equivalent", **options: Any) -> Shape:
    """The example aircraft's shape at 0, 0.05 and 0.1 s."""
    aircraft, flight = example_aircraft(), example_flight()
    model: Any = physical_guess(chain_model(aircraft, flight, 3)) if kind == "equivalent" else kind
    options = {"channels": [], "shape_times_s": [0.0, 0.05, 0.1], **options}
    found = fly(aircraft, flight, sweeps, model=model, duration_s=0.1, lattice=COARSE, elements=4, **options)
    assert found.shape is not None
    return found.shape


@pytest.mark.parametrize("kind", MODELS)
def test_tips_of_the_shape_are_those_of_the_channels(kind: str) -> None:
    """Deflection along z of B, and twist between the axes of tip and root, of every surface."""
    found = flown(kind)
    shape, columns, row = found.shape, found.trajectory.extra, 250
    assert shape is not None
    for surface in shape.surfaces:
        part = surface.name.replace(" ", "_")
        down = (surface.axis_N[1, -1] - surface.axis_N[1, 0]) @ shape.R_NB[1][:, 2]
        assert columns[f"tip_z_{part}"][row] == pytest.approx(down, abs=1e-12)
        turned = surface.R_NS[1, 0].T @ surface.R_NS[1, -1]
        assert columns[f"tip_twist_{part}"][row] == pytest.approx(np.arcsin(turned[0, 2]), abs=1e-12)
    flies = np.stack([columns[name][row] for name in ("x", "y", "z")])
    np.testing.assert_allclose(shape.position_N[1], flies, atol=1e-12)


@pytest.mark.parametrize("kind", MODELS)
def test_edges_are_those_of_the_chords(kind: str) -> None:
    """The chord keeps its length and its place in the section; a rigid wing is where its hinges put it."""
    found, aircraft = flown(kind), swept_aircraft()
    assert found.shape is not None
    drives = found.trajectory.drives
    for number, (surface, shape) in enumerate(zip(aircraft.surfaces, found.shape.surfaces, strict=True)):
        distance = shape.at * surface.length_m
        chord = np.linalg.norm(shape.leading_N - shape.trailing_N, axis=2)
        np.testing.assert_allclose(chord, np.tile(surface.chord_at(distance), (3, 1)), rtol=1e-12)
        if kind == "rigid" or not surface.flexible:
            angles = np.array([drives[hinge.drive][250] for hinge in surface.hinges])
            R_BW, r_B = surface_pose(surface, angles)
            edges = r_B + chord_points(surface, np.array([0.0, 1.0]), distance) @ R_BW.T
            placed = found.shape.position_N[1] + edges @ found.shape.R_NB[1].T
            np.testing.assert_allclose(
                np.stack([shape.leading_N[1], shape.trailing_N[1]]), placed, atol=1e-12
            )
        assert number < len(found.shape.surfaces)


def test_both_sides_of_a_joint_are_stations() -> None:
    """The elastic axis is continuous there, the edges of two links are not if the joint is turned."""
    surface = shape_of(SMOOTH).surfaces[0]
    joints = np.flatnonzero(np.diff(surface.at) == 0.0)
    assert joints.size == 2
    for k in joints:
        np.testing.assert_allclose(surface.axis_N[:, k], surface.axis_N[:, k + 1], atol=1e-12)
        assert np.abs(surface.R_NS[0, k] - surface.R_NS[0, k + 1]).max() > 0.01
    assert surface.at[0] == 0.0
    assert surface.at[-1] == 1.0
    assert np.all(np.diff(surface.at) >= 0.0)


@pytest.mark.parametrize("kind", ["equivalent", "flexible"])
def test_even_sweeps_are_the_same_on_both_sides(kind: str) -> None:
    """Flown as one half or whole, the left wing is the right one's mirror image."""
    shape = shape_of([SMOOTH[0], SMOOTH[0]], kind)
    right, left = shape.surfaces
    across = np.array([1.0, -1.0, 1.0])
    assert (right.name, left.name) == ("right wing", "left wing")
    for line in ("axis_N", "leading_N", "trailing_N"):
        np.testing.assert_allclose(getattr(left, line), across * getattr(right, line), atol=1e-9)
    np.testing.assert_allclose(left.R_NS, across[:, None] * right.R_NS * across, atol=1e-9)
    nearly = shape_of([SMOOTH[0], replace(SMOOTH[0], amplitude=0.15 + 1e-7)], kind)
    for one, other in zip(shape.surfaces, nearly.surfaces, strict=True):
        np.testing.assert_allclose(one.leading_N, other.leading_N, atol=1e-5)


def test_chains_and_beams_bend_alike() -> None:
    """Three nominal links: tips within 6 per cent of their deflection, 4 of it as beam theory says."""
    chain, beams = shape_of(SMOOTH), shape_of(SMOOTH, "flexible")
    for one, other in zip(chain.surfaces, beams.surfaces, strict=True):
        rise = [-(each.axis_N[0, -1, 2] - each.axis_N[0, 0, 2]) for each in (one, other)]
        assert rise[0] == pytest.approx(rise[1], rel=0.06)
        assert rise[1] > 0.2


def test_times_are_those_of_the_nearest_rows_in_the_order_of_the_request() -> None:
    """A time between two rows is that of the nearest; one may be given twice."""
    for kind in ("rigid", "flexible"):
        shape = shape_of(SMOOTH, kind, shape_times_s=[0.1, 0.0, 0.032, 0.1])
        np.testing.assert_allclose(shape.time_s, [0.1, 0.0, 0.03, 0.1])
        np.testing.assert_array_equal(shape.surfaces[0].leading_N[0], shape.surfaces[0].leading_N[3])
        assert shape.position_N[1, 0] == 0.0
        assert shape.position_N[0, 0] == pytest.approx(15.0, rel=0.01)


def test_documents_and_files_hold_the_same() -> None:
    """The document keeps the contract and has the attitudes; table and arrays are read back."""
    shape = shape_of(SMOOTH)
    document = FlownShape.model_validate(shape.to_document())
    surface = document.surfaces[1]
    np.testing.assert_array_equal(surface.leading_n_m, shape.surfaces[1].leading_N)
    turned = rotation_from_quaternion(np.array(surface.quaternion_ns))
    np.testing.assert_allclose(turned, shape.surfaces[1].R_NS, atol=1e-12)
    files = shape_files(shape)
    assert shape_files(shape) == files
    with np.load(io.BytesIO(files["shape.npz"])) as arrays:
        np.testing.assert_array_equal(arrays["left_wing.trailing_n_m"], shape.surfaces[1].trailing_N)
        np.testing.assert_array_equal(arrays["time_s"], shape.time_s)
        assert str(arrays["left_wing.name"]) == "left wing"
    rows = files["shape.csv"].decode().splitlines()
    titles = rows[0].split(",")
    assert titles[:5] == ["t", "surface", "station", "at", "axis_x"]
    stations = shape.surfaces[0].at.size
    assert len(rows) == 1 + 3 * 2 * stations
    last = dict(zip(titles, rows[-1].split(","), strict=True))
    assert last["surface"] == "left wing"
    assert float(last["trailing_z"]) == pytest.approx(shape.surfaces[1].trailing_N[-1, -1, 2], rel=1e-8)


@pytest.mark.parametrize(
    ("given", "pointer", "words"),
    [
        ({"shape_times_s": [0.0, 2.0]}, "/shape_times_s/1", "from 0 to 0.1 s"),
        ({"points": [{"name": "imu", "surface": "wing", "at": 1.0}]}, "/points/0/surface", "'right wing'"),
        ({"points": [{"name": "imu"}]}, "/points/0/position_m", "position_m on the fuselage"),
        ({"points": [{"name": "imu", "surface": "left wing"}]}, "/points/0/at", "1 at the tip"),
        ({"points": [{"name": "imu", "at": 0.5}]}, "/points/0/at", "Add surface"),
        (
            {"points": [{"name": "imu", "surface": "left wing", "at": 0.5, "position_m": [0.0, 0.0, 0.0]}]},
            "/points/0/position_m",
            "either",
        ),
        ({"points": 2 * [{"name": "imu", "position_m": [1.0, 0.0, 0.0]}]}, "/points/1/name", "of its own"),
        (
            {"points": [{"name": "imu", "position_m": [1.0, 0.0, 0.0]}], "channels": ["alpha"]},
            "/points",
            "fx, fy, fz, nx, ny, nz",
        ),
        ({"channels": ["root_bend"]}, "/channels/0", "'root_bending'"),
    ],
)
def test_service_and_library_refuse_the_same(given: dict[str, Any], pointer: str, words: str) -> None:
    """Wrong times, points, surfaces and channels are refused by both, with the names to use."""
    given = {"channels": ["nz"], **given}
    document = simulate_document()
    document |= {"model": {"kind": "rigid"}, "duration_s": 0.1, **given}
    with pytest.raises(InvalidInput) as by_document:
        SimulateRequest.parse(document)
    with pytest.raises(InvalidInput) as by_library:
        fly(example_aircraft(), example_flight(), SMOOTH, model="rigid", duration_s=0.1, **given)
    assert by_document.value.faults == by_library.value.faults
    assert by_library.value.pointer == pointer
    assert words in by_library.value.hint


def test_points_may_be_documents_or_objects() -> None:
    """A notebook's user gives `Point`s, which are refused at once where incomplete."""
    with pytest.raises(InvalidInput):
        Point(name="imu")
    aircraft, flight = example_aircraft(), example_flight()
    point = Point(name="imu", position_m=[1.0, 0.0, 0.0])
    one, other = (
        fly(aircraft, flight, SMOOTH, model="rigid", duration_s=0.1, channels=["nz"], points=[each])
        for each in (point, {"name": "imu", "position_m": [1.0, 0.0, 0.0]})
    )
    np.testing.assert_array_equal(one.trajectory.extra["nz_imu"], other.trajectory.extra["nz_imu"])
