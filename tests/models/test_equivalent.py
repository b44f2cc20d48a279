"""The equivalent model's parameters: limits, first guesses, smoothness in the division, lanes."""

from __future__ import annotations

import numpy as np
import pytest

from morphcore.aero.kernels.loads import JONES_A1, JONES_A2, JONES_B1, JONES_B2
from morphcore.errors import InvalidInput
from morphcore.lanes import TOGETHER, lane_width
from morphcore.models.equivalent import (
    chain_model,
    from_lanes,
    lane_constants,
    physical_guess,
    to_lanes,
)
from morphcore.models.parameters import lag_weights
from morphcore.simulate.batch import state_rates
from morphcore.simulate.time_grid import STEP_S
from tests.models.chains import (
    example_aircraft,
    example_flight,
    instant,
    random_batch,
    random_hinges,
    random_state,
    small_model,
)


@pytest.mark.parametrize(("links", "bound"), [(0, "least 1"), (17, "most 16"), (-1, "least 1")])
def test_number_of_links_is_limited(links, bound):
    """One to eight, and the error says which of the two was broken."""
    with pytest.raises(InvalidInput) as caught:
        chain_model(example_aircraft(), example_flight(), links)
    assert caught.value.pointer == "/model/links_per_wing"
    assert bound in caught.value.hint


