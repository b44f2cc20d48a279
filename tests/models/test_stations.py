"""Stations along the span: the same as a surface's own fields where these suffice, and right where not."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from morphcore.errors import InvalidInput
from morphcore.geometry.aircraft import Aircraft
from morphcore.geometry.mirror import mirror_of
from morphcore.geometry.overlap import overlapping_surfaces
from morphcore.geometry.surface import Surface
from morphcore.models.equivalent import chain_model, lane_constants, physical_guess
from morphcore.models.flexible import flexible_model
from morphcore.models.links import drag_areas, joint_stiffness, link_edges
from morphcore.multibody.beam import NodePoses
from morphcore.simulate.plan import flight_plan
from morphcore.simulate.schedule import ConstantRate, Hold
from morphcore.simulate.time_grid import time_grid
from morphdata.aircraft import load_aircraft
from morphdata.environment import Environment, Gust
from morphdata.lattice import Lattice
from tests.aero.planforms import DEGREE, lattice, lift_and_drag
from tests.aero.test_loads import SINKING, compared
from tests.models.chains import (
    EXAMPLES,
    SMALL_LATTICE,
    aircraft_of,
    example_flight,
    random_batch,
    small_model,
)
from tests.models.test_point_masses import by_hand, of_beams, of_links
from tests.oracles.clamped_beams import DeadLoad, clamped_equilibrium
from tests.simulate.flights import assert_mirrored, fly

Array = NDArray[np.float64]

SECTION = {
    "ei_flap_n_m2": 5e4, "ei_edge_n_m2": 8e5, "gj_n_m2": 4e4, "mass_per_length_kg_m": 15.0,
    "inertia_per_length_kg_m": [0.0125, 0.125, 0.1125],
}  # fmt: skip
AXES = {"elastic_axis": 0.45, "mass_axis": 0.55}


def with_stations(*rows: dict[str, Any], drop: tuple[str, ...] = (), **fields: Any) -> Aircraft:
    """The example's aircraft with these rows on both wings, some fields removed or replaced."""
    document = load_aircraft(EXAMPLES / "aircraft.json").model_dump(exclude_none=True)
    for surface in document["surfaces"]:
        for name in drop:
            del surface[name]
        surface.update(fields | ({"stations": list(rows)} if rows else {}))
    return aircraft_of(document)


def kinked(*, side_drag: bool = True) -> Aircraft:
    """Everything varies along the span, with kinks that are no multiples of anything, the planform too."""
    rows = [
        {"at": 0.0, "chord_m": 0.5, "mass_axis": 0.5, "profile_drag": 0.01},
        {"at": 0.337, "chord_m": 0.4, "mass_per_length_kg_m": 20.0, "mass_axis": 0.6, "aft_m": 0.02},
        {"at": 0.34, "chord_m": 0.4, "mass_per_length_kg_m": 8.0, "mass_axis": 0.6, "aft_m": 0.02},
        {"at": 0.81, "chord_m": 0.35, "gj_n_m2": 2e4, "inertia_per_length_kg_m": [0.01, 0.09, 0.08]},
        {"at": 1.0, "chord_m": 0.15, "ei_flap_n_m2": 9e3, "aft_m": 0.05, "profile_drag": 0.03},
    ]
    for row in rows:  # 0.03 m aft of the root's mid-chord
        row["elastic_axis"] = 0.5 + (0.03 - row.get("aft_m", 0.0)) / row["chord_m"]
        if not side_drag:
            row.pop("profile_drag", None)
    return with_stations(*rows)


def stepped() -> Aircraft:
    """A wing whose outer 45 per cent are eight times softer, all of a sudden."""
    return with_stations(
        {"at": 0.0, "ei_flap_n_m2": 8e4},
        {"at": 0.5499, "ei_flap_n_m2": 8e4},
        {"at": 0.5501, "ei_flap_n_m2": 1e4},
        {"at": 1.0, "ei_flap_n_m2": 1e4},
    )


