"""Flights of swept, inclined and upright surfaces: mirror images, stiff beams and links, bending."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from morphcore.geometry.aircraft import Aircraft
from morphcore.geometry.mirror import mirror_of
from morphcore.models.equivalent import chain_model, physical_guess
from morphcore.models.flexible import flexible_model
from morphcore.models.kinematics import tip_positions
from morphcore.simulate.flexible import FlexibleFlight, hinge_path
from morphcore.simulate.flexible_trim import FlexibleTrim, trim_flexible
from morphcore.simulate.plan import flight_plan
from morphcore.simulate.schedule import ConstantRate, Hold
from morphcore.simulate.time_grid import TimeGrid
from morphcore.simulate.trim import trim
from morphdata.lattice import Lattice
from tests.aero.shaped import MATERIAL, aircraft, pair, surface
from tests.models.chains import SMALL_LATTICE, airless, example_flight, instant
from tests.simulate.flights import fly, steps

FLIGHT = replace(example_flight(), airspeed_m_s=45.0, start=None)
COARSE = Lattice(chordwise=2, spanwise=5)
OUT, IN = ConstantRate(0.0, 0.25, 0.5), ConstantRate(0.0, 0.1, 0.5)


def wings(**more: Any) -> list[dict[str, Any]]:
    """Flexible hinged wings, swept, with dihedral and incidence, axes off mid-chord."""
    shape: dict[str, Any] = {
        "flexible": True,
        "sweep_rad": 0.4,
        "dihedral_rad": 0.15,
        "incidence_rad": 0.03,
        "elastic_axis_offset_m": 0.03,
        "mass_axis_offset_m": 0.01,
        "profile_drag": 0.01,
    }
    pairs = pair("wing", 2.5, (0.5, 0.35), **shape | more)
    for wing in pairs:
        y = 0.3 if wing["side"] == "right" else -0.3
        wing["position_m"] = [0.1, y, 0.0]
        wing["hinge"] = {"position_m": [0.2, y, 0.0], "axis": "z"}
    return pairs


TAIL = pair("tail", 1.0, (0.3, 0.3), position_m=[-3.0, 0.0, -0.2], sweep_rad=0.3, dihedral_rad=-0.2)
# above the wake, whose direction differs between the models: along the body, along the stream
HIGH_TAIL = pair("tail", 1.0, (0.3, 0.3), position_m=[-3.0, 0.0, -0.8], sweep_rad=0.3, dihedral_rad=0.2)
FIN = surface(
    "fin", "right", 0.9, (0.5, 0.3), position_m=[-2.8, 0.0, -0.2], dihedral_rad=1.5708, sweep_rad=0.5,
    flexible=True, profile_drag=0.01,
)  # fmt: skip


def reflected(given: Aircraft) -> Aircraft:
    """The mirror image, every surface with the name of its original's partner; drives change sides."""
    surfaces = []
    for each in given.surfaces:
        x, y, z = each.position_m
        other = "left" if each.side == "right" else "right"
        surfaces.append(
            replace(
                each,
                name=each.name.replace(each.side, other),
                side=other,
                position_m=(x, -y, z),
                hinges=tuple(
                    replace(hinge.reflection, drive=hinge.drive.replace(each.side, other))
                    for hinge in each.hinges
                ),
            )
        )
    return replace(given, surfaces=tuple(surfaces))


def flown(shape: Aircraft, kind: str, left: ConstantRate, right: ConstantRate) -> Any:
    """A short flight."""
    model = physical_guess(chain_model(shape, FLIGHT, 3)) if kind == "equivalent" else kind
    return fly(
        shape, FLIGHT, {"sweep_left": left, "sweep_right": right}, model=model, duration_s=0.3,
        lattice=COARSE, **({"elements": 4, "step_s": 0.0025} if kind == "flexible" else {"step_s": 0.005}),
    ).trajectory  # fmt: skip


