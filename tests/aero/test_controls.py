"""Air loads of control surfaces against thin-airfoil theory and another program's vortex lattice."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

from morphcore.aero.kernels.loads import CONTROL0, CONTROL_END
from morphcore.geometry.aircraft import Aircraft, Flight
from morphcore.geometry.control_slopes import flap_effectiveness, flap_weights
from morphcore.models.equivalent import chain_model
from morphdata.aircraft import Aircraft as AircraftDocument
from morphdata.lattice import Lattice, VortexCore
from tests.aero.controlled import (
    DENSITY,
    SPEED,
    TAIL,
    TAIL_ARM,
    TAIL_HEIGHT,
    WING,
    beam_loads,
    chain_loads,
    flight_document,
    surface,
    tailed,
)

Q_DYN = 0.5 * DENSITY * SPEED**2
ALPHA, STEP = 0.05, 0.01  # rad
LOADS = {"chain": chain_loads, "beam": beam_loads}
ROLL, PITCH, YAW, LIFT = 0, 1, 2, 5  # rows of moment and force in B


def derivative(kind: str, document: dict, drive: str, lattice: Lattice, alpha: float = ALPHA) -> np.ndarray:
    """(6,) moment and force over the dynamic pressure, per rad of a drive."""
    more, less = (LOADS[kind](document, alpha, {drive: angle}, lattice) for angle in (STEP, -STEP))
    return (more - less) / (2 * STEP * Q_DYN)


@pytest.mark.parametrize("rows", [1, 2, 3, 4, 8])
@pytest.mark.parametrize("chord_fraction", [0.05, 0.2, 0.25, 0.37, 0.9])
def test_the_strip_has_glauerts_lift_and_moment(rows, chord_fraction):
    """The lattice in two dimensions, solved vortex by vortex, has the loads of Glauert's flap."""
    vortex, point = (np.arange(rows) + 0.25) / rows, (np.arange(rows) + 0.75) / rows
    induced = 1.0 / (2.0 * np.pi * np.subtract.outer(point, vortex))
    gamma = np.linalg.solve(induced, flap_weights(rows, chord_fraction))
    lift, moment = flap_effectiveness(chord_fraction)
    assert 2.0 * gamma.sum() == pytest.approx(lift, rel=1e-12)
    if rows > 1:  # one vortex cannot have a moment about itself
        assert 2.0 * gamma @ (0.25 - vortex) == pytest.approx(moment, rel=1e-10)


def test_flap_effectiveness_is_glauerts():
    """Values from the Fourier coefficients A0, A1, A2 of the slope, integrated numerically."""
    theta = (np.arange(200_000) + 0.5) * np.pi / 200_000
    for chord_fraction in (0.1, 0.3, 0.5):
        slope = np.where(0.5 * (1.0 - np.cos(theta)) > 1.0 - chord_fraction, 1.0, 0.0)
        a0, a1, a2 = (f * np.mean(slope * np.cos(n * theta)) for n, f in ((0, 1.0), (1, -2.0), (2, -2.0)))
        lift, moment = np.pi * (2.0 * a0 + a1), -0.25 * np.pi * (a1 - a2)
        assert flap_effectiveness(chord_fraction) == pytest.approx((lift, moment), abs=1e-4)


def test_weights_are_continuous():
    """Neither the weights, over the chord fraction, nor the loads, over the ends, jump."""
    fractions = np.linspace(0.05, 0.9, 2001)
    weights = np.stack([flap_weights(4, float(fraction)) for fraction in fractions])
    assert np.abs(np.diff(weights, axis=0)).max() < 5e-3
    lattice = Lattice(chordwise=2, spanwise=6)
    lifts = []
    for shift in np.linspace(-1e-3, 1e-3, 5):  # across the edge of a strip, at half the span
        document = tailed()
        document["surfaces"][0]["controls"][0]["from"] = 0.5 + shift
        lifts.append(chain_loads(document, ALPHA, {"aileron_right": 0.1}, lattice)[LIFT])
    changes = np.diff(lifts)
    assert np.all(changes > 0.0)
    assert np.ptp(changes) < 0.5 * changes.mean()  # the slope has a corner at the strip's edge, and no jump