def everything(aircraft: Aircraft) -> list[Array]:
    """The numbers that fly: rows of chains, their overlap and lattices, beams and what rides on them."""
    out: list[Array] = []
    for links in (1, 2, 4):
        model = chain_model(aircraft, example_flight(), links)
        out.append(lane_constants(model, physical_guess(model), 0.005).rows)
    out += [part.ring_corners_W for part in model.lattice.lattices]
    out += [part.control_points_W for part in model.lattice.lattices]
    beams = flexible_model(aircraft, example_flight(), elements=6)
    out += [beams.beams.stiffness, beams.beams.mass, beams.beams.inertia, beams.rest_W]
    out += [beams.riders.corner_arm, beams.riders.control_arm, beams.riders.drag_arm, beams.riders.drag_area]
    return out


@pytest.mark.parametrize(
    ("plain", "rows"),
    [
        ({}, {}),
        ({}, {"chord_m": 0.3, "profile_drag": 0.01}),
        ({"section": SECTION}, SECTION),
        ({"section": SECTION | {"ea_n": 3e7}}, SECTION | {"ea_n": 3e7}),
        (
            {"elastic_axis_offset_m": -0.05 * 0.3, "mass_axis_offset_m": 0.05 * 0.3},
            {"elastic_axis": 0.45, "mass_axis": 0.55},
        ),
    ],
    ids=["nothing", "chord", "section", "axial", "axes"],
)
def test_constant_rows_say_what_the_fields_say(plain: dict[str, Any], rows: dict[str, Any]) -> None:
    """Rows of constant values make the same chains, lattices and beams: 1e-12 of the largest number."""
    found = everything(with_stations(*({"at": at} | rows for at in (0.0, 0.4, 1.0))))
    for one, other in zip(found, everything(with_stations(**plain)), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-12 * np.abs(other).max())


def test_linear_taper_by_rows() -> None:
    """Chords of root and tip by two rows, or by three on one line, are the tapered wing."""
    tapered = everything(with_stations(drop=("chord_m",), root_chord_m=0.5, tip_chord_m=0.2))
    for shares in ((0.0, 1.0), (0.0, 0.3, 1.0)):
        rows = [{"at": at, "chord_m": 0.5 - 0.3 * at} for at in shares]
        for one, other in zip(everything(with_stations(*rows, drop=("chord_m",))), tapered, strict=True):
            np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-12 * np.abs(other).max())


def test_mass_centre_and_inertia_are_the_same_in_every_model() -> None:
    """With kinks anywhere: rigid, chains of any division, beams of any number of elements, to 1e-10."""
    aircraft = kinked()
    expected = by_hand(aircraft)
    wing = aircraft.surfaces[0]
    y = (np.arange(200_000) + 0.5) * wing.span_m / 200_000
    mass = float(wing.section_at(y).mass.sum()) * wing.span_m / 200_000
    assert expected[3, 3] == pytest.approx(aircraft.fuselage.mass_kg + 2.0 * mass, rel=1e-8)
    scale = np.abs(expected).max()
    rng = np.random.default_rng(0)
    for links in (1, 2, 5):
        model = small_model(aircraft, example_flight(), links)
        for batch in (physical_guess(model), random_batch(rng, model, 1)):
            np.testing.assert_allclose(of_links(model, batch), expected, rtol=0, atol=1e-10 * scale)
    for elements in (1, 4, 10):
        np.testing.assert_allclose(of_beams(aircraft, elements), expected, rtol=0, atol=1e-10 * scale)
    rigid = replace(aircraft, surfaces=tuple(replace(s, flexible=False) for s in aircraft.surfaces))
    np.testing.assert_allclose(of_beams(rigid, 10), expected, rtol=0, atol=1e-10 * scale)