@pytest.mark.parametrize("kind", ["rigid", "equivalent", "flexible"])
def test_mirror_images_fly_mirrored_flights(kind: str) -> None:
    """Wings swept unevenly by their drives, a V tail and a fin: roll and yaw change sign, to 1e-9 rad."""
    shape = aircraft(*wings(), *TAIL, FIN)
    there = flown(shape, kind, OUT, IN)
    back = flown(reflected(shape), kind, IN, OUT)
    assert np.ptp(there.phi) > 1e-3
    np.testing.assert_allclose(back.euler, there.euler * [-1.0, 1.0, -1.0], rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("kind", ["rigid", "equivalent", "flexible"])
def test_a_fin_on_the_centre_line_is_its_own_image(kind: str) -> None:
    """A symmetric aircraft with a fin flies straight; named right or left, the fin does the same."""
    shape = aircraft(*wings(), FIN)
    assert mirror_of(shape, FLIGHT) is None  # flown whole
    one = flown(shape, kind, OUT, OUT)
    assert np.abs(one.phi).max() < 1e-9
    assert np.abs(one.psi).max() < 1e-9
    assert np.ptp(one.theta) > 1e-3
    uneven = flown(shape, kind, OUT, IN)
    named_left = aircraft(*wings(), FIN | {"side": "left"})
    np.testing.assert_allclose(flown(named_left, kind, OUT, IN).euler, uneven.euler, rtol=0.0, atol=1e-9)


def test_half_an_aircraft_stands_for_both_sides() -> None:
    """Operators, hinges and flight of the half are the whole's, with a V tail; any difference flies whole."""
    shape = aircraft(*wings(), *TAIL)
    model = chain_model(shape, FLIGHT, 3, COARSE)
    guess, schedules = physical_guess(model), [OUT, OUT]
    half, whole = (
        flight_plan(model, schedules, steps(0.3, 0.005), may_halve=may_halve) for may_halve in (True, False)
    )
    assert half.halved
    of_half, of_whole = (trim(plan.flown(model), guess, plan).require() for plan in (half, whole))
    np.testing.assert_allclose(of_half.alpha, of_whole.alpha, rtol=0.0, atol=1e-11)
    np.testing.assert_allclose(of_half.force_B, of_whole.force_B, rtol=0.0, atol=1e-7)
    np.testing.assert_allclose(of_half.moment_B, of_whole.moment_B, rtol=0.0, atol=1e-7)
    for change in ("sweep_rad", "dihedral_rad", "incidence_rad"):
        right, *others = wings()
        assert mirror_of(aircraft(right | {change: 0.02}, *others, *TAIL), FLIGHT) is None


@pytest.mark.parametrize("law", ["line", "smoothed"])
def test_stiff_beams_are_trimmed_like_links(law: str) -> None:
    """Angle of attack, thrust and moment of beams and of links agree within 0.2 per cent at a small angle.

    Two programs: links on the reduced lattice, beams under every edge of theirs. The wings' incidence carries
    the weight at an angle of attack near zero, where both wakes leave along the body: the angle is compared
    in units of this incidence.
    """
    settings = Lattice.model_validate({"chordwise": 4, "spanwise": 8, "core": {"law": law}})
    incidence, fast = 0.0815, replace(FLIGHT, airspeed_m_s=70.0)
    material = MATERIAL | {"youngs_modulus_pa": 2e12}
    shape = aircraft(*wings(incidence_rad=incidence, material=material), *HIGH_TAIL)
    beams = flexible_trim(shape, settings, [0.2, 0.2], flight=fast)
    for links in (1, 3):
        model = chain_model(shape, fast, links, settings)
        plan = instant(model, np.array([[0.2, 0.0, 0.0]] * 2))
        found = trim(model, physical_guess(model), plan).require()
        assert abs(found.alpha[0]) < 0.005
        assert found.alpha[0] == pytest.approx(beams.alpha, abs=0.002 * incidence)
        assert found.force_B[0, 0] == pytest.approx(beams.force_B[0], rel=0.002)
        assert found.moment_B[0, 1] == pytest.approx(beams.moment_B[1], rel=0.002)


def test_stiff_beams_fly_like_links() -> None:
    """An uneven morph of the same aircraft with a fin: roll and pitch within a hundredth of the motion.

    Yaw is within three: the links' wake keeps its direction and does not follow the sideslip, to which the
    fin is sensitive (0.03 mrad a mrad of it).
    """
    fast = replace(FLIGHT, airspeed_m_s=70.0)
    material = MATERIAL | {"youngs_modulus_pa": 2e12}
    shape = aircraft(
        *wings(incidence_rad=0.0815, material=material), *HIGH_TAIL, FIN | {"material": material}
    )
    links, beams = (
        fly(
            shape, fast, {"sweep_left": OUT, "sweep_right": IN}, model=kind, duration_s=0.6, step_s=0.0025,
            lattice=COARSE, **({"elements": 4} if kind == "flexible" else {}),
        ).trajectory.euler
        for kind in ("rigid", "flexible")
    )  # fmt: skip
    moved = np.ptp(beams, axis=0)
    print(moved, np.abs(links - beams).max(axis=0))
    assert moved.min() > 5e-3
    assert (np.abs(links - beams).max(axis=0) < [0.01, 0.01, 0.03] * moved).all()


def flexible_trim(shape: Aircraft, settings: Lattice, angles: list[float], **options: Any) -> FlexibleTrim:
    """The flexible model's trim."""
    flight = options.pop("flight", FLIGHT)
    model = flexible_model(shape, flight, elements=options.pop("elements", 4), lattice=settings)
    path = hinge_path(model, [Hold(angle) for angle in angles], TimeGrid(0.0, 1e-3, 2, None))
    return trim_flexible(FlexibleFlight(model), path, np.zeros(3), **options)


@pytest.mark.parametrize("sweep_rad", [0.0, 0.6, -0.6])
def test_a_swept_beam_bends_along_its_axis(sweep_rad: float) -> None:
    """Under a uniform load w the tip of a box sinks by w l^4 / (8 EI) with l = span / cos(sweep).

    The box is chord cos(sweep) wide across the axis: w = rho A a and EI = E chord cos(sweep) t^3 / 12. Pushed
    in a vacuum with a heavy fuselage, its inertia loads the wing. Beams within 0.1 per cent; three links
    within 5 per cent (four too little by theory), eight within 0.5.
    """
    span, chord, thickness, push = 2.5, 0.4, 0.05, 1.0
    heavy = 1e9
    shape = aircraft(*pair("wing", span, (chord, chord), sweep_rad=sweep_rad, flexible=True))
    shape = replace(shape, fuselage=replace(shape.fuselage, mass_kg=heavy, inertia_B=heavy * np.eye(3)))
    assert example_flight().start is not None
    mass = sum(float(s.section_at(np.zeros(1)).mass[0]) * s.length_m for s in shape.surfaces)
    assert mass == pytest.approx(2 * 500.0 * span * chord * thickness, rel=1e-12)
    start = replace(
        example_flight().start,
        alpha_rad=0.0,
        force_B=np.array([0.0, 0.0, -push * (heavy + mass)]),
        moment_B=np.zeros(3),
    )
    flight = replace(airless(example_flight(), gravity=0.0), start=start)
    length, width = span / np.cos(sweep_rad), chord * np.cos(sweep_rad)
    load = 500.0 * width * thickness * push
    expected = load * length**4 / (8.0 * 2.1e9 * width * thickness**3 / 12.0)
    model = flexible_model(shape, flight, elements=10, lattice=SMALL_LATTICE)
    found = flexible_trim(shape, SMALL_LATTICE, [], flight=flight, elements=10, start="given")
    poses = found.state.poses
    sunk = poses.x[model.tips, 2] - poses.x[model.roots, 2]
    np.testing.assert_allclose(sunk, expected, rtol=1e-3)
    for links, tolerance in ((3, 0.05), (8, 0.005)):
        chain = chain_model(shape, flight, links, SMALL_LATTICE)
        batch, plan = physical_guess(chain), instant(chain, np.zeros((0, 3)))
        settled = trim(chain, batch, plan, start="given").require()
        tips = tip_positions(chain, batch, plan.hinges[0], settled.q_joint)
        np.testing.assert_allclose(tips[0, :, 2], expected, rtol=tolerance)


def test_in_a_vacuum_links_and_nodes_move_alike() -> None:
    """Two programs move shaped wings, swept unevenly, in the same way: inertia and hinges in their axes.

    A tumble without air: fuselage, wings off their axes and hinges off the roots exchange their momentum. The
    wings are rigid, the fin nearly so.
    """
    fin = FIN | {"material": MATERIAL | {"youngs_modulus_pa": 2e12}}
    shape = aircraft(*wings(flexible=False, mass_axis_offset_m=-0.08), fin)
    given = example_flight().start
    assert given is not None
    flight = replace(airless(FLIGHT), start=replace(given, alpha_rad=0.1))
    there, back = (
        fly(
            shape, flight, {"sweep_left": OUT, "sweep_right": IN}, model=kind, duration_s=0.5,
            step_s=0.001, start="given", lattice=SMALL_LATTICE,
        ).trajectory.euler
        for kind in ("rigid", "flexible")
    )  # fmt: skip
    assert np.ptp(there, axis=0).min() > 1e-4
    np.testing.assert_allclose(there, back, rtol=0.0, atol=1e-6)
