"""Flights in batches: company, chunks and threads change nothing; mirrored flights; the samples."""

from __future__ import annotations

import numpy as np
import pytest

from morphcore.frames import wrap_angle
from morphcore.lanes import TOGETHER
from morphcore.models.equivalent import lane_constants, physical_guess
from morphcore.simulate.batch import BLOCKS_PER_GROUP, LONGEST_CHUNK, fly_batch
from morphcore.simulate.plan import flight_plan
from morphcore.simulate.schedule import ConstantRate, Hold, Tabulated
from morphcore.simulate.time_grid import STEP_S, time_grid
from morphcore.stopping import Interrupted
from morphcore.threads import thread_count, use_threads
from tests.models.chains import random_batch
from tests.simulate.flights import (
    SAMPLES,
    example_model,
    fly_free,
    fly_trimmed,
    plan_of,
    sample,
    sample_plan,
)

UNLIKE = (ConstantRate(0.0, 0.6, 0.3, ramp_s=0.1), ConstantRate(0.1, 0.4, 0.4, ramp_s=0.1))


@pytest.fixture(scope="module")
def flown():
    """Many random parameter sets, flown together for most of a second."""
    model = example_model(3)
    batch = random_batch(np.random.default_rng(0), model, 2 * TOGETHER * BLOCKS_PER_GROUP + 3)
    plan = plan_of(model, UNLIKE, 0.8, STEP_S)  # more steps than a chunk
    return model, batch, plan, fly_trimmed(model, plan, batch)


def again(flown, index):
    """Some of the parameter sets, flown once more from the same start."""
    model, batch, plan, together = flown
    trim = together.trim
    return fly_free(
        model,
        plan,
        batch.select(index),
        together.states[0, index],
        force_B=trim.force_B[index],
        moment_B=trim.moment_B[index],
    ).states


def test_company_does_not_matter(flown):
    """A flight is bit-identical alone, in another order, and together with others."""
    states = flown[3].states
    particles = states.shape[1]
    order = np.random.default_rng(1).permutation(particles)
    np.testing.assert_array_equal(again(flown, order), states[:, order])
    for alone in (0, TOGETHER + 1, particles - 1):
        np.testing.assert_array_equal(again(flown, np.array([alone]))[:, 0], states[:, alone])


def test_threads_do_not_matter(flown):
    """One thread and all of them give the same bits."""
    threads = thread_count()
    try:
        use_threads(1)
        np.testing.assert_array_equal(again(flown, np.arange(flown[1].particles)), flown[3].states)
    finally:
        use_threads(threads)


def test_chunks_are_short_and_stop_is_requested(flown):
    """Flights come in chunks whose rows follow on each other; a stop between two of them ends it."""
    model, batch, plan, together = flown
    constants = lane_constants(model, batch, STEP_S)
    chunks = list(fly_batch(model, plan, constants, together.states[0]))
    firsts = [chunk.first for chunk in chunks]
    lengths = [chunk.rows.shape[0] for chunk in chunks]
    assert firsts == [0, *np.cumsum(lengths)[:-1]]
    assert sum(lengths) == plan.grid.steps + 1
    assert max(lengths) <= LONGEST_CHUNK
    requested = []

    def stop():
        requested.append(None)
        return len(requested) > 1

    flying = fly_batch(model, plan, constants, together.states[0], stop=stop)
    with pytest.raises(Interrupted):
        list(flying)
    assert len(requested) == 2


