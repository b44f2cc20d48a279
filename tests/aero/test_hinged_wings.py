"""The reference aircraft with its wings swept: symmetry, smoothness, the vortex core."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from morphcore.errors import InvalidInput
from morphcore.geometry.aircraft import Aircraft
from morphdata.aircraft import load_aircraft
from morphdata.lattice import Lattice, VortexCore
from tests.aero.planforms import EXAMPLES, straight_wings
from tests.oracles.polar import steady_polar

ALPHA = 0.0623
MIRROR_FORCE = np.array([1.0, -1.0, 1.0])
MIRROR_MOMENT = -MIRROR_FORCE


def with_core(fraction: float) -> Lattice:
    """The default lattice with a core of another size."""
    return Lattice(core=VortexCore(fraction=fraction))


@pytest.fixture(scope="module")
def aircraft() -> Aircraft:
    """The reference aircraft."""
    return Aircraft.of(load_aircraft(EXAMPLES / "aircraft.json"))


@pytest.mark.parametrize(("sweep", "beta"), [((0.3, 0.9), 0.1), ((1.2, 0.0), 0.0), ((0.7, 0.7), -0.2)])
def test_mirrored_flight_mirrors_the_loads(aircraft, sweep, beta):
    """Wings and sideslip exchanged between right and left mirror force and moment to round-off."""
    one = steady_polar(aircraft, 150.0, 1.225, ALPHA, beta_rad=beta, hinge_rad=sweep)
    other = steady_polar(aircraft, 150.0, 1.225, ALPHA, beta_rad=-beta, hinge_rad=sweep[::-1])
    scale = np.abs(one.edges.force_B).sum()
    np.testing.assert_allclose(one.force_B * MIRROR_FORCE, other.force_B, atol=1e-12 * scale)
    np.testing.assert_allclose(one.moment_B * MIRROR_MOMENT, other.moment_B, atol=1e-12 * 3 * scale)
    np.testing.assert_allclose(one.strip_lift_n[0], other.strip_lift_n[1], atol=1e-12 * scale)


def test_symmetric_flight_has_no_side_loads(aircraft):
    """Equal wings without sideslip make no side force, roll or yaw beyond round-off."""
    loads = steady_polar(aircraft, 150.0, 1.225, ALPHA, hinge_rad=(0.8, 0.8))
    assert abs(loads.side_n) < 1e-10 * loads.lift_n
    assert np.abs(loads.moment_B[[0, 2]]).max() < 1e-10 * loads.lift_n


@pytest.mark.parametrize("beta", [0.0, 0.1])
@pytest.mark.parametrize("left_share", [1.0, 0.5, 0.0])
def test_no_singularity_in_the_whole_sweep(aircraft, left_share, beta):
    """From 0 to 1.2 rad loads are smooth in the sweep: wings alike, unlike or one alone, sideslip or not.

    A singularity between two of the 241 angles, 5 mrad apart, would show in the second difference: smooth
    curves have a curvature of the order of the load itself over a radian squared (cos-like: 1; here at most
    1.3 in lift, 2 in moments over span), a vortex passing a control point some hundreds.
    """
    angles = np.linspace(0.0, 1.2, 241)
    loads = [
        steady_polar(aircraft, 150.0, 1.225, ALPHA, beta_rad=beta, hinge_rad=(a, left_share * a))
        for a in angles
    ]
    step = angles[1] - angles[0]
    lift = np.array([load.lift_n for load in loads])
    moment = np.array([load.moment_B for load in loads])
    drag = np.array([load.drag_n for load in loads])
    assert np.abs(np.diff(lift, 2)).max() / step**2 < 2.0 * lift[0]
    assert np.abs(np.diff(moment, 2, axis=0)).max() / step**2 < 2.0 * lift[0] * 3.0
    assert np.abs(np.diff(drag, 2)).max() / step**2 < 10.0 * drag[0]
    assert 0.2 * lift[0] < lift.min()
    assert lift.max() < 1.01 * lift[0]
    assert (drag > 0).all()


@pytest.mark.parametrize("sweep", [0.0, 1.2])
def test_core_does_not_matter(aircraft, sweep):
    """A core ten times smaller changes lift by less than 1e-3, unswept and fully swept."""
    lifts = [
        steady_polar(aircraft, 150.0, 1.225, ALPHA, hinge_rad=(sweep, sweep), lattice=with_core(core)).lift_n
        for core in (0.1, 0.01)
    ]
    assert lifts[0] == pytest.approx(lifts[1], rel=1e-3)


@pytest.mark.parametrize("core", [0.1, 1e-6])
def test_core_holds_where_a_leg_strikes_a_control_point(core):
    """A wing shifted sideways in the plane of another's wake: its control points pass the legs within 0.1 mm.

    The largest circulation stays within 2 per cent of that of a clear pass midway between the legs, whatever
    the core at the trailing edge: it has grown to the width of a strip.
    """
    wings = straight_wings(1.0, 0.2, 0.2)
    front = wings.surfaces[0]

    def peak(offset: float) -> float:
        rear = replace(front, name="rear", position_m=(-0.5, offset, 0.0))
        # at this angle the wake stays in the plane of the rear wing
        loads = steady_polar(replace(wings, surfaces=(front, rear)), 1.0, 1.0, 1e-9, lattice=with_core(core))
        return float(np.abs(loads.circulation).max())

    struck = max(
        peak(offset) for offset in np.linspace(0.049, 0.051, 21)
    )  # legs every 0.1 m, controls halfway
    assert struck / peak(0.0) == pytest.approx(1.0, abs=0.02)


def test_lift_of_the_strips_adds_up(aircraft):
    """Strip lifts of both wings add up to the lift; the tip of an unswept wing carries least."""
    loads = steady_polar(aircraft, 150.0, 1.225, ALPHA)
    assert sum(strip.sum() for strip in loads.strip_lift_n) == pytest.approx(loads.lift_n, rel=1e-12)
    for strip in loads.strip_lift_n:
        assert strip.argmin() == strip.size - 1


def test_hinge_angles_must_fit(aircraft):
    """One angle for two hinges is an error."""
    with pytest.raises(InvalidInput, match="1 hinge angles for 2 hinges"):
        steady_polar(aircraft, 150.0, 1.225, ALPHA, hinge_rad=(0.1,))
