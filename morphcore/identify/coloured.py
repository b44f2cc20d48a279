"""Covariance of an estimate whose residuals are correlated in time.

The covariance of what least squares with a prior P makes of noise with autocovariance R is the sandwich
(Morelli & Klein 1995)

    (D'D + P)^-1 [sum_ij D_i' R(i - j) D_j + P S P] (D'D + P)^-1

with the Jacobian D and S of the prior's own error. D has a column for each search coordinate and for each
nuisance that is fitted beside them (biases, delays, headings); R is estimated from the residuals
(`noise_model`). What a chain of few links misses shows in no residual of a flight that it was fitted to: the
noise of a flight has a floor for it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from morphcore.identify.noise_model import SMALLEST_RAD, Block, NoiseModel, block, noise_models

Array = NDArray[np.float64]

MIN_FLIGHTS = 3  # of a jackknife
# errors that chains make on flights they were not fitted to, over the rms of what bending does to the
# attitude: two links on the example flights, 2e-4 of 1.15e-2 rad. On seven other aircraft (span, stiffness,
# masses, speed varied by half) estimates from single flights then differ by 0.8 of
# their standard errors in the median and 2.2 in the 95th percentile
DISCREPANCY = 0.0175
SHOWN = 8.0  # mean squares of residuals that take the place of a squared discrepancy
PRIOR_SPREAD = 1.0  # standard deviation of the physical guess in search coordinates: a factor e


def _no_columns() -> Array:
    return np.zeros((0, 0, 0))


@dataclass(frozen=True)
class Record:
    """Residuals of one sample around the best fit, of c channels in k rows.

    Attributes
    ----------
    time_s : ndarray, shape (k,)
        Times of its rows.
    residual : ndarray, shape (k, c)
        Weighted errors, rad or what a channel's weight makes of its unit.
    jacobian : ndarray, shape (k, c, d)
        Their derivatives by the search coordinates: with the nuisances held, or, where ``nuisance_slope`` is
        given, with the nuisances fitted anew.
    motion_rad : float or ndarray, shape (c,)
        Root mean square of what the model adds to a rigid one, that is of the rigid model's errors.
    nuisance : ndarray, shape (k, c, n)
        Derivatives of the residual by the sample's own nuisances: biases, delay, heading, initial state.
    nuisance_prior : ndarray, shape (n,)
        Weight of the prior of each nuisance in the fit, squared residual a squared unit; none if left out.
    nuisance_spread : ndarray, shape (n,)
        Standard deviation of each prior; 0 where there is none, and if left out.
    nuisance_slope : ndarray, shape (n, d), optional
        Derivatives of the fitted nuisances by the search coordinates, where ``jacobian`` contains them.
    """

    time_s: Array
    residual: Array
    jacobian: Array
    motion_rad: float | Array = 0.0
    nuisance: Array = field(default_factory=_no_columns)
    nuisance_prior: Array = field(default_factory=lambda: np.zeros(0))
    nuisance_spread: Array = field(default_factory=lambda: np.zeros(0))
    nuisance_slope: Array | None = None

    @property
    def nuisance_count(self) -> int:
        """Number of nuisances n."""
        return int(self.nuisance.shape[2])

    @cached_property
    def design(self) -> Array:
        """(k, c, d + n) derivatives by search coordinates and nuisances, the others held."""
        if not self.nuisance_count:
            return self.jacobian
        held = self.jacobian
        if self.nuisance_slope is not None:
            held = held - self.nuisance @ self.nuisance_slope
        return np.concatenate([held, self.nuisance], axis=2)

    @cached_property
    def held(self) -> Array:
        """(n,) weights of the nuisances' prior."""
        return self.nuisance_prior if self.nuisance_prior.size else np.zeros(self.nuisance_count)

    @property
    def discrepancy_rad(self) -> Array:
        """(c,) standard deviation of what a chain misses on other flights and has fitted away on this one.

        A share of the motion; less where the residuals are large and so show themselves what they are.
        """
        floor = DISCREPANCY * np.broadcast_to(self.motion_rad, self.residual.shape[1:])
        shown = SHOWN * float(np.mean(self.residual**2))
        return np.asarray(np.sqrt(np.maximum(floor**2 - shown, 0.0)))


