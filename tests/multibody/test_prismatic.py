"""Motion across a sweep hinge and a slide behind it: against differences of the pose in time."""

from __future__ import annotations

import numpy as np
import pytest

from morphcore.geometry.aircraft import Aircraft
from morphcore.geometry.hinge import hinged_pose
from morphcore.multibody.hinges import hinge_screws, relative_motion
from tests.simulate.telescoped import MOUTH_M, ROOT_M, telescoped

STEP_S = 1e-4


def swept_and_slid() -> Aircraft:
    """Wings that sweep at the body and telescope further out, with dihedral."""
    document = telescoped()
    for surface in document["surfaces"]:
        sign = 1.0 if surface["side"] == "right" else -1.0
        sweep = {"position_m": [0.1, sign * ROOT_M, 0.0], "axis": "z"}
        surface["hinges"] = [sweep, *surface.get("hinges", [])]
    return Aircraft.of(document)


def histories(times: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Angle and extension (k, 2), their rates and accelerations."""
    angles = np.stack([0.5 * np.sin(3.0 * times), 0.4 - 0.3 * np.cos(2.0 * times)], axis=1)
    rates = np.stack([1.5 * np.cos(3.0 * times), 0.6 * np.sin(2.0 * times)], axis=1)
    return angles, rates, np.stack([-4.5 * np.sin(3.0 * times), 1.2 * np.cos(2.0 * times)], axis=1)


@pytest.mark.parametrize("number", [1, 3])
def test_twist_and_acceleration_are_the_derivatives_of_the_pose(number: int) -> None:
    """Also the Coriolis term between a turn and a slide; the screws add up to the twist."""
    surface = swept_and_slid().surfaces[number]
    assert [hinge.prismatic for hinge in surface.hinges] == [False, True]
    times = STEP_S * np.arange(4000)
    angles, rates, accelerations = histories(times)
    arms, rest = surface.root_arms_B, surface.rest_R_BW
    R, r = hinged_pose(surface.hinges, arms, angles, rest)
    twist, change = relative_motion(surface.hinges, arms, angles, rates, accelerations, rest)
    spin = np.einsum("kji,kjl->kil", R, np.gradient(R, STEP_S, axis=0))
    omega = np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=1)
    moved = np.einsum("kji,kj->ki", R, np.gradient(r, STEP_S, axis=0))
    inside = slice(1, -1)
    np.testing.assert_allclose(twist[inside], np.hstack([omega, moved])[inside], atol=1e-6)
    np.testing.assert_allclose(change[inside], np.gradient(twist, STEP_S, axis=0)[inside], atol=1e-5)
    screws = hinge_screws(surface.hinges, arms, angles, rest)
    np.testing.assert_allclose(np.einsum("kmi,km->ki", screws, rates), twist, atol=1e-12)


def test_the_mouth_sweeps_with_the_inner_panel() -> None:
    """At any sweep the panel lies along the inner one: its root on the line to the mouth, e further out."""
    surface = swept_and_slid().surfaces[1]
    angles = np.array([[0.6, 0.25]])
    _, r = hinged_pose(surface.hinges, surface.root_arms_B, angles, surface.rest_R_BW)
    distance = MOUTH_M - ROOT_M - 1.0 + 0.25
    pivot, arm = np.array([0.1, ROOT_M, 0.0]), np.array([-0.1, distance, 0.0])
    turned = surface.hinges[0].rotation(angles[:, 0])[0] @ arm
    np.testing.assert_allclose(r[0], pivot + turned, atol=1e-12)
    assert surface.hidden_m(angles[0]) == pytest.approx(0.75)
