"""Statistics of residuals as flight tests report them: Theil's coefficient, whiteness, likeness to drives.

Theil (1970) and Jategaonkar (2015), section 11: the inequality coefficient U is 0 for a model that repeats
the measurement and 1 for one that has nothing to do with it; its parts say whether the error is an offset, a
wrong size of the motion, or whatever is left. Residuals of a model that explains the measurement are white:
their autocorrelation stays within sampling error (Ljung & Box 1978).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

Array = NDArray[np.float64]

# what is smaller than this, rms, is rounding and has no statistics
ROUND_OFF = 1e-9
MAX_LAGS = 20  # of the portmanteau test
ROWS_PER_LAG = 5  # at least
# Both must be exceeded before residuals are called coloured. With thousands of rows the test alone finds
# correlations that change nothing in a fit; with few rows a correlation of this size is chance.
SIGNIFICANCE = 0.01
SLIGHT_CORRELATION = 0.2
OUTLIER = 4.0  # robust standard deviations at which a residual is held before its correlation is formed
MAD_TO_SIGMA = 1.4826  # of a normal distribution


@dataclass(frozen=True)
class ChannelStatistics:
    """How the errors of one channel are distributed over a sample; None where there is nothing to divide by.

    Attributes
    ----------
    theil : float or None
        Theil's inequality coefficient, 0..1.
    theil_bias, theil_variance, theil_covariance : float or None
        Parts of the mean squared error, which add up to 1: of an offset, of a motion of the wrong size, and
        of what is left.
    lag_1 : float or None
        Correlation of the residual with that of the row before.
    ljung_box_p : float or None
        Probability of so large an autocorrelation if the residual were white.
    white : bool or None
        Whether the residual may be taken for white.
    drive_correlation : float or None
        Correlation of the residual with the angle or the rate of that drive with which it has the largest.
    """

    theil: float | None = None
    theil_bias: float | None = None
    theil_variance: float | None = None
    theil_covariance: float | None = None
    lag_1: float | None = None
    ljung_box_p: float | None = None
    white: bool | None = None
    drive_correlation: float | None = None

    def to_document(self) -> dict[str, Any]:
        """JSON form."""
        return dict(vars(self))


def channel_statistics(
    time_s: Array, measured: Array, modelled: Array, drives: Mapping[str, Array]
) -> ChannelStatistics:
    """Statistics of one channel of a sample, in any unit.

    Parameters
    ----------
    time_s : ndarray, shape (k,)
    measured, modelled : ndarray, shape (k,)
        The channel; angles without jumps.
    drives : mapping of str to ndarray, shape (k,)
        Angles of the drives along the sample.

    Examples
    --------
    >>> import numpy as np
    >>> time_s = np.linspace(0.0, 1.0, 50)
    >>> found = channel_statistics(time_s, np.sin(time_s), np.sin(time_s) + 0.1, {})
    >>> found.theil_bias
    1.0
    """
    error = modelled - measured
    if not np.all(np.isfinite(error)):
        return ChannelStatistics()
    # departures: a trim angle or a heading would make any motion look well met
    theil = theil_parts(measured - measured[0], modelled - measured[0])
    coefficient, bias, variance, covariance = theil or (None, None, None, None)
    if _rms(error) <= ROUND_OFF:
        return ChannelStatistics(coefficient)
    lag_1, probability, white = whiteness(error)
    return ChannelStatistics(
        coefficient,
        bias,
        variance,
        covariance,
        lag_1=lag_1,
        ljung_box_p=probability,
        white=white,
        drive_correlation=drive_correlation(time_s, error, drives),
    )


def theil_parts(measured: Array, modelled: Array) -> tuple[float, float, float, float] | None:
    """Theil's coefficient and the shares of bias, variance and covariance; None where nothing moves."""
    size = _rms(measured) + _rms(modelled)
    mean_square = float(np.mean((modelled - measured) ** 2))
    if size <= ROUND_OFF or mean_square == 0.0:
        return None if size <= ROUND_OFF else (0.0, 0.0, 0.0, 0.0)
    bias = float(np.mean(modelled) - np.mean(measured)) ** 2 / mean_square
    variance = float(np.std(modelled) - np.std(measured)) ** 2 / mean_square
    return (float(np.sqrt(mean_square)) / size, bias, variance, max(1.0 - bias - variance, 0.0))


def autocorrelation(error: Array, lags: int) -> Array:
    """(lags + 1,) autocorrelation of a residual, outliers held; zeros where it is constant."""
    apart = error - np.median(error)
    scale = MAD_TO_SIGMA * float(np.median(np.abs(apart)))
    held = np.clip(apart, -OUTLIER * scale, OUTLIER * scale) if scale > 0.0 else apart
    held = held - held.mean()
    power = float(held @ held)
    if power <= 0.0:
        return np.zeros(lags + 1)
    return np.array([held[: held.size - lag] @ held[lag:] for lag in range(lags + 1)]) / power


def lag_count(rows: int) -> int:
    """Lags of which the autocorrelation of so many rows says something."""
    return max(1, min(MAX_LAGS, rows // ROWS_PER_LAG))


def white_bound(rows: int) -> float:
    """Correlation that white residuals of so many rows exceed in five of a hundred lags."""
    return float(1.96 / np.sqrt(rows))


def whiteness(error: Array) -> tuple[float, float, bool]:
    """Correlation from row to row, probability of the whole autocorrelation by chance, and the judgement."""
    lags = lag_count(error.size)
    rho = autocorrelation(error, lags)[1:]
    rows = error.size
    statistic = rows * (rows + 2.0) * float(np.sum(rho**2 / (rows - np.arange(1, lags + 1))))
    probability = float(chdtrc(lags, statistic))
    white = probability >= SIGNIFICANCE or float(np.abs(rho).max()) < SLIGHT_CORRELATION
    return float(rho[0]), probability, bool(white)


def drive_correlation(time_s: Array, error: Array, drives: Mapping[str, Array]) -> float | None:
    """The largest correlation, by size, of a residual with a drive's angle or rate; None where none moves."""
    shapes = [shape for angle in drives.values() for shape in (angle, np.gradient(angle, time_s))]
    found = [_correlation(error, shape) for shape in shapes if np.ptp(shape) > ROUND_OFF]
    return max(found, key=abs, default=None)


def _correlation(a: Array, b: Array) -> float:
    a, b = a - a.mean(), b - b.mean()
    size = float(np.sqrt((a @ a) * (b @ b)))
    return float(np.clip(a @ b / size, -1.0, 1.0)) if size > 0.0 else 0.0


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