@pytest.mark.parametrize("kind", ["chain", "beam"])
@pytest.mark.parametrize("rows", [1, 2, 4])
def test_high_aspect_ratio_flap_against_glauert(kind, rows):
    """At aspect ratio 800, CL per rad over that of incidence is Glauert's tau, within 0.5 per cent.

    The ratio does not depend on the aspect ratio in lifting-line theory. Of the moment about the quarter
    chord, which incidence does not have, the value itself within 2 per cent.
    """
    chord, semi_span, chord_fraction = 0.1, 40.0, 0.3
    flap = [{"name": "flap", "from": 0.0, "to": 1.0, "chord_fraction": chord_fraction}]
    document = {
        **tailed(),
        "surfaces": [
            surface(side, "wing", (semi_span, chord), -0.25 * chord, controls=flap)
            for side in ("right", "left")
        ],
    }
    lattice = Lattice(chordwise=rows, spanwise=16)
    of_flap = derivative(kind, document, "flap", lattice, alpha=0.0)
    more, less = (LOADS[kind](document, alpha, {}, lattice) for alpha in (1e-3, -1e-3))
    of_incidence = (more - less) / (2e-3 * Q_DYN)
    lift, moment = flap_effectiveness(chord_fraction)
    assert of_flap[LIFT] / of_incidence[LIFT] == pytest.approx(lift / (2 * np.pi), rel=5e-3)
    area = 2 * semi_span * chord
    assert -of_flap[LIFT] / area == pytest.approx(lift, rel=0.02)
    if rows > 1:
        assert of_flap[PITCH] / (area * chord) == pytest.approx(moment, rel=0.02)


def flapped(chord_fraction, angle):
    """Another program's airfoil: a thin plate with a plain flap."""
    import aerosandbox as asb

    x = np.linspace(0.0, 1.0, 201)
    z = -np.maximum(x - 1.0 + chord_fraction, 0.0) * np.tan(angle)
    half = 1e-4 * (1.0 - x)
    upper, lower = np.stack([x, z + half], axis=1), np.stack([x, z - half], axis=1)
    return asb.Airfoil("flapped", coordinates=np.concatenate([upper[::-1], lower[1:]]))


def other_loads(drive, angle, strips, rows):
    """(6,) moment and force over the dynamic pressure of `tailed` in AeroSandbox's vortex lattice."""
    import aerosandbox as asb

    wings = []

    def stretch(ends, chord, aft, up, airfoil, count):
        sections = [
            asb.WingXSec(xyz_le=[aft - 0.5 * chord, y, up], chord=chord, airfoil=airfoil)
            for y in np.linspace(*sorted(ends), count + 1)
        ]
        wings.append(asb.Wing(xsecs=sections))

    for sign in (1.0, -1.0):
        for begin, end in ((0.0, 0.5), (0.5, 0.9), (0.9, 1.0)):
            moved = sign * angle if drive == "aileron" and begin == 0.5 else 0.0
            ends = sign * begin * WING[0], sign * end * WING[0]
            stretch(ends, WING[1], 0.0, 0.0, flapped(0.25, moved), round(strips * (end - begin)))
        moved = angle if drive == "elevator" else 0.0
        stretch((0.0, sign * TAIL[0]), TAIL[1], TAIL_ARM, TAIL_HEIGHT, flapped(0.35, moved), strips)
    found = asb.VortexLatticeMethod(
        asb.Airplane(wings=wings, xyz_ref=[0, 0, 0], s_ref=1, c_ref=1, b_ref=1),
        asb.OperatingPoint(velocity=SPEED, alpha=np.degrees(ALPHA)),
        spanwise_resolution=1,
        chordwise_resolution=rows,
        chordwise_spacing_function=np.linspace,
        align_trailing_vortices_with_wind=True,
    ).run()
    loads = [found["l_b"], found["m_b"], found["n_b"], *np.ravel(found["F_b"])]
    return np.array([float(np.squeeze(each)) for each in loads]) / Q_DYN