def bent_by_hand(wing: Surface) -> Array:
    """Tip deflection by bending and by shear, (2,), of a cantilever under 1 N at its tip, m.

    The integrals of (L - y)^2 / EI and of 1 / GA.
    """
    y = (np.arange(400_000) + 0.5) * wing.span_m / 400_000
    width = wing.span_m / 400_000
    bending = ((wing.span_m - y) ** 2 / wing.section_at(y).ei_flap).sum() * width
    return np.array([bending, (1.0 / wing.axial_at(y)[2]).sum() * width])


@pytest.mark.parametrize("aircraft", [kinked, stepped], ids=["kinks", "step"])
def test_beams_and_chains_bend_as_the_rows_say(aircraft: Callable[[], Aircraft]) -> None:
    """Tip deflection under a small force at the tip against the integral of M (L - y) / EI.

    Beams of 10 elements within 0.3 per cent (a step inside an element is smeared over a third of it), of 40
    within 0.01; chains are exact by construction for any number of links.
    """
    wing = aircraft().surfaces[0]
    bending, shear = bent_by_hand(wing)
    for elements, tolerance in ((10, 3e-3), (40, 1e-4)):
        alone = replace(aircraft(), surfaces=(wing,))
        model = flexible_model(alone, example_flight(), elements=elements, lattice=SMALL_LATTICE)
        rest = NodePoses(np.tile(np.eye(3), (model.beams.nodes, 1, 1)), model.rest_W.copy())
        tip = int(model.tips[0])
        bent = clamped_equilibrium(model.beams, rest, [DeadLoad(tip, force_N=(0.0, 0.0, 1.0))])
        assert bent.x[tip, 2] == pytest.approx(bending + shear, rel=tolerance)
    for links in (2, 3, 8):
        guess = physical_guess(small_model(aircraft(), example_flight(), links))
        edges = link_edges(guess["division"][:, 0], wing.span_m)
        flap = joint_stiffness(wing, edges)[0, :, 0]
        found = ((wing.span_m - edges[0, 1:-1]) ** 2 / flap).sum()
        assert found == pytest.approx(bending, rel=1e-7)


def test_profile_drag_along_the_span() -> None:
    """The mean over the area counts as the surface's coefficient, and each link has its own share of it."""
    wing = kinked().surfaces[0]
    y = (np.arange(300_000) + 0.5) * wing.span_m / 300_000
    width = wing.span_m / 300_000
    coefficient = np.interp(y / wing.span_m, [0.0, 0.337, 0.34, 0.81, 1.0], [0.01, 0.01, 0.01, 0.01, 0.03])
    drag = coefficient * wing.chord_at(y) * width
    area = float(wing.chord_at(y).sum() * width)
    assert wing.area_m2 == pytest.approx(area, rel=1e-9)
    assert wing.profile_drag == pytest.approx(drag.sum() / area, rel=1e-8)
    edges = np.array([[0.0, 1.3, 2.2, wing.span_m]])
    areas, centres = drag_areas(wing, edges)
    for k in range(3):
        inside = (y > edges[0, k]) & (y < edges[0, k + 1])
        assert wing.profile_drag * areas[0, k] == pytest.approx(drag[inside].sum(), rel=1e-5)
        arm = (drag[inside] * (y[inside] - edges[0, k])).sum() / drag[inside].sum()
        assert centres[0, k] == pytest.approx(arm, rel=1e-5)
    riders = flexible_model(kinked(), example_flight(), elements=4, lattice=Lattice(spanwise=20)).riders
    assert riders.drag_area.sum() == pytest.approx(2.0 * drag.sum(), rel=5e-3)


TWO_STAGES = [{"at": 0.0, "chord_m": 0.5}, {"at": 0.5, "chord_m": 0.45}, {"at": 1.0, "chord_m": 0.15}]