@dataclass(frozen=True)
class ColouredNoise:
    """Covariance of an estimate whose residuals are correlated in time.

    Unknowns are the d search coordinates and, after them, the nuisances of each sample: w in all.

    Attributes
    ----------
    records : tuple of Record
    prior : float or ndarray, shape (d,)
        Weight of the prior of each search coordinate, rad^2 a squared unit: the diagonal of P.
    spread : float
        Standard deviation of the physical guess in search coordinates.
    """

    records: tuple[Record, ...]
    prior: float | Array
    spread: float = PRIOR_SPREAD

    @property
    def dimension(self) -> int:
        """Number of search coordinates d."""
        return int(self.records[0].jacobian.shape[-1])

    @cached_property
    def unknowns(self) -> tuple[NDArray[np.int64], ...]:
        """Places of each sample's columns among all unknowns."""
        found, end = [], self.dimension
        for record in self.records:
            own = np.arange(end, end + record.nuisance_count)
            found.append(np.concatenate([np.arange(self.dimension), own]))
            end += record.nuisance_count
        return tuple(found)

    @cached_property
    def held(self) -> Array:
        """(w,) weight of the prior of each unknown."""
        return np.concatenate(
            [np.broadcast_to(self.prior, (self.dimension,)), *(record.held for record in self.records)]
        )

    @cached_property
    def normal(self) -> Array:
        """(w, w) D'D + P of all unknowns."""
        total = np.diag(self.held)
        for record, at in zip(self.records, self.unknowns, strict=True):
            total[np.ix_(at, at)] += np.einsum("kcd,kce->de", record.design, record.design)
        return total

    @cached_property
    def elimination(self) -> Array:
        """(d, w) what takes the nuisances out of normal equations: [1, -D'B (B'B)^-1]."""
        d = self.dimension
        rest = inverted(self.normal[d:, d:])
        return np.concatenate([np.eye(d), -self.normal[:d, d:] @ rest], axis=1)

    @cached_property
    def information(self) -> Array:
        """(d, d) D'D + P of the search coordinates, nuisances eliminated."""
        return np.asarray(self.elimination @ self.normal[:, : self.dimension])

    @cached_property
    def middle(self) -> Array:
        """(d, d) sum_ij D_i' R(i - j) D_j of the search coordinates, nuisances eliminated."""
        return np.asarray(self.elimination @ self.joint_middle @ self.elimination.T)

    @cached_property
    def joint_middle(self) -> Array:
        """(w, w) sum_ij D_i' R(i - j) D_j, averaged over what the noise may be like by its likelihood."""
        total = np.zeros_like(self.normal)
        for model in self.noise:
            total += model.weight * self._spread(model)
        return total

    @cached_property
    def noise(self) -> tuple[NoiseModel, ...]:
        """What the noise may be like, with weights that sum to about one; nothing where nothing happens."""
        if not self.blocks:
            return ()
        lengths = [float(np.ptp(record.time_s)) for record in self.records]
        return tuple(noise_models(self.blocks, self.held, lengths))

    @cached_property
    def joint_covariance(self) -> Array:
        """(w, w) of all unknowns: the sandwich, or between flights if larger."""
        within, between, d = self._within, self.between_flights, self.dimension
        if between is None:
            return within
        ratio = np.ones(within.shape[0])
        ratio[:d] = np.sqrt(np.maximum(np.diag(between) / np.maximum(np.diag(within)[:d], 1e-300), 1.0))
        total = within * np.outer(ratio, ratio)
        # nuisances follow the search coordinates
        slope = self.elimination[:, d:].T
        total[d:, d:] += slope @ (total - within)[:d, :d] @ slope.T
        return np.asarray(total)

    @cached_property
    def _within(self) -> Array:
        """(w, w) of all unknowns: the sandwich."""
        bread = inverted(self.normal)
        total = self.joint_middle + np.diag(self.held**2 * self._prior_variance)
        return np.asarray(bread @ total @ bread)

    @property
    def covariance(self) -> Array:
        """(d, d) of the estimate in search coordinates."""
        return self.joint_covariance[: self.dimension, : self.dimension]

    def nuisance_covariance(self, sample: int) -> Array:
        """(n, n) of the nuisances of a sample, by its place among the records."""
        own = self.unknowns[sample][self.dimension :]
        return np.asarray(self.joint_covariance[np.ix_(own, own)])

    @property
    def freedom(self) -> int:
        """Degrees of freedom of the intervals: averages that depend on the unknowns, less their number."""
        reported = [each.time_s.size for each in self.blocks if np.abs(each.design).max() > SMALLEST_RAD]
        return max(int(sum(reported)) - int(self.normal.shape[0]), 1)

    @cached_property
    def between_flights(self) -> Array | None:
        """(d, d) by the jackknife over flights, each left out in one Gauss-Newton step; None below three.

        At the optimum of all flights, those without flight s have theirs at H_(-s)^-1 D_s' r_s from it.
        """
        count = len(self.records)
        if count < MIN_FLIGHTS:
            return None
        moves, d = [], self.dimension
        for record in self.records:
            gram = np.einsum("kcd,kce->de", record.design, record.design)
            pull = np.einsum("kcd,kc->d", record.design, record.residual)
            onto = gram[:d, d:] @ inverted(gram[d:, d:] + np.diag(record.held))
            own = gram[:d, :d] - onto @ gram[d:, :d]
            moves.append(np.linalg.solve(self.information - own, pull[:d] - onto @ pull[d:]))
        apart = np.array(moves) - np.mean(moves, axis=0)
        return np.asarray((count - 1.0) / count * apart.T @ apart)

    @cached_property
    def blocks(self) -> tuple[Block, ...]:
        """The channels of each sample in which anything happens."""
        return tuple(
            block(
                record.time_s,
                record.residual[:, channel],
                record.design[:, channel],
                at,
                sample=sample,
                channel=channel,
            )
            for sample, (record, at) in enumerate(zip(self.records, self.unknowns, strict=True))
            for channel in range(record.residual.shape[1])
            if np.abs(record.residual[:, channel]).max() > SMALLEST_RAD
            or np.abs(record.jacobian[:, channel]).max() > SMALLEST_RAD
        )

    @property
    def _prior_variance(self) -> Array:
        """(w,) of the priors' own errors; a nuisance's prior is taken at its word."""
        spreads = [
            each.nuisance_spread if each.nuisance_spread.size else np.zeros(each.nuisance_count)
            for each in self.records
        ]
        return np.concatenate([np.full(self.dimension, self.spread), *spreads]) ** 2

    def _spread(self, model: NoiseModel) -> Array:
        """(w, w) sum_ij D_i' R(i - j) D_j of one model of the noise."""
        total = np.zeros_like(self.normal)
        few = len(self.records) < MIN_FLIGHTS  # too few to differ
        for each, scale in zip(self.blocks, model.scales_rad, strict=True):
            minimum = self.records[each.sample].discrepancy_rad[each.channel] if few else 0.0
            correlation = model.shape.correlation(each.time_s)
            own = max(scale, minimum) ** 2 * each.gain.T @ correlation @ each.gain
            total[np.ix_(each.unknowns, each.unknowns)] += own
        return total


def inverted(matrix: Array) -> Array:
    """Inverse of a symmetric matrix whose rows may differ by many orders; zero where a row is zero."""
    size = np.diag(matrix)
    seen = size > 0.0
    scale = np.where(seen, 1.0 / np.sqrt(np.where(seen, size, 1.0)), 0.0)
    even = matrix * np.outer(scale, scale) + np.diag(np.where(seen, 0.0, 1.0))
    return np.asarray(np.linalg.inv(even) * np.outer(scale, scale))