@pytest.mark.parametrize("kind", ["chain", "beam"])
@pytest.mark.parametrize(("drive", "rows_of_loads"), [("elevator", (PITCH, LIFT)), ("aileron", (ROLL,))])
def test_control_derivatives_against_aerosandbox(kind, drive, rows_of_loads):
    """CL and Cm of the elevator and Cl of the ailerons per rad: within 3 per cent, from four rows of panels.

    The other program's flaps are bent plates of 20 rows, so that a hinge line is at an edge of panels.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # those of the other program are not ours
        more, less = (other_loads(drive, angle, 10, 20) for angle in (STEP, -STEP))
    other = (more - less) / (2 * STEP)
    ours = derivative(kind, tailed(), drive, Lattice(chordwise=4, spanwise=10))
    for row in rows_of_loads:
        assert ours[row] == pytest.approx(other[row], rel=0.03)


@pytest.mark.parametrize("law", ["line", "smoothed"])
@pytest.mark.parametrize("drive", ["elevator", "aileron", "aileron_left"])
def test_chain_and_beam_agree(law, drive):
    """The reduced operator and the sum over all edges see one lattice: 1 per cent of the largest load apart.

    The adverse yaw, which is of second order, within 3 per cent. What differs is the wake, which leaves along
    the body's axis and along the stream.
    """
    lattice = Lattice(chordwise=4, spanwise=8, core=VortexCore(law=law))
    chain, beam = (derivative(kind, tailed(), drive, lattice) for kind in ("chain", "beam"))
    np.testing.assert_allclose(chain, beam, atol=0.01 * np.abs(beam).max())
    if drive == "aileron":
        assert chain[YAW] == pytest.approx(beam[YAW], rel=0.03)


@pytest.mark.parametrize("kind", ["chain", "beam"])
def test_goethert(kind):
    """A flap at Mach M lifts 1/beta times as much as that of a wing of beta times the span: within 1e-3."""
    mach, lattice = 0.5, Lattice(chordwise=4, spanwise=10)
    beta = np.sqrt(1.0 - mach**2)

    def lift(semi_span, **flight):
        flap = [{"name": "flap", "from": 0.2, "to": 0.8, "chord_fraction": 0.3}]
        surfaces = [
            surface(side, "wing", (semi_span, 0.25), 0.0, controls=flap) for side in ("right", "left")
        ]
        document = {**tailed(), "surfaces": surfaces}
        return LOADS[kind](document, 0.0, {"flap": 1e-3}, lattice, **flight)[LIFT] / semi_span

    assert lift(1.5, mach=mach) == pytest.approx(lift(1.5 * beta) / beta, rel=1e-3)


def test_aircraft_without_controls_have_no_further_inputs():
    """Two inputs for each strip, as ever; with controls one more for each strip from their first to last."""
    plain = tailed()
    for each in plain["surfaces"]:
        del each["controls"]
    of_tail = tailed()
    for number in (0, 2):
        del of_tail["surfaces"][number]["controls"]
    flight, lattice = Flight.of(flight_document()), Lattice(chordwise=2, spanwise=8)
    columns = {}
    for name, document in {"plain": plain, "tail": of_tail, "all": tailed()}.items():
        model = chain_model(Aircraft.of(AircraftDocument.parse(document)), flight, 2, lattice)
        columns[name] = (
            model.lattice.operator_shape[1],
            model.surfaces[:, CONTROL0 : CONTROL_END + 1].tolist(),
        )
    none, every = [64, 0, 0], [64, 0, 8]
    assert columns["plain"] == (64, [none] * 4)
    assert columns["tail"] == (80, [none, every, [72, 0, 0], [72, 0, 8]])
    # the ailerons cover the strips 4 to 7 of each wing
    assert columns["all"] == (88, [[60, 4, 8], [68, 0, 8], [72, 4, 8], [80, 0, 8]])
