"""The reduced lattice operator against the whole lattice it was reduced from."""

from __future__ import annotations

import numpy as np
import pytest

from morphcore.aero.kernels.loads import MORE_OUTPUTS, OUTPUTS
from morphcore.aero.operator import (
    BODY_AFT,
    COLUMN_MULTIPLE,
    ROW_MULTIPLE,
    aircraft_lattice,
    lattice_operator,
)
from morphcore.aero.vlm import influence
from morphcore.errors import UnsupportedRegime
from morphcore.geometry.aircraft import Aircraft
from morphcore.geometry.lattice import surface_pose
from morphdata.aircraft import load_aircraft
from morphdata.lattice import Lattice
from tests.aero.planforms import EXAMPLES, straight_wings
from tests.models.chains import odd_aircraft
from tests.oracles.lattice import solve_circulation

ANGLES = (0.3, 0.9)


def example_lattice():
    """The reference aircraft's lattice."""
    return aircraft_lattice(Aircraft.of(load_aircraft(EXAMPLES / "aircraft.json")))


def circulations(lattice, angles, inputs):
    """Circulations (r,) of the whole lattice for D0 and D1 of all strips, by the general solver."""
    corners, controls, normals, normal_velocity = [], [], [], []
    for surface, part, strip0, own in zip(
        lattice.aircraft.surfaces,
        lattice.lattices,
        lattice.strip0,
        lattice.aircraft.hinge_columns,
        strict=True,
    ):
        R_BW, r_B = surface_pose(surface, angles[own])
        corners.append((part.ring_corners_W @ R_BW.T + r_B).reshape(-1, 3))
        controls.append((part.control_points_W @ R_BW.T + r_B).reshape(-1, 3))
        normals.append(np.tile(R_BW[:, 2], (part.rings, 1)))
        x = part.control_points_W[..., 0] + surface.elastic_axis_offset_m
        mine = slice(2 * strip0, 2 * (strip0 + part.spanwise))
        normal_velocity.append((inputs[mine][0::2] + inputs[mine][1::2] * x).ravel())
    normals_B = np.concatenate(normals)
    # the structure moves with w along the normal: the air relative to it moves against it
    flow_B = -np.concatenate(normal_velocity)[:, None] * normals_B
    velocity_B = influence(np.concatenate(controls), np.concatenate(corners), lattice.table, BODY_AFT)
    return solve_circulation(velocity_B, normals_B, flow_B)


@pytest.mark.parametrize(
    "build",
    [
        example_lattice,
        lambda: aircraft_lattice(odd_aircraft(np.random.default_rng(3)), Lattice(chordwise=2, spanwise=5)),
    ],
)
def test_circulation_of_any_motion(build):
    """Any velocity of any strip gives the circulation that the whole lattice's own solution has.

    Trailing-edge circulation times width, vortex moment and, in a plane, its chordwise moment, strip by
    strip, to round-off: swept, hinged about other axes, tapered, with the elastic axis off mid-chord.
    """
    lattice = build()
    rng = np.random.default_rng(0)
    angles = tuple(rng.uniform(0.0, 0.9) for _ in lattice.aircraft.hinges)
    inputs = rng.normal(size=2 * lattice.strips)
    gamma = circulations(lattice, angles, inputs)
    found = lattice_operator(lattice, angles).matrix[:, : inputs.size] @ inputs
    ring = 0
    for surface, part, strip0 in zip(
        lattice.aircraft.surfaces, lattice.lattices, lattice.strip0, strict=True
    ):
        mine = gamma[ring : ring + part.rings].reshape(part.chordwise, part.spanwise)
        ring += part.rings
        out = found[OUTPUTS * strip0 : OUTPUTS * (strip0 + part.spanwise)].reshape(-1, OUTPUTS)
        corners = part.ring_corners_W[..., 0] + surface.elastic_axis_offset_m
        width = np.diff(part.strip_edges_m)
        middle = 0.5 * (corners[:, 1:] + corners[:, :-1])
        area = -np.diff(middle, axis=0) * width
        centre = 0.5 * (middle[1:] + middle[:-1])
        scale = np.abs(gamma).max()
        np.testing.assert_allclose(out[:, 0], mine[-1] * width, atol=1e-11 * scale)
        np.testing.assert_allclose(out[:, 1], (mine * area).sum(axis=0), atol=1e-11 * scale)
        if not lattice.has_more_outputs:  # otherwise it is m_x, see tests/aero/test_shapes.py
            np.testing.assert_allclose(out[:, 2], (mine * area * centre).sum(axis=0), atol=1e-11 * scale)


