"""Biases, heading, delay and start, removed from residuals in closed form for every parameter set.

Golub & Pereyra (1973), variable projection: for given parameters the best values of what enters linearly are
those of a small least-squares problem, and what is left is a residual of the parameters alone, whose finite
differences are its exact Jacobian. The delay enters through the flight's own rates: a few Gauss-Newton steps,
the readings interpolated anew after each, and no flight more. A robust loss reweights the rows in the same
rounds (Holland & Welsch 1977).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from morphcore.frames import wrap_angle
from morphcore.identify.measurement import DELAY_SPREAD_S, Measured
from morphcore.identify.readings import Readings

Array = NDArray[np.float64]

DELAY_ROUNDS = 4
ROBUST_ROUNDS = 12
MAX_DELAY_S = 0.3
HUBER = 1.345  # standard deviations: 95 per cent as efficient as squares under normal noise (Huber 1981)
PRIOR_RAD = 3e-5  # what a delay or a start of one standard deviation costs
TINY = 1e-12  # relative: an offset of a channel without any row is 0


@dataclass(frozen=True)
class Reduced:
    """Errors after the nuisances are removed, of parameter sets p, rows k and channels c.

    Attributes
    ----------
    error : ndarray, shape (p, k, c)
        Reading of the flight less measured one, in the channels' units; NaN where the flight diverged.
    nuisance : ndarray, shape (p, n)
        Offsets of the channels that have one, the start's n, errors of first angles, then the delay, s. Of
        readings: a bias adds to the truth.
    slope : ndarray, shape (p, k, c)
        Derivative of the error by the delay; empty where that is not free.
    """

    error: Array
    nuisance: Array
    slope: Array


def reduced(setup: Measured, time_s: Array, flown: Array | Readings) -> Reduced:
    """Remove a sample's nuisances from flights at its times (k,).

    Parameters
    ----------
    setup : Measured
    time_s : ndarray, shape (k,)
    flown : ndarray, shape (p, k, c), or Readings
        The flights' readings at those times, or at all times.
    """
    particles = flown.values.shape[0] if isinstance(flown, Readings) else flown.shape[0]
    columns, prior = linear_columns(setup)
    linear = columns.shape[2]
    free_delay = setup.openness.delay
    delay, nuisance = np.zeros(particles), np.zeros((particles, linear))
    trust: Array | None = None
    rounds = DELAY_ROUNDS if free_delay else 1
    rounds = rounds if setup.loss == "linear" else ROBUST_ROUNDS
    error, slope = _errors(setup, time_s, flown, delay)
    if setup.loss != "linear":
        trust = _trust(setup, error - _medians(setup, error))
    for _ in range(rounds):
        found, change = _solved(setup, error, slope, columns, prior, trust, delay)
        nuisance = found
        if free_delay:
            delay = np.clip(delay + change, -MAX_DELAY_S, MAX_DELAY_S)
            error, slope = _errors(setup, time_s, flown, delay)
        if trust is not None:
            trust = _trust(setup, error + _linear_part(columns, nuisance))
    nuisance, _ = _solved(setup, error, slope[..., :0], columns, prior, trust, delay)
    left = error + _linear_part(columns, nuisance)
    if free_delay:
        nuisance = np.concatenate([nuisance, delay[:, None]], axis=1)
    return Reduced(left, nuisance, slope)


def linear_columns(setup: Measured) -> tuple[Array, Array]:
    """Columns (k, c, n) of offsets, start and first angles; weights (n,) of their priors, 0 of offsets."""
    rows, count = setup.values.shape
    offsets = np.zeros((rows, count, int(setup.offset.sum())))
    for number, channel in enumerate(np.flatnonzero(setup.offset)):
        offsets[:, channel, number] = 1.0
    columns = [offsets, *(c for c in (setup.start_columns, setup.angle_columns) if c.shape[2])]
    weights = np.concatenate(
        [
            np.zeros(offsets.shape[2]),
            (PRIOR_RAD / setup.start_spread) ** 2,
            (setup.angle_unit_rad / setup.angle_spread) ** 2,
        ]
    )
    return np.concatenate(columns, axis=2), weights


def pseudo_residual(setup: Measured, error: Array) -> Array:
    """Weighted residuals (..., c) whose half squares are the loss of errors, rad."""
    weighted = error * setup.weight
    scale = setup.openness.scale_rad
    if setup.loss == "linear" or scale == 0.0:
        return weighted
    u = np.abs(weighted) / scale
    if setup.loss == "huber":
        square = np.where(u <= HUBER, u**2, 2.0 * HUBER * u - HUBER**2)
    else:
        square = 2.0 * (np.sqrt(1.0 + u**2) - 1.0)
    return np.sign(weighted) * scale * np.sqrt(square)


def _trust(setup: Measured, error: Array) -> Array:
    """Weights (p, k, c) of rows under a robust loss: 1 for small errors."""
    scale = setup.openness.scale_rad
    if scale == 0.0:
        return np.ones_like(error)
    u = np.abs(error * setup.weight) / scale
    if setup.loss == "huber":
        return np.asarray(np.where(u <= HUBER, 1.0, HUBER / np.maximum(u, HUBER)))
    return np.asarray(1.0 / np.sqrt(1.0 + u**2))


def _medians(setup: Measured, error: Array) -> Array:
    """Medians (p, 1, c) over the rows of the channels that have an offset; 0 of the others."""
    finite = np.where(np.isfinite(error), error, 0.0)
    return np.where(setup.offset, np.median(finite, axis=1, keepdims=True), 0.0)


def _errors(setup: Measured, time_s: Array, flown: Array | Readings, delay: Array) -> tuple[Array, Array]:
    """Errors (p, k, c) of the flights' readings, late by (p,) s, and their derivatives by it."""
    if isinstance(flown, Readings):
        values, rate = flown.at(time_s - delay[:, None])
        slope: Array = -rate if setup.openness.delay else rate[..., :0]
    else:
        values, slope = flown, flown[..., :0]
    error = values - setup.values
    angle = setup.angle
    error[..., angle] = wrap_angle(error[..., angle])
    return error, slope


