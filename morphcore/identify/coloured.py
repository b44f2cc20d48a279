"""Noise of fitted residuals that is correlated in time, and what it does to an estimate.

The residuals of a fit are noise less what the fit has taken from it. So their correlation is not read off
them but estimated by restricted maximum likelihood (Patterson & Thompson 1971; Harville 1977), which looks
only at what no change of the parameters can explain. The covariance of the estimate that least squares with a
prior P makes of it is the sandwich (Morelli & Klein 1995)

    (D'D + P)^-1 [sum_ij D_i' R(i - j) D_j + P S P] (D'D + P)^-1

with the Jacobian D, the noise's autocovariance R, and S of the prior's own error. R is a scale of each sample
and channel times one correlation in time, averaged by likelihood over a white one and exponentials. It is
looked at in averages over a thirtieth of a record, so that it hardly depends on how densely rows lie.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, solve_triangular

Array = NDArray[np.float64]

CHANNELS = 3  # phi, theta, psi of each row
HEADING = 2  # the channel whose first row is taken for the heading to begin with, noise and all
CORRELATION_TIMES = 8  # that are tried, from a bin to the whole record
WHITE_SHARES = (0.0, 0.03, 0.3)  # of the variance that is independent from row to row
MIN_FLIGHTS = 3  # of a jackknife
BINS = 30  # of a record, whose averages show the noise that matters; the rest averages out in a fit
LONG_SHARE = 0.6  # of a record: a longer correlation is less likely beforehand
ROUNDS = 6  # of the scales of the noise: each gains a digit
NEGLIGIBLE_WEIGHT = 1e-3  # of a shape of the noise among all
SMALLEST_RAD = 1e-13  # below, a residual is rounding
# errors that chains make on flights they were not fitted to, over the rms of what bending does to the
# attitude: two links on the example flights, 2e-4 of 1.15e-2 rad
DISCREPANCY = 0.0175
SHOWN = 8.0  # mean squares of residuals that take the place of a squared discrepancy
PRIOR_SPREAD = 1.0  # standard deviation of the physical guess in search coordinates: a factor e


@dataclass(frozen=True)
class Record:
    """Residuals of one sample around the best fit: what was flown against it.

    Attributes
    ----------
    time_s : ndarray, shape (k,)
        Times of its rows.
    residual : ndarray, shape (k, 3)
        Weighted errors of phi, theta, psi, rad.
    jacobian : ndarray, shape (k, 3, d)
        Their derivatives by the search coordinates.
    motion_rad : float
        Root mean square of what the model adds to a rigid one, that is of the rigid model's errors.
    """

    time_s: Array
    residual: Array
    jacobian: Array
    motion_rad: float = 0.0

    @property
    def discrepancy_rad(self) -> float:
        """Standard deviation of what a chain misses on other flights and has fitted away on this one.

        A share of the motion; less where the residuals are large and so show themselves what they are.
        """
        floor = DISCREPANCY * self.motion_rad
        shown = SHOWN * float(np.mean(self.residual**2))
        return float(np.sqrt(max(floor**2 - shown, 0.0)))


def records(
    times_s: Sequence[Array], residual: Array, jacobian: Array, motions_rad: Sequence[float] | None = None
) -> tuple[Record, ...]:
    """Cut residuals (m,) and Jacobian (m, d) of a whole fit into those of its samples."""
    motions = [0.0] * len(times_s) if motions_rad is None else motions_rad
    ends = np.cumsum([CHANNELS * time_s.size for time_s in times_s])
    return tuple(
        Record(time_s, own.reshape(-1, CHANNELS), slope.reshape(time_s.size, CHANNELS, -1), motion)
        for time_s, own, slope, motion in zip(
            times_s, np.split(residual, ends[:-1]), np.split(jacobian, ends[:-1]), motions, strict=True
        )
    )


@dataclass(frozen=True)
class _Block:
    """One channel of one sample, averaged over bins b of a few rows: faster noise has no weight in a fit.

    Attributes
    ----------
    time_s : ndarray, shape (b,)
        Middles of the bins.
    residual, jacobian : ndarray, shape (b,) and (b, d)
        Averages.
    nuisance : ndarray, shape (b, 1) or (b, 0)
        What the data leave open beside the parameters: the heading.
    gain : ndarray, shape (b, d)
        How the noise in each bin enters the estimate's right-hand side.
    fast : ndarray, shape (d, d)
        What the first row's own noise, faster than its bin, adds through the heading; rad^2.
    """

    time_s: Array
    residual: Array
    jacobian: Array
    nuisance: Array
    gain: Array
    fast: Array


def _block(time_s: Array, residual: Array, jacobian: Array, *, heading: bool) -> _Block:
    bins = np.floor((time_s - time_s[0]) / np.ptp(time_s) * BINS * (1.0 - 1e-12))
    first = np.flatnonzero(np.diff(bins, prepend=-1.0))  # of each bin that has rows
    counts = np.diff(first, append=time_s.size).astype(np.float64)
    gain = np.add.reduceat(jacobian, first, axis=0)
    middle = np.add.reduceat(residual, first) / counts
    fast = np.zeros((jacobian.shape[1], jacobian.shape[1]))
    if heading:
        total = jacobian.sum(axis=0)
        scatter = residual - np.repeat(middle, counts.astype(np.int64))
        fast = np.outer(total, total) * (scatter @ scatter) / time_s.size
        gain = gain.copy()
        gain[0] -= total
    return _Block(
        np.add.reduceat(time_s, first) / counts,
        middle,
        np.add.reduceat(jacobian, first, axis=0) / counts[:, None],
        np.ones((first.size, int(heading))),
        gain,
        fast,
    )


@dataclass(frozen=True)
class _Shape:
    """Correlation of the noise in time: exp(-|t| / correlation_s), but for a white share."""

    correlation_s: float
    white: float

    def correlation(self, time_s: Array) -> Array:
        """Correlation (k, k) of bins at these times."""
        if not self.correlation_s:
            return np.eye(time_s.size)
        apart = np.abs(time_s[:, None] - time_s) / self.correlation_s
        return (1.0 - self.white) * np.exp(-apart) + self.white * np.eye(time_s.size)


@dataclass(frozen=True)
class ColouredNoise:
    """Covariance of an estimate whose residuals are correlated in time.

    Attributes
    ----------
    records : tuple of Record
    prior : float
        Weight of the prior, rad^2 a squared unit: P = prior * 1.
    """

    records: tuple[Record, ...]
    prior: float

    @cached_property
    def information(self) -> Array:
        """(d, d) D'D + P."""
        total = sum(np.einsum("kcd,kce->de", r.jacobian, r.jacobian) for r in self.records)
        return np.asarray(total + self.prior * np.eye(self.records[0].jacobian.shape[-1]))

    @cached_property
    def middle(self) -> Array:
        """(d, d) sum_ij D_i' R(i - j) D_j, averaged over what the noise may be like by its likelihood."""
        if not any(self.blocks):
            return np.zeros_like(self.information)
        shapes = self._shapes()
        found = [self._restricted_likelihood(shape) for shape in shapes]
        longest = max(float(np.ptp(record.time_s)) for record in self.records)
        # a record tells little about noise that is correlated over most of it: it is then an offset
        rare = np.array([1.0 + (shape.correlation_s / (LONG_SHARE * longest)) ** 2 for shape in shapes])
        weight = np.exp(np.array([each for each, _ in found]) - max(each for each, _ in found)) / rare
        weight /= weight.sum()
        return np.asarray(
            sum(
                w * self._spread(shape, scales)
                for w, shape, (_, scales) in zip(weight, shapes, found, strict=True)
                if w > NEGLIGIBLE_WEIGHT
            )
        )

    @cached_property
    def covariance(self) -> Array:
        """(d, d) of the estimate in search coordinates: the sandwich, or between flights if larger."""
        bread = np.linalg.inv(self.information)
        total = self.middle + self.prior**2 * PRIOR_SPREAD**2 * np.eye(bread.shape[0])
        within = np.asarray(bread @ total @ bread)
        between = self.between_flights
        if between is None:
            return within
        ratio = np.sqrt(np.maximum(np.diag(between) / np.maximum(np.diag(within), 1e-300), 1.0))
        return np.asarray(within * np.outer(ratio, ratio))

    @property
    def freedom(self) -> int:
        """Degrees of freedom of the intervals: averages that depend on the parameters, less their number."""
        reported = [
            block.time_s.size
            for own in self.blocks
            for block in own
            if np.abs(block.jacobian).max() > SMALLEST_RAD
        ]
        return max(int(sum(reported)) - int(self.information.shape[0]), 1)

    @cached_property
    def between_flights(self) -> Array | None:
        """(d, d) by the jackknife over flights, each left out in one Gauss-Newton step; None below three.

        At the optimum of all flights, those without flight s have theirs at H_(-s)^-1 D_s' r_s from it.
        """
        count = len(self.records)
        if count < MIN_FLIGHTS:
            return None
        moves = []
        for record in self.records:
            own = np.einsum("kcd,kce->de", record.jacobian, record.jacobian)
            pull = np.einsum("kcd,kc->d", record.jacobian, record.residual)
            moves.append(np.linalg.solve(self.information - own, pull))
        apart = np.array(moves) - np.mean(moves, axis=0)
        return np.asarray((count - 1.0) / count * apart.T @ apart)

    @cached_property
    def blocks(self) -> tuple[tuple[_Block, ...], ...]:
        """The channels of each sample in which anything happens."""
        return tuple(
            tuple(
                _block(
                    record.time_s,
                    record.residual[:, channel],
                    record.jacobian[:, channel],
                    heading=channel == HEADING,
                )
                for channel in range(CHANNELS)
                if np.abs(record.residual[:, channel]).max() > SMALLEST_RAD
                or np.abs(record.jacobian[:, channel]).max() > SMALLEST_RAD
            )
            for record in self.records
        )

    def _shapes(self) -> list[_Shape]:
        lengths = [float(np.ptp(record.time_s)) for record in self.records]
        times = np.geomspace(min(lengths) / BINS, max(lengths), CORRELATION_TIMES)
        return [_Shape(0.0, 1.0), *(_Shape(time, white) for time in times for white in WHITE_SHARES)]

    def _restricted_likelihood(self, shape: _Shape) -> tuple[float, Array]:
        """Logarithm of the restricted likelihood of a shape, and the scales (blocks,) of the noise, rad."""
        whitened, determinant = [], 0.0
        blocks = [block for own in self.blocks for block in own]
        for own in self.blocks:
            root = cholesky(shape.correlation(own[0].time_s), lower=True) if own else np.eye(1)
            for block in own:
                both = np.concatenate([block.residual[:, None], block.jacobian, block.nuisance], axis=1)
                whitened.append(solve_triangular(root, both, lower=True))
                determinant += 2.0 * float(np.log(np.diag(root)).sum())
        width = self.information.shape[0]
        open_count = sum(block.nuisance.shape[1] for block in blocks)
        designs, column = [], width
        for block, rows in zip(blocks, whitened, strict=True):
            design = np.zeros((rows.shape[0], width + open_count))
            design[:, :width] = rows[:, 1 : 1 + width]
            if block.nuisance.shape[1]:
                design[:, column] = rows[:, -1]
                column += 1
            designs.append(design)
        grams = np.stack([design.T @ design for design in designs])
        crosses = np.stack([design.T @ rows[:, 0] for design, rows in zip(designs, whitened, strict=True)])
        squares = np.array([rows[:, 0] @ rows[:, 0] for rows in whitened])
        sizes = np.array([rows.shape[0] for rows in whitened], dtype=np.float64)
        scales = np.maximum(squares / sizes, SMALLEST_RAD**2)
        held = np.zeros(width + open_count)
        held[:width] = self.prior
        normal, left = np.eye(held.size), squares
        for _ in range(ROUNDS):
            typical = float(np.exp(np.mean(np.log(scales))))
            normal = np.einsum("b,bij->ij", 1.0 / scales, grams) + np.diag(held / typical + 1e-300)
            inverse = np.linalg.pinv(normal, hermitian=True)
            change = -inverse @ np.einsum("b,bi->i", 1.0 / scales, crosses)
            left = squares + 2.0 * crosses @ change + np.einsum("i,bij,j->b", change, grams, change)
            freedom = sizes - np.einsum("ij,bji->b", inverse, grams) / scales
            scales = np.maximum(left / np.maximum(freedom, 1.0), SMALLEST_RAD**2)
        sign, logdet = np.linalg.slogdet(normal)
        likelihood = -0.5 * (
            sizes @ np.log(scales) + determinant + (logdet if sign > 0 else 0.0) + np.sum(left / scales)
        )
        return float(likelihood), np.sqrt(scales)

    def _spread(self, shape: _Shape, scales: Array) -> Array:
        """(d, d) sum_ij D_i' R(i - j) D_j of one shape of the noise."""
        total, left = np.zeros_like(self.information), iter(scales)
        few = len(self.records) < MIN_FLIGHTS  # too few to differ
        for record, own in zip(self.records, self.blocks, strict=True):
            correlation = shape.correlation(own[0].time_s) if own else np.eye(1)
            minimum = record.discrepancy_rad if few else 0.0
            for block in own:
                variance = max(next(left), minimum) ** 2
                total += variance * block.gain.T @ correlation @ block.gain + block.fast
        return total