def test_flat_plate_of_six_metres():
    """Two unswept wings without gap, 6 m x 0.3 m at 5 degrees: lift coefficient 0.4806 within 1 per cent.

    Normal velocity V sin(alpha); lift of the trailing edges' circulation, rho V gamma dy, over the planform.
    """
    lattice = aircraft_lattice(straight_wings(3.0, 0.3, 0.3))
    alpha = np.deg2rad(5.0)
    inputs = np.zeros(2 * lattice.strips)
    inputs[0::2] = np.sin(alpha)
    found = lattice_operator(lattice, ()).matrix[:, : inputs.size] @ inputs
    lift = found[0 : OUTPUTS * lattice.strips : OUTPUTS].sum()
    assert lift / (0.5 * 1.8) == pytest.approx(0.4806, rel=0.01)


def test_padding_is_empty():
    """Rows and columns that fill up the tiles hold nothing."""
    lattice = aircraft_lattice(
        odd_aircraft(np.random.default_rng(0)), Lattice.model_construct(chordwise=1, spanwise=3)
    )
    rows, columns = lattice.operator_shape
    assert rows % ROW_MULTIPLE == 0
    assert columns % COLUMN_MULTIPLE == 0
    matrix = lattice_operator(lattice, (0.1, 0.2, 0.1)).matrix
    assert matrix.shape == (rows, columns)
    np.testing.assert_array_equal(matrix[(OUTPUTS + MORE_OUTPUTS) * lattice.strips :], 0.0)
    np.testing.assert_array_equal(matrix[:, 2 * lattice.strips :], 0.0)


def test_mirror():
    """Exchanging the wings' sweeps exchanges the wings' blocks; what makes side force changes sign."""
    lattice = example_lattice()
    one, other = (lattice_operator(lattice, angles).matrix[:100, :40] for angles in (ANGLES, ANGLES[::-1]))
    rows = np.roll(np.arange(100), 50)
    columns = np.roll(np.arange(40), 20)
    sign = np.tile([1.0, 1.0, 1.0, 1.0, -1.0], 20)[:, None]
    mirrored = sign * other[np.ix_(rows, columns)]
    scale = np.abs(one).max(axis=1, keepdims=True)
    np.testing.assert_allclose(mirrored / scale, one / scale, atol=1e-11)


def test_uniform_incidence_lifts_everywhere():
    """A wing that sinks has lift on every strip: positive circulation for a velocity along +z."""
    lattice = example_lattice()
    for sweep in (0.0, 0.6, 1.2):
        operator = lattice_operator(lattice, (sweep, sweep))
        outputs = operator.matrix[:100, 0:40:2].sum(axis=1)
        assert (outputs[0::5] > 0.0).all()
        # trailing edge half a chord behind the mid-chord axis, centre of circulation at the quarter chord
        np.testing.assert_allclose(operator.strips[:, 0], -0.15, atol=1e-12)
        np.testing.assert_allclose(operator.strips[:, 1].mean(), 0.075, atol=0.015)


@pytest.mark.parametrize("mach", [0.3, 0.6])
def test_compressibility(mach):
    """Lift grows by less than Prandtl and Glauert's plane-flow factor; beyond Mach 0.7 the method ends."""
    lattice = example_lattice()
    slow, fast = (
        lattice_operator(lattice, (0.0, 0.0), mach=m).matrix[0:100:5, 0:40:2].sum() for m in (0.0, mach)
    )
    assert 1.0 < fast / slow < 1.0 / np.sqrt(1.0 - mach**2)
    with pytest.raises(UnsupportedRegime):
        lattice_operator(lattice, (0.0, 0.0), mach=0.8)


def test_angles_are_those_of_hinges():
    """An aircraft without hinges takes no angles; angles that belong to nothing are refused."""
    lattice = aircraft_lattice(straight_wings(3.0, 0.3, 0.3), Lattice(chordwise=2, spanwise=4))
    assert np.isfinite(lattice_operator(lattice, ()).matrix).all()
    with pytest.raises(ValueError, match="2 angles for 0 hinges"):
        lattice_operator(lattice, (0.7, 0.2))