def _linear_part(columns: Array, nuisance: Array) -> Array:
    """What linear nuisances (p, n) add to errors, (p, k, c)."""
    total = np.zeros((nuisance.shape[0], *columns.shape[:2]))
    for number in range(columns.shape[2]):
        total += nuisance[:, number, None, None] * columns[..., number]
    return total


def _solved(
    setup: Measured,
    error: Array,
    slope: Array,
    columns: Array,
    prior: Array,
    trust: Array | None,
    delay: Array,
) -> tuple[Array, Array]:
    """The linear nuisances (p, n) and the change of the delay (p,) that make errors smallest.

    All sums run over each parameter set alone, so that they are the same to the bit in any company.
    """
    particles, count = error.shape[0], columns.shape[2]
    known = np.isfinite(error)
    weight = np.where(known, setup.weight**2, 0.0)
    weight = weight if trust is None else weight * np.where(known, trust, 0.0)
    error = np.where(known, error, 0.0)
    designs = [columns[None, ..., n] for n in range(count)]
    if slope.shape[2]:
        designs.append(np.where(known, slope, 0.0))
    size = len(designs)
    gram, right = np.zeros((particles, size, size)), np.zeros((particles, size))
    for i, first in enumerate(designs):
        scaled = weight * first
        right[:, i] = -np.sum(scaled * error, axis=(1, 2))
        for j in range(i + 1):
            gram[:, i, j] = gram[:, j, i] = np.sum(scaled * designs[j], axis=(1, 2))
    held = np.zeros(size)
    held[:count] = prior
    if size > count:
        held[count] = (PRIOR_RAD / DELAY_SPREAD_S) ** 2
        right[:, count] -= held[count] * delay
    diagonal = np.einsum("pii->pi", gram)
    diagonal += held + TINY * error.shape[1] * np.max(setup.weight) ** 2
    found = np.linalg.solve(gram, right[..., None])[..., 0]
    change = np.asarray(found[:, count] if size > count else np.zeros(particles))
    return np.asarray(found[:, :count]), change