def mirrored(states, model):
    """States (k, rows) seen in a mirror: wings change places; roll, yaw and what is lateral change sign."""
    n, links = model.coordinates, model.links
    out = states.copy()
    # quaternion x and z, p and r, v, east
    out[:, [1, 3, 4, 6, 8, 11]] *= -1
    joint = np.tile([-1.0, 1.0, -1.0], n // 3)
    for start in (13, 13 + n):
        half = n // 2
        both = joint * states[:, start : start + n]
        out[:, start : start + n] = np.concatenate([both[:, half:], both[:, :half]], axis=1)
    motion = np.tile([1.0, -1.0, 1.0], links)  # v_z, omega_x, omega_y of the links
    for start in range(13 + 2 * n, states.shape[1], 3 * links):
        half = 3 * links // 2
        both = motion * states[:, start : start + 3 * links]
        out[:, start : start + 3 * links] = np.concatenate([both[:, half:], both[:, :half]], axis=1)
    return out


@pytest.mark.parametrize("links", [1, 3])
def test_mirrored_flight_gives_mirrored_roll_and_yaw(links):
    """Exchanging the wings' sweeps mirrors the flight to round-off."""
    model = example_model(links)
    one = fly_trimmed(model, plan_of(model, UNLIKE, 0.5, STEP_S)).states[:, 0]
    other = fly_trimmed(model, plan_of(model, UNLIKE[::-1], 0.5, STEP_S)).states[:, 0]
    scale = np.abs(one).max(axis=0) + 1e-3
    np.testing.assert_allclose(mirrored(other, model) / scale, one / scale, rtol=0, atol=1e-9)
    assert np.abs(one[-1, [1, 3]]).min() > 1e-3  # it does roll and yaw


def test_symmetric_flight_stays_symmetric():
    """Equal sweeps neither roll nor yaw: round-off only, after five seconds."""
    model = example_model(3)
    name = "train_rate_0.2"
    states = fly_trimmed(model, sample_plan(model, name, STEP_S)).states[:, 0]
    assert np.abs(states[:, [1, 3, 4, 6, 8, 11]]).max() < 1e-8
    np.testing.assert_allclose(mirrored(states, model), states, atol=1e-7)


@pytest.mark.parametrize("links", [1, 3])
@pytest.mark.parametrize("left_share", [1.0, 0.5])
def test_sweep_to_the_far_end(links, left_share):
    """A sweep to 1.2 rad within 1.5 s flies on without a blow-up: smooth attitude, bounded joints."""
    model = example_model(links)
    schedules = [ConstantRate(0.0, share * 1.2, 1.5, start_s=0.1) for share in (1.0, left_share)]
    flown = fly_trimmed(model, plan_of(model, schedules, 2.0, STEP_S))
    assert np.isfinite(flown.states).all()
    # no kick: the rates change by less than 10 rad/s^2
    assert np.abs(np.diff(flown.states[:, 0, 4:7], axis=0)).max() < 10.0 * STEP_S
    n = model.coordinates
    assert np.abs(flown.states[:, 0, 13 : 13 + n]).max(initial=0.0) < 0.2
    assert np.abs(flown.euler).max() < 2.5


RIGID_J = {"train_rate_0.2": 0.22, "train_rate_0.5": 0.11, "train_rate_0.8": 0.066}


@pytest.mark.parametrize("name", RIGID_J)
def test_rigid_model_of_the_samples(name):
    """The rigid model, trimmed by itself, misses the samples by what an independent rigid lattice model does.

    J = sum of squared differences in attitude; within a factor 2 of 0.22, 0.11, 0.066.
    """
    model = example_model(1)
    plan = sample_plan(model, name, STEP_S)
    euler = fly_trimmed(model, plan).euler[plan.grid.at, 0]
    J = float(np.sum(wrap_angle(euler - sample(name).euler) ** 2))
    print(f"{name}: J of the rigid model {J:.3g}, expected about {RIGID_J[name]}")
    assert RIGID_J[name] / 2 < J < 2 * RIGID_J[name]


@pytest.mark.parametrize("name", SAMPLES)
def test_chains_come_close_to_the_samples(name):
    """Nothing fitted, chains of 2, 4 and 8 links miss the samples by less than half the pitch of one link.

    Two links have the compliance of the whole span already: what remains is common to all.
    """
    missed = []
    for links in (1, 2, 4, 8):
        model = example_model(links)
        plan = sample_plan(model, name, STEP_S)
        euler = fly_trimmed(model, plan).euler[plan.grid.at, 0]
        missed.append(float(np.sqrt(np.mean((euler - sample(name).euler)[:, 1] ** 2))))
    print(f"{name}: pitch rms {missed} rad for 1, 2, 4, 8 links")
    assert max(missed[1:]) < 0.5 * missed[0]
    np.testing.assert_allclose(missed[1:], missed[-1], rtol=0.25)


def test_uneven_samples_fly_as_even_ones():
    """A sample with rows left out has a grid of its own and flies within 3e-5 rad of the whole one."""
    model, whole = example_model(2), sample("train_asymmetric")
    keep = np.sort(np.random.default_rng(0).permutation(whole.time_s.size)[: 9 * whole.time_s.size // 10])
    keep = np.union1d(keep, [0, whole.time_s.size - 1])
    schedules = [Tabulated(whole.time_s, angle) for angle in (whole.sweep_right, whole.sweep_left)]
    plan = flight_plan(model, schedules, time_grid(whole.time_s[keep]))
    assert plan.grid.at is None
    uneven, even = (
        fly_trimmed(model, plan).euler[:, 0],
        fly_trimmed(model, sample_plan(model, whole.name, STEP_S)),
    )
    at = whole.time_s[keep]
    grid = time_grid(whole.time_s)
    for angle in range(3):
        a = np.interp(at, plan.grid.times_s, uneven[:, angle])
        b = np.interp(at, grid.times_s, even.euler[:, 0, angle])
        np.testing.assert_allclose(a, b, atol=3e-5)


def test_sweep_motion_is_needed():
    """Held wings fly on where sweeping ones pitch: the samples' attitude is the morph's doing."""
    model = example_model(1)
    held = fly_trimmed(model, plan_of(model, [Hold(), Hold()], 0.5, STEP_S), physical_guess(model)).euler
    assert np.ptp(held) < 0.08
    np.testing.assert_allclose(held[:, 0], held[:1, 0].repeat(held.shape[0], axis=0), atol=1e-9)
