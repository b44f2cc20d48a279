"""Autocovariance of the noise in fitted residuals, by restricted maximum likelihood.

The residuals of a fit are noise less what the fit has taken from it. So their correlation is not read off
them but estimated by restricted maximum likelihood (Patterson & Thompson 1971; Harville 1977), which looks
only at what no change of the parameters and nuisances can explain. The noise of every sample and channel has
a scale of its own; its correlation in time is one for all, averaged by likelihood over a white one and
exponentials. It is looked at in averages over a thirtieth of a record, so that it hardly depends on how
densely rows lie.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, solve_triangular

Array = NDArray[np.float64]

CORRELATION_TIMES = 8  # candidates, from a bin to the whole record
WHITE_SHARES = (0.0, 0.03, 0.3)  # of the variance that is independent from row to row
BINS = 30  # of a record, whose averages show the noise that matters; the rest averages out in a fit
LONG_SHARE = 0.6  # of a record: a longer correlation is less likely beforehand
ROUNDS = 6  # of the scales of the noise: each gains a digit
NEGLIGIBLE_WEIGHT = 1e-3  # of a shape of the noise among all
SMALLEST_RAD = 1e-13  # below, a residual is rounding


@dataclass(frozen=True)
class Block:
    """One channel of one sample, averaged over bins b of a few rows: faster noise has no weight in a fit.

    Attributes
    ----------
    time_s : ndarray, shape (b,)
        Middles of the bins.
    residual : ndarray, shape (b,)
        Averages of the residual.
    design : ndarray, shape (b, w)
        Averages of the derivatives by the unknowns of the fit.
    gain : ndarray, shape (b, w)
        How the noise in each bin enters the estimate's right-hand side.
    unknowns : ndarray of int, shape (w,)
        Places of the columns among all unknowns of the fit.
    sample, channel : int
        Where it belongs.
    """

    time_s: Array
    residual: Array
    design: Array
    gain: Array
    unknowns: NDArray[np.int64]
    sample: int
    channel: int


def block(
    time_s: Array,
    residual: Array,
    design: Array,
    unknowns: NDArray[np.int64],
    *,
    sample: int,
    channel: int,
) -> Block:
    """Average one channel of one sample over its bins.

    Parameters
    ----------
    time_s : ndarray, shape (k,)
    residual : ndarray, shape (k,)
    design : ndarray, shape (k, w)
    unknowns : ndarray of int, shape (w,)
    sample, channel : int
    """
    bins = np.floor((time_s - time_s[0]) / max(np.ptp(time_s), 1e-300) * BINS * (1.0 - 1e-12))
    first = np.flatnonzero(np.diff(bins, prepend=-1.0))  # of each bin that has rows
    counts = np.diff(first, append=time_s.size).astype(np.float64)
    gain = np.add.reduceat(design, first, axis=0)
    return Block(
        time_s=np.add.reduceat(time_s, first) / counts,
        residual=np.add.reduceat(residual, first) / counts,
        design=gain / counts[:, None],
        gain=gain,
        unknowns=unknowns,
        sample=sample,
        channel=channel,
    )


@dataclass(frozen=True)
class NoiseShape:
    """Correlation of the noise in time: exp(-|t| / correlation_s), except for a white share."""

    correlation_s: float
    white: float

    def correlation(self, time_s: Array) -> Array:
        """Correlation (k, k) of bins at these times."""
        if not self.correlation_s:
            return np.eye(time_s.size)
        apart = np.abs(time_s[:, None] - time_s) / self.correlation_s
        return (1.0 - self.white) * np.exp(-apart) + self.white * np.eye(time_s.size)


@dataclass(frozen=True)
class NoiseModel:
    """A shape of the noise, its standard deviation (blocks,) in rad, and its weight among all shapes."""

    shape: NoiseShape
    scales_rad: Array
    weight: float


def noise_models(blocks: Sequence[Block], prior: Array, lengths_s: Sequence[float]) -> list[NoiseModel]:
    """Shapes of the noise with their scales, weighted by their restricted likelihood.

    Parameters
    ----------
    blocks : sequence of Block
        One at least.
    prior : ndarray, shape (w,)
        Weight of the prior of each unknown in the fit, rad^2 a squared unit.
    lengths_s : sequence of float
        Durations of the samples.
    """
    times = np.geomspace(min(lengths_s) / BINS, max(lengths_s), CORRELATION_TIMES)
    shapes = [NoiseShape(0.0, 1.0), *(NoiseShape(time, white) for time in times for white in WHITE_SHARES)]
    found = [_restricted_likelihood(blocks, prior, shape) for shape in shapes]
    # a record tells little about noise that is correlated over most of it: it is then an offset
    rare = np.array([1.0 + (shape.correlation_s / (LONG_SHARE * max(lengths_s))) ** 2 for shape in shapes])
    weight = np.exp(np.array([each for each, _ in found]) - max(each for each, _ in found)) / rare
    weight /= weight.sum()
    return [
        NoiseModel(shape, scales, float(share))
        for share, shape, (_, scales) in zip(weight, shapes, found, strict=True)
        if share > NEGLIGIBLE_WEIGHT
    ]


def _restricted_likelihood(blocks: Sequence[Block], prior: Array, shape: NoiseShape) -> tuple[float, Array]:
    """Logarithm of the restricted likelihood of a shape, and the scales (blocks,) of the noise, rad."""
    grams, crosses, squares, determinant = _whitened(blocks, shape)
    places = [each.unknowns for each in blocks]
    sizes = np.array([each.time_s.size for each in blocks], dtype=np.float64)
    scales = np.maximum(squares / sizes, SMALLEST_RAD**2)
    width = prior.size
    normal, left = np.eye(width), squares
    for _ in range(ROUNDS):
        typical = float(np.exp(np.mean(np.log(scales))))
        normal, right = np.diag(prior / typical + 1e-300), np.zeros(width)
        for at, gram, cross, scale in zip(places, grams, crosses, scales, strict=True):
            normal[np.ix_(at, at)] += gram / scale
            right[at] += cross / scale
        inverse = np.linalg.pinv(normal, hermitian=True)
        change = -inverse @ right
        left, freedom = squares.copy(), sizes.copy()
        for b, (at, gram, cross) in enumerate(zip(places, grams, crosses, strict=True)):
            own = change[at]
            left[b] += 2.0 * cross @ own + own @ gram @ own
            freedom[b] -= float(np.sum(inverse[np.ix_(at, at)] * gram)) / scales[b]
        scales = np.maximum(left / np.maximum(freedom, 1.0), SMALLEST_RAD**2)
    sign, logdet = np.linalg.slogdet(normal)
    likelihood = -0.5 * (
        sizes @ np.log(scales) + determinant + (logdet if sign > 0 else 0.0) + np.sum(left / scales)
    )
    return float(likelihood), np.sqrt(scales)


def _whitened(blocks: Sequence[Block], shape: NoiseShape) -> tuple[list[Array], list[Array], Array, float]:
    """Normal matrices and right-hand sides of whitened blocks, their squares, log determinant."""
    grams, crosses, squares = [], [], []
    determinant = 0.0
    roots: dict[int, Array] = {}  # channels of a sample have their rows in common
    for each in blocks:
        if each.sample not in roots or roots[each.sample].shape[0] != each.time_s.size:
            roots[each.sample] = cholesky(shape.correlation(each.time_s), lower=True)
        root = roots[each.sample]
        both = np.concatenate([each.residual[:, None], each.design], axis=1)
        rows = solve_triangular(root, both, lower=True)
        determinant += 2.0 * float(np.log(np.diag(root)).sum())
        grams.append(rows[:, 1:].T @ rows[:, 1:])
        crosses.append(rows[:, 1:].T @ rows[:, 0])
        squares.append(float(rows[:, 0] @ rows[:, 0]))
    return grams, crosses, np.array(squares), determinant
