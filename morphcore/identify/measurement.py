"""How each sample is measured: what is compared, its noise, and what else than the model is unknown.

A reading of channel c at time t is

    y_c(t) = h_c(x(t - delay)) + b_c + e_c

with the same delay of all channels against the drives. Biases, the heading to begin with and, where it is
free, the start are linear unknowns; `nuisance` removes them from the residuals.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from morphcore.errors import InvalidInput
from morphcore.search.checkpoint import stored
from morphcore.simulate.trajectory import Trajectory
from morphdata.faults import refuse
from morphdata.measurement import ANGLES, Measurement, absent_channels

Array = NDArray[np.float64]

HEADING = "psi"
# white noise of an angle, rad, above which a flight counts as measured: rounding of a simulated one is far
# below, and a good attitude sensor ten times above
MEASURED_RAD = 2e-5
DIFFERENCE = 3  # order of the differences that show noise: slower motion leaves little in them
MIN_DIFFERENCES = 12
ALTERNATING = (
    0.6  # share of neighbouring differences of unlike sign; noise has 0.77, smooth motion hardly any
)
MAD_TO_SIGMA = 1.4826  # of normal noise
FLOOR = 1e-6  # of a channel's range: less noise than this no sensor has
START = ("phi_rad", "theta_rad", "p_rad_s", "q_rad_s", "r_rad_s", "u_m_s", "v_m_s", "w_m_s")
# standard deviations of a start around the trim: rad, rad/s, and shares of the airspeed
START_SPREAD = (0.1, 0.1, 0.3, 0.3, 0.3, 0.1, 0.1, 0.1)
DELAY_SPREAD_S = 0.1


@stored
@dataclass(frozen=True, eq=False)
class Openness:
    """What is unknown about the measurement of one sample, and how its residuals are weighted.

    Attributes
    ----------
    bias : tuple of str
        Channels with a free bias.
    delay, start : bool
        Whether these are free.
    sigma : dict of str to float
        Noise of each fitted channel; empty where the angles have equal weights.
    scale_rad : float
        Noise of the angles beyond which a robust loss grows slower than the square; 0 with squares.
    start_value : tuple of float
        What the start of its flights is off the trim, in the order of `START`.
    reference : ndarray, shape (d,)
        Search point at which the derivatives by the start are taken; empty where the start is not free.
    reason : str
        Why these are free.
    """

    bias: tuple[str, ...] = ()
    delay: bool = False
    start: bool = False
    sigma: dict[str, float] = field(default_factory=dict)
    scale_rad: float = 0.0
    start_value: tuple[float, ...] = (0.0,) * len(START)
    reference: Array = field(default_factory=lambda: np.zeros(0))
    reason: str = ""

    @property
    def free(self) -> tuple[tuple[str, ...], bool, bool]:
        """What is free: biases, delay and start."""
        return self.bias, self.delay, self.start


@dataclass(frozen=True)
class Measured:
    """The readings of one sample as they are compared with flights, of k rows and c channels.

    Attributes
    ----------
    channels : tuple of str
        The angles first, then the others.
    values : ndarray, shape (k, c)
        Readings; NaN where one is missing.
    weight : ndarray, shape (c,)
        By which errors are multiplied, rad per unit of the channel; 0 of an angle that is not fitted.
    openness : Openness
    loss : str
        As of a request.
    start_columns : ndarray, shape (k, c, n)
        Derivatives of the readings by the start; n = 0 where it is not free.
    start_spread : ndarray, shape (n,)
        Standard deviations of the start.
    angle_columns : ndarray, shape (k, c, n)
        Derivatives of the readings by errors of the first angles of noisy drives.
    angle_spread : ndarray, shape (n,)
        Standard deviations of these, rad.
    angle_unit_rad : float
        What an error of one standard deviation costs, rad.
    angle_names : tuple of str
        Drives that these belong to.
    """

    channels: tuple[str, ...]
    values: Array
    weight: Array
    openness: Openness = field(default_factory=Openness)
    loss: str = "linear"
    start_columns: Array = field(default_factory=lambda: np.zeros((0, 0, 0)))
    start_spread: Array = field(default_factory=lambda: np.zeros(0))
    angle_columns: Array = field(default_factory=lambda: np.zeros((0, 0, 0)))
    angle_spread: Array = field(default_factory=lambda: np.zeros(0))
    angle_unit_rad: float = 1.0
    angle_names: tuple[str, ...] = ()

    @property
    def plain(self) -> bool:
        """Whether the attitude at the rows alone is compared, and only the heading is free besides."""
        return self.channels == ANGLES and not (self.openness.delay or any(self.openness.start_value))

    @property
    def offset(self) -> NDArray[np.bool_]:
        """(c,) channels that have a constant offset: a bias, or the heading."""
        return np.array([name == HEADING or name in self.openness.bias for name in self.channels])

    @property
    def angle(self) -> NDArray[np.bool_]:
        """(c,) channels whose differences are wrapped."""
        return np.array([name in ANGLES for name in self.channels])

    @property
    def fitted(self) -> NDArray[np.bool_]:
        """(c,) channels that have residuals."""
        return self.weight > 0.0

    @property
    def fitted_channels(self) -> tuple[str, ...]:
        """Names of the channels that have residuals."""
        return tuple(name for name, fits in zip(self.channels, self.fitted, strict=True) if fits)

    @property
    def residual_count(self) -> int:
        """Number of residuals."""
        return int(self.values.shape[0] * self.fitted.sum())


def measured(sample: Trajectory, measurement: Measurement, openness: Openness) -> Measured:
    """The readings of a sample that a measurement fits."""
    names = (*ANGLES, *(name for name in measurement.names if name not in ANGLES))
    values = np.stack([_column(sample, name) for name in names], axis=1)
    values[:, : len(ANGLES)] = np.unwrap(values[:, : len(ANGLES)], axis=0)
    weight = np.array([1.0 if name in measurement.names else 0.0 for name in names])
    if openness.sigma:
        reference = reference_rad(openness)
        weight *= np.array([reference / openness.sigma.get(name, reference) for name in names])
    return Measured(names, values, weight * np.sqrt(sample.weight), openness, measurement.loss)


def reference_rad(openness: Openness) -> float:
    """Noise of an angle to which that of other channels is related: mean of the fitted angles, or 1 mrad."""
    angles = [sigma for name, sigma in openness.sigma.items() if name in ANGLES]
    return float(np.exp(np.mean(np.log(angles)))) if angles else 1e-3


def _column(sample: Trajectory, name: str) -> Array:
    if name in ANGLES:
        return np.array(getattr(sample, name), dtype=np.float64)
    missing = np.full(sample.time_s.size, np.nan)  # held out, without the channel
    return np.array(sample.channels.get(name, missing), dtype=np.float64)


def first_openness(samples: Sequence[Trajectory], measurement: Measurement) -> tuple[Openness, ...]:
    """What is free before anything is flown: what is declared, and what the noise of the data says.

    Raises
    ------
    InvalidInput
        A sample to fit lacks a channel, or one whose noise is not given shows none and does not move.
    """
    refuse(
        absent_channels(
            measurement,
            [(f"/samples/{n}", each.role, tuple(each.channels)) for n, each in enumerate(samples)],
        )
    )
    sigma = _first_sigma(samples, measurement)
    found = []
    for sample in samples:
        noisy = max(angle_noise(sample).values()) > MEASURED_RAD
        free, reasons = [], []
        for name in measurement.names:
            declared = measurement.channels[name].bias if measurement.channels else None
            declared = measurement.bias if declared is None else declared
            if declared or (declared is None and noisy):
                free.append(name)
        if noisy:
            reasons.append("the angles carry white noise, as of a measured flight")
        if None not in (measurement.bias, measurement.delay):
            reasons = ["as requested"]
        found.append(
            Openness(
                bias=tuple(free),
                delay=noisy if measurement.delay is None else measurement.delay,
                start=bool(measurement.initial_state),
                sigma=sigma,
                reason="; ".join(reasons),
            )
        )
    return tuple(found)


def angle_noise(sample: Trajectory) -> dict[str, float]:
    """White noise of each angle's rows, rad."""
    return {name: white_noise(sample.time_s, np.unwrap(getattr(sample, name))) for name in ANGLES}