def other_program(rows: list[dict[str, Any]]) -> tuple[float, float]:
    """Lift and induced drag coefficients at 5 degrees by AeroSandbox's lattice on the same grid."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # those of the other program are not ours
        import aerosandbox as asb

        sections = [
            asb.WingXSec(
                xyz_le=[row.get("aft_m", 0.0) - 0.5 * row["chord_m"], 3.0 * row["at"], 0],
                chord=row["chord_m"],
                airfoil=asb.Airfoil("naca0008"),
            )
            for row in rows
        ]
        found = asb.VortexLatticeMethod(
            asb.Airplane(
                wings=[asb.Wing(symmetric=True, xsecs=sections)],
                xyz_ref=[0, 0, 0],
                s_ref=1.0,
                c_ref=1,
                b_ref=1,
            ),
            asb.OperatingPoint(velocity=1.0, alpha=5.0),
            spanwise_resolution=10,
            chordwise_resolution=4,
            spanwise_spacing_function=np.linspace,
            chordwise_spacing_function=np.linspace,
            align_trailing_vortices_with_wind=True,
        ).run()
    return float(found["CL"]), float(found["CD"])


@pytest.mark.parametrize("is_moved", [False, True], ids=["mid-chord", "leading edge"])
def test_two_stage_taper_against_aerosandbox(*, is_moved: bool) -> None:
    """Two trapezia, about a straight mid-chord line or a straight leading edge: in 2 per cent."""
    rows = [dict(row) for row in TWO_STAGES]
    if is_moved:
        for row in rows:
            row["aft_m"] = 0.5 * (row["chord_m"] - 0.5)
            row["elastic_axis"] = 0.5 - row["aft_m"] / row["chord_m"]
    document = with_stations(*rows)
    wings = replace(
        document,
        surfaces=tuple(
            replace(surface, hinges=(), position_m=(0.0, 0.0, 0.0)) for surface in document.surfaces
        ),
    )
    lift, drag, _ = lift_and_drag(lattice(wings, (4, 20)), 5 * DEGREE, 1.0)
    other_lift, other_drag = other_program(rows)
    assert lift == pytest.approx(other_lift, rel=0.02)
    assert drag == pytest.approx(other_drag, rel=0.02)


@pytest.mark.parametrize("angles", [(0.0, 0.0), (0.4, 0.4), (0.3, 0.9)])
def test_links_feel_the_trailing_edge_of_their_strips(angles: tuple[float, float]) -> None:
    """Lift and its moments on links are those on the lattice's edges, each strip with its own edge: 1e-11.

    In uniform incidence with sideslip, swept: spanwise flow meets a trailing edge that bends twice.
    """
    aircraft = kinked(side_drag=False)
    plain = replace(aircraft, surfaces=tuple(replace(s, profile_drag=0.0) for s in aircraft.surfaces))
    model = chain_model(plain, example_flight(), 1, Lattice(chordwise=3, spanwise=7))
    lanes, edges = compared(model, list(angles), SINKING)
    np.testing.assert_allclose(lanes[:, [0, 1, 5]], edges[:, [0, 1, 5]], atol=1e-11)
    np.testing.assert_allclose(lanes[:, [2, 3, 4]], edges[:, [2, 3, 4]], atol=0.012)


@pytest.mark.parametrize("model", ["rigid", "flexible"])
def test_stiff_wings_with_rows_fly_alike(model: str) -> None:
    """Two hundred times as stiff, beams and one link trim alike, masses and drag along the span and all.

    Angle of attack and moment within 2 per cent: the rigid model leaves out what strips induce along chords.
    """
    aircraft = kinked()
    stiff = replace(
        aircraft,
        surfaces=tuple(
            replace(
                surface,
                stations=replace(
                    surface.stations,
                    sections=tuple(
                        (name, tuple(200.0 * v for v in values) if name in ("ei_flap", "gj") else values)
                        for name, values in surface.stations.sections  # type: ignore[union-attr]
                    ),
                ),  # type: ignore[type-var]
                material=surface.material.model_copy(
                    update={"youngs_modulus_pa": 200.0 * surface.material.youngs_modulus_pa}
                ),
            )
            for surface in aircraft.surfaces
        ),
    )
    found = fly(stiff, example_flight(), [Hold(0.2), Hold(0.2)], model=model, duration_s=0.05).trim  # type: ignore[arg-type]
    rigid = fly(stiff, example_flight(), [Hold(0.2), Hold(0.2)], model="rigid", duration_s=0.05).trim
    assert found.alpha[0] == pytest.approx(rigid.alpha[0], rel=0.02)
    assert found.force_B[0, 0] == pytest.approx(rigid.force_B[0, 0], rel=0.03)
    assert found.moment_B[0, 1] == pytest.approx(rigid.moment_B[0, 1], rel=0.02)


def podded(*, is_even: bool = True) -> Aircraft:
    """Tapered wings in two stages with pods below, a mass and a line of thrust in the plane of symmetry."""
    document = load_aircraft(EXAMPLES / "aircraft.json").model_dump(exclude_none=True)
    for surface in document["surfaces"]:
        surface["stations"] = TWO_STAGES
    pods = [
        {"surface": f"{side} wing", "at": 0.7, "mass_kg": 6.0, "offset_m": [-0.2, -0.2]}
        for side in ("right", "left")
    ]
    nose = {"position_m": [1.0, 0.0, 0.1], "mass_kg": 40.0}
    document["point_masses"] = [nose, *(pods if is_even else pods[:1])]
    document["propulsion"] = {"position_m": [0.0, 0.0, -0.3]}
    return aircraft_of(document)


@pytest.mark.parametrize("kind", ["rigid", "equivalent", "flexible"])
def test_mirror_images_fly_mirrored(kind: str) -> None:
    """Rows and pods on both sides: a morph of the other side gives the mirrored flight, 1e-9 rad."""
    assert_mirrored(podded(), example_flight(), kind)


def test_half_an_aircraft_with_pods_flies_like_the_whole() -> None:
    """1e-10 rad, trim and all; with a pod on one side alone it is never halved.

    A gust of no strength keeps the simulator from halving.
    """
    aircraft, flight = podded(), example_flight()
    model = chain_model(aircraft, flight, 3)
    morph = ConstantRate(0.0, 0.3, 0.6)
    still = Environment(gust=Gust(amplitude_m_s=0.0, gradient_m=10.0))
    half, whole = (
        fly(
            aircraft, flight, [morph, morph], model=physical_guess(model), duration_s=0.5,
            environment=environment,
        )
        for environment in (None, still)
    )  # fmt: skip
    np.testing.assert_allclose(half.trajectory.euler, whole.trajectory.euler, rtol=0.0, atol=1e-10)
    np.testing.assert_allclose(half.trim.moment_B, whole.trim.moment_B, rtol=1e-9, atol=1e-6)
    np.testing.assert_allclose(half.trim.thrust_moment_B, whole.trim.thrust_moment_B, rtol=1e-9, atol=1e-9)
    grid = time_grid(0.005 * np.arange(81))
    assert mirror_of(aircraft, flight) is not None
    assert flight_plan(model, [morph, morph], grid, may_halve=True).halved
    lone = chain_model(podded(is_even=False), flight, 3)
    assert not flight_plan(lone, [morph, morph], grid, may_halve=True).halved
    rolled = fly(lone.aircraft, flight, [morph, morph], model=physical_guess(lone), duration_s=0.5)
    assert np.abs(rolled.trajectory.phi).max() > 1e-3


def test_elastic_constants_of_a_section() -> None:
    """Stretch by a pull along the span is F L / EA, and a short deep beam shears by F L / GA more."""
    given = SECTION | {"ea_n": 3e6, "ga_chord_n": 2e5, "ga_normal_n": 1e5}
    wing = with_stations(section=given).surfaces[0]
    alone = replace(with_stations(section=given), surfaces=(wing,))
    model = flexible_model(alone, example_flight(), elements=5, lattice=SMALL_LATTICE)
    rest = NodePoses(np.tile(np.eye(3), (model.beams.nodes, 1, 1)), model.rest_W.copy())
    tip, span = int(model.tips[0]), wing.span_m
    for axis, ei, across in ((0, 8e5, 2e5), (2, 5e4, 1e5)):
        force = np.zeros(3)
        force[axis] = 0.1
        bent = clamped_equilibrium(model.beams, rest, [DeadLoad(tip, force_N=tuple(force))])
        assert bent.x[tip, axis] == pytest.approx(0.1 * (span**3 / (3.0 * ei) + span / across), rel=1e-6)
    pulled = clamped_equilibrium(model.beams, rest, [DeadLoad(tip, force_N=(0.0, 1.0, 0.0))])
    assert pulled.x[tip, 1] - span == pytest.approx(span / 3e6, rel=1e-5)


def test_surfaces_overlap_by_their_own_outline() -> None:
    """A tail behind the narrow part of a wing is clear of it, behind the broad part it is not."""
    document = load_aircraft(EXAMPLES / "aircraft.json").model_dump(exclude_none=True)
    right = document["surfaces"][0]
    right["stations"] = [
        {"at": 0.0, "chord_m": 1.0}, {"at": 0.4, "chord_m": 1.0}, {"at": 0.41, "chord_m": 0.2},
        {"at": 1.0, "chord_m": 0.2},
    ]  # fmt: skip
    for y, clash in ((0.4, True), (2.0, False)):
        tail = {
            "name": "tail", "side": "right", "span_m": 0.6, "chord_m": 0.3, "thickness_m": 0.05,
            "material": right["material"], "position_m": [-0.45, y, 0.0], "flexible": False,
        }  # fmt: skip
        aircraft = aircraft_of(document | {"surfaces": [right, tail]})
        assert bool(overlapping_surfaces(aircraft, np.zeros((1, 1)))) is clash


@pytest.mark.parametrize(
    ("rows", "code", "pointer"),
    [
        ([{"at": 0.1}, {"at": 1.0}], "stations_out_of_order", "0/at"),
        ([{"at": 0.0}, {"at": 0.9}], "stations_out_of_order", "1/at"),
        ([{"at": 0.0}, {"at": 0.5}, {"at": 0.5}, {"at": 1.0}], "stations_out_of_order", "2/at"),
        ([{"at": 0.0, "chord_m": 0.4}, {"at": 1.0, "up_m": 0.1}], "axis_not_straight", "1/up_m"),
        ([{"at": 0.0}, {"at": 1.0, "elastic_axis": 0.3}], "axis_not_straight", "1/elastic_axis"),
        ([{"at": 0.0}, {"at": 1.0, "aft_m": 0.3}], "axis_not_straight", "1/elastic_axis"),
        ([{"at": 0.0, "aft_m": 0.3}, {"at": 1.0, "aft_m": 0.3}], "root_moved", "0/aft_m"),
    ],
)
def test_rows_that_cannot_be_flown_are_refused(rows: list[dict[str, Any]], code: str, pointer: str) -> None:
    """Each mistake names its row and what to do; the hint for a bent axis makes it straight."""
    with pytest.raises(InvalidInput) as caught:
        with_stations(*rows)
    fault = caught.value.faults[0]
    assert (fault.code, fault.pointer) == (code, f"/aircraft/surfaces/0/stations/{pointer}")
    assert fault.hint
    if pointer.endswith("elastic_axis"):
        value = float(fault.hint.split("elastic_axis is ")[1].split(" here")[0])
        rows[1]["elastic_axis"] = value
        assert with_stations(*rows).surfaces[0].elastic_axis_offset_m == 0.0


def test_rows_need_a_chord() -> None:
    """Without a chord of the surface's own, each row gives one."""
    with pytest.raises(InvalidInput) as caught:
        with_stations({"at": 0.0, "chord_m": 0.4}, {"at": 1.0}, drop=("chord_m",))
    assert caught.value.faults[0].pointer == "/aircraft/surfaces/0/stations/1/chord_m"
