"""Effective sample size and convergence of Markov chains (Vehtari et al. 2021)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MIN_STEPS = 4  # of a chain that can be split and compared


def split(draws: Array) -> Array:
    """Halves (n/2, 2 c, ...) of chains (n, c, ...): a chain that drifts differs from itself."""
    half = draws.shape[0] // 2
    return np.concatenate([draws[:half], draws[-half:]], axis=1)


def r_hat(draws: Array) -> Array:
    """(d,) split R-hat of chains (n, c, d): one where all chains agree, infinite where they do not move."""
    if draws.shape[0] < MIN_STEPS:
        return np.full(draws.shape[2], np.inf)
    halves = split(draws)
    count = halves.shape[0]
    within = halves.var(axis=0, ddof=1).mean(axis=0)
    between = count * halves.mean(axis=0).var(axis=0, ddof=1)
    spread = (count - 1.0) / count * within + between / count
    return np.asarray(np.sqrt(np.where(within > 0.0, spread / np.maximum(within, 1e-300), np.inf)))


def effective_samples(draws: Array) -> Array:
    """(d,) effective sample size of chains (n, c, d) out of the autocorrelation within and between them."""
    if draws.shape[0] < MIN_STEPS:
        return np.zeros(draws.shape[2])
    halves = split(draws)
    count, chains = halves.shape[:2]
    centred = halves - halves.mean(axis=0)
    spectrum = np.abs(np.fft.rfft(centred, 2 * count, axis=0)) ** 2
    covariance = np.fft.irfft(spectrum, axis=0)[:count].mean(axis=1) / count  # (lag, d), over chains
    within = covariance[0] * count / (count - 1.0)
    spread = covariance[0] + halves.mean(axis=0).var(axis=0, ddof=1)
    correlation = 1.0 - (within - covariance) / np.maximum(spread, 1e-300)
    correlation[0] = 1.0
    pairs = correlation[: count // 2 * 2].reshape(-1, 2, draws.shape[2]).sum(axis=1)
    # the initial monotone sequence of Geyer (1992): sums of neighbours stay positive and fall
    positive = np.cumprod(pairs > 0.0, axis=0)
    time = 2.0 * (np.minimum.accumulate(pairs, axis=0) * positive).sum(axis=0) - 1.0
    total = float(count * chains)
    return np.asarray(np.minimum(total / np.maximum(time, 1.0 / np.log10(total)), total * np.log10(total)))