def _first_sigma(samples: Sequence[Trajectory], measurement: Measurement) -> dict[str, float]:
    """Noise of each channel that a measurement names: as given, or as the rows show."""
    sigma = {}
    for name, channel in (measurement.channels or {}).items():
        columns = [(each.time_s, _column(each, name)) for each in samples if each.role == "train"]
        sigma[name] = channel.sigma or noise_floor(columns)
        if not sigma[name] > 0.0:
            raise InvalidInput(
                f"the channel {name} is constant in every sample, which says nothing about its noise",
                pointer=f"/measurement/channels/{name}/sigma",
                hint="give its sigma, or leave the channel out",
            )
    return sigma


def noise_floor(columns: Sequence[tuple[Array, Array]]) -> float:
    """The least noise that a channel is credited with, from its columns (times, values) in some samples."""
    noise = [white_noise(times, values) for times, values in columns]
    extent = [np.ptp(values[np.isfinite(values)]) for _, values in columns if np.isfinite(values).any()]
    return max(float(np.sqrt(np.mean(np.square(noise)))), FLOOR * max(extent, default=0.0))


def white_noise(time_s: Array, values: Array) -> float:
    """Standard deviation of the white noise in rows (k,) of a smooth signal; 0 where there is none to see.

    From third differences, scaled to unit noise and by what their median says, so that outliers do not
    count. Of a smooth signal sampled too coarsely they are no noise: then they hardly change sign.
    """
    known = np.isfinite(values)
    time_s, values = time_s[known], values[known]
    count = values.size - DIFFERENCE
    if count < MIN_DIFFERENCES:
        return 0.0
    weights = divided_differences(time_s)
    weights /= np.linalg.norm(weights, axis=1, keepdims=True)
    rows = np.stack([values[i : i + count] for i in range(DIFFERENCE + 1)], axis=1)
    differences = np.einsum("ki,ki->k", weights, rows)
    signs = np.sign(differences)
    alternating = float(np.mean(signs[1:] * signs[:-1] < 0.0))
    if alternating < ALTERNATING:
        return 0.0
    return float(MAD_TO_SIGMA * np.median(np.abs(differences)))


def divided_differences(time_s: Array) -> Array:
    """Weights (k - 3, 4) of neighbouring rows for third divided differences: no parabola moves them."""
    count = time_s.size - DIFFERENCE
    times = np.stack([time_s[i : i + count] for i in range(DIFFERENCE + 1)], axis=1)
    weights = np.ones_like(times)
    for i in range(DIFFERENCE + 1):
        for j in range(DIFFERENCE + 1):
            if i != j:
                weights[:, i] /= times[:, i] - times[:, j]
    return weights