@pytest.mark.parametrize("particles", [1, TOGETHER - 1, TOGETHER, 2 * TOGETHER + 3])
def test_lanes_there_and_back(particles):
    """Laying out in lanes loses nothing; the lanes left over hold the last particle."""
    values = np.random.default_rng(particles).normal(size=(particles, 7))
    blocks = to_lanes(values)
    width = lane_width(particles)
    assert blocks.shape == (-(-particles // width), 7, width)
    np.testing.assert_array_equal(from_lanes(blocks, particles), values)
    flat = blocks.transpose(0, 2, 1).reshape(-1, 7)
    np.testing.assert_array_equal(flat[particles:], np.tile(values[-1], (flat.shape[0] - particles, 1)))


def test_natural_lag_is_jones_mean():
    """The default lag is the mean delay of Jones' function: its deficit's integral over s = 2 V t / c."""
    model = small_model(example_aircraft(), example_flight(), 2)
    s = np.linspace(0.0, 600.0, 600_001)
    deficit = JONES_A1 * np.exp(-JONES_B1 * s) + JONES_A2 * np.exp(-JONES_B2 * s)
    natural_lag_s = physical_guess(model)["lag_s"][0]
    assert natural_lag_s == pytest.approx(np.trapezoid(deficit, s) * 0.3 / (2 * 150.0), rel=1e-5)


def test_physical_guess_has_beta_damping():
    """c = beta k, neutral corrections, the surface's own profile drag."""
    model = small_model(example_aircraft(), example_flight(), 3)
    guess = physical_guess(model)
    np.testing.assert_allclose(guess["damping_nms_rad"], 0.004 * guess["stiffness_nm_rad"])
    assert guess["lift_factor"][0] == 1.0
    assert guess["ac_offset_m"][0] == 0.0
    assert guess["profile_drag"][0, 0] == 0.01
    assert guess["division"].shape == (1, 1, 3)


def test_positional_sets():
    """Sets without names are those of the flexible surfaces in order; one without a name is everyone's."""
    rng = np.random.default_rng(0)
    model = small_model(example_aircraft(), example_flight(), 2)
    apart = random_batch(rng, model, 1, separate_wings=True)
    own = ("division", "stiffness_nm_rad", "damping_nms_rad", "profile_drag")
    same = apart.changed(**{name: apart[name][:, :1] for name in own})
    repeated = same.changed(**{name: same[name].repeat(2, axis=1) for name in own})
    rows = [lane_constants(model, batch, STEP_S).rows for batch in (same, repeated, apart)]
    np.testing.assert_array_equal(rows[0], rows[1])
    assert (rows[0] != rows[2]).any()


def test_lag_weights_are_the_exponentials_integrals():
    """Decay exp(-h/T) and the share of a linear change that is reached, by quadrature of the convolution."""
    lag, step = 0.0123, 0.005
    times = np.linspace(0.0, step, 100_001)
    found = lag_weights(np.array(lag), step)
    mean = JONES_A1 / JONES_B1 + JONES_A2 / JONES_B2
    for i, b in enumerate((JONES_B1, JONES_B2)):
        T = lag / (mean * b)
        assert found[2 * i] == pytest.approx(np.exp(-step / T), rel=1e-12)
        ramp = np.trapezoid(np.exp(-(step - times) / T) / T * times / step, times)
        assert found[2 * i + 1] == pytest.approx(ramp, rel=1e-7)
    np.testing.assert_allclose(lag_weights(np.array(0.0), step), [0.0, 1.0, 0.0, 1.0], atol=1e-6)


def test_accelerations_are_continuous_in_the_division():
    """A joint that moves across the edge of a strip moves the accelerations continuously.

    Differences over ever smaller changes of the division shrink in proportion: no jump at the edge (2
    links, 10 strips: the edge at half the span).
    """
    rng = np.random.default_rng(4)
    model = chain_model(example_aircraft(), example_flight(), 2)
    batch, state = random_batch(rng, model, 1), random_state(rng, model, 1, speed=150.0)
    plan = instant(model, random_hinges(rng, model))

    def rates(fraction):
        there = batch.changed(division=np.array([[[fraction, 1.0 - fraction]]]))
        found = state_rates(model, plan, 0, lane_constants(model, there, STEP_S), state)
        return found[0, 4 : 13 + 2 * model.coordinates]

    jumps = [np.abs(rates(0.5 + d) - rates(0.5 - d)).max() / d for d in (1e-3, 1e-5, 1e-7)]
    assert jumps[0] == pytest.approx(jumps[2], rel=0.1)
    assert jumps[1] == pytest.approx(jumps[2], rel=0.01)


def test_a_stiff_chain_is_the_rigid_wing():
    """A chain that is stiff enough is the rigid wing: base accelerations are the rigid model's.

    Without profile drag, which is quadratic in the velocity at one point of each link and so does depend on
    the number of links.
    """
    flight = example_flight()
    rigid = chain_model(example_aircraft(), flight, 1)
    chain = chain_model(example_aircraft(), flight, 4)
    rng = np.random.default_rng(2)
    hinges = random_hinges(rng, rigid)
    start = random_state(rng, rigid, 1, speed=150.0)
    found = []
    for model in (rigid, chain):
        guess = physical_guess(model)
        batch = guess.changed(
            lag_s=np.zeros(1),
            profile_drag=np.zeros((1, 1)),
            stiffness_nm_rad=1e9 * guess["stiffness_nm_rad"],
            damping_nms_rad=0.0 * guess["damping_nms_rad"],
        )
        n = model.coordinates
        state = np.concatenate([start[:, :13], np.zeros((1, 2 * n + 9 * model.links))], axis=1)
        plan = instant(model, hinges)
        # joints where their springs hold them: next to no angle, but the reaction that a rigid wing has
        for _ in range(30):
            rates = state_rates(model, plan, 0, lane_constants(model, batch, STEP_S), state)
            if not n:
                break
            joint = rates[:, 13 + n : 13 + 2 * n]
            state[:, 13 : 13 + n] += joint_relief(model, batch, plan, state, joint)
            if np.abs(joint).max() < 1e-7 * np.abs(rates[:, 4:10]).max():
                break
        found.append(rates[0, 4:10])
    np.testing.assert_allclose(found[1], found[0], rtol=0, atol=1e-6 * np.abs(found[0]).max())


def joint_relief(model, batch, plan, state, joint):
    """Newton's change of the joint angles that takes their accelerations away."""
    n = model.coordinates
    probe = 1e-9
    moved = np.repeat(state, n, axis=0)
    moved[:, 13 : 13 + n] += probe * np.eye(n)
    many = batch.select(np.zeros(n, dtype=np.int64))
    rates = state_rates(model, plan, 0, lane_constants(model, many, STEP_S), moved)
    jacobian = (rates[:, 13 + n : 13 + 2 * n] - joint).T / probe
    return np.linalg.solve(jacobian, -joint[0])[None]
