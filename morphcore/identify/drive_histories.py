"""Measured histories of drives: their noise, a smooth history, and the angle at which a flight begins.

A history is differentiated twice before it moves a wing, and its first angle is the one for which the
aircraft is trimmed: an error of it is an unbalanced moment for the whole flight. So noise is taken out of it.
A morph has corners in its rate, which a linear filter would round off and so move the wing by more than the
noise did. The smooth history therefore minimises

    sum_k ((z_k - y_k) / sigma)^2 + weight sum_j |third difference of z|_j

(trend filtering: Kim, Koh, Boyd & Gorinevsky 2009), which gives pieces of constant acceleration whose number
the data choose by generalised cross-validation (Golub, Heath & Wahba 1979). Where a bandwidth is stated, a
smoothing spline of that bandwidth takes its place. Histories without noise stay as they are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded

from morphcore.geometry.aircraft import Aircraft
from morphcore.identify.measurement import DIFFERENCE, divided_differences, white_noise
from morphcore.simulate.hinge_schedules import moved_flight
from morphcore.simulate.trajectory import Trajectory, require_flight
from morphdata.faults import InvalidInput, refuse
from morphdata.identify import samples_faults
from morphdata.measurement import Measurement

Array = NDArray[np.float64]
Bandwidth = float | Literal["auto"]

MIN_NOISE_RAD = 5e-6  # white noise below it is rounding, and moves no wing
WEIGHTS = np.geomspace(1.0, 3e4, 14)  # of the third differences, tried in turn
REWEIGHTINGS = 25  # of a weight: each brings the differences that are zero nearer to it
ROUND = 1e-2  # of the noise: a smaller third difference counts as none
# standing still at the start
MIN_REST_ROWS = 6
REST_SPREAD = 4.5  # standard deviations within which rows of a hinge at rest lie
REST_SLOPE = 3.0  # standard errors of a slope that still is none
REST_SHARE = 0.7  # of the rows that look like rest: the last of them may be the beginning of the morph
# rows at the very start that jitter about the angle at which a history without noise then stands still
MAX_JITTER_ROWS = 5
STILL_ROWS = 6
STILL_RAD = 1e-6
MAX_JITTER_RAD = 2e-3


@dataclass(frozen=True)
class DriveHistory:
    """A history of one drive as flights follow it.

    Attributes
    ----------
    angle_rad : ndarray, shape (k,)
        Smooth angles.
    noise_rad : float
        White noise of the measured ones; 0 where they are taken as they are.
    start_error_rad : float
        Standard error of the first angle; 0 where there is no noise.
    """

    angle_rad: Array
    noise_rad: float = 0.0
    start_error_rad: float = 0.0


@dataclass(frozen=True)
class SmoothedSamples:
    """Samples whose drives an aircraft can follow.

    Attributes
    ----------
    given : tuple of Trajectory
        With the drives as measured.
    smooth : tuple of Trajectory
        With drives as flights follow them.
    histories : tuple of dict of str to DriveHistory
        Of each sample, by drive.
    """

    given: tuple[Trajectory, ...]
    smooth: tuple[Trajectory, ...]
    histories: tuple[dict[str, DriveHistory], ...]


def smooth_history(time_s: Array, angle_rad: Array, bandwidth_hz: Bandwidth = "auto") -> DriveHistory:
    """Take the noise out of a measured history.

    Parameters
    ----------
    time_s : ndarray, shape (k,)
        Rising times, s; steps may be uneven.
    angle_rad : ndarray, shape (k,)
        Measured angles, rad.
    bandwidth_hz : float or "auto"
        Frequency at which a smoothing spline halves an oscillation, Hz; ``"auto"``: by trend filtering.

    Returns
    -------
    DriveHistory
        The same angles where their noise is below `MIN_NOISE_RAD` and no bandwidth is stated.
    """
    noise = white_noise(time_s, angle_rad)
    if noise < MIN_NOISE_RAD:
        steady = _without_jitter(angle_rad)
        return DriveHistory(steady if bandwidth_hz == "auto" else _spline(time_s, steady, bandwidth_hz))
    rest = _rest_rows(time_s, angle_rad, noise)
    held = angle_rad.copy()
    if rest:
        held[:rest] = angle_rad[:rest].mean()
    smooth = _trend(time_s, held, noise) if bandwidth_hz == "auto" else _spline(time_s, held, bandwidth_hz)
    if rest:
        # the corner where the morph begins is the data's; up to it the drive stands still
        smooth[:rest] = held[0]
    return DriveHistory(smooth, noise, noise / np.sqrt(max(rest, 2)))


def smoothed_drives(
    sample: Trajectory, bandwidth_hz: Bandwidth | None = None
) -> tuple[Trajectory, dict[str, DriveHistory]]:
    """Smooth the drives of a sample; also the histories by drive, as of `smooth_history`."""
    bandwidth = "auto" if bandwidth_hz is None else bandwidth_hz
    found = {name: smooth_history(sample.time_s, angles, bandwidth) for name, angles in sample.drives.items()}
    if all(each.angle_rad is sample.drives[name] for name, each in found.items()):
        return sample, found
    return replace(sample, drives={name: each.angle_rad for name, each in found.items()}), found


def smoothed_samples(
    aircraft: Aircraft, samples: Sequence[Trajectory], measurement: Measurement | None = None
) -> SmoothedSamples:
    """Check samples, and smooth their drives with the bandwidth of their measurement.

    Raises
    ------
    InvalidInput
        No sample to train on, two samples of one name, or one that the aircraft cannot follow.
    """
    for number, sample in enumerate(samples):
        if not isinstance(sample, Trajectory):
            raise InvalidInput(
                f"a sample must be a Trajectory, not a {type(sample).__name__}",
                pointer=f"/samples/{number}",
                hint="load_trajectory(path) reads one from a file",
            )
    refuse(samples_faults(samples))
    for number, sample in enumerate(samples):
        require_flight(sample, f"/samples/{number}")
    given = [moved_flight(aircraft, sample, f"/samples/{n}") for n, sample in enumerate(samples)]
    bandwidth_hz = None if measurement is None else measurement.drive_bandwidth_hz
    found = [smoothed_drives(sample, bandwidth_hz) for sample in given]
    return SmoothedSamples(
        tuple(given), tuple(sample for sample, _ in found), tuple(histories for _, histories in found)
    )


def _without_jitter(angle_rad: Array) -> Array:
    """The same, or without jitter of its first rows about the angle at which the hinge then stands still."""
    for first in range(1, min(MAX_JITTER_ROWS, angle_rad.size - STILL_ROWS) + 1):
        after = angle_rad[first : first + STILL_ROWS]
        off = np.abs(angle_rad[:first] - after[0])
        if np.ptp(after) <= STILL_RAD:
            if STILL_RAD < off.max() <= MAX_JITTER_RAD:
                steady = angle_rad.copy()
                steady[:first] = after[0]
                return steady
            break
    return angle_rad


def _rest_rows(time_s: Array, angle_rad: Array, noise: float) -> int:
    """Number of rows at the start in which the hinge stands still; 0 where there are too few of them."""
    found = 0
    for count in range(MIN_REST_ROWS, angle_rad.size + 1):
        off = angle_rad[:count] - angle_rad[:count].mean()
        if np.abs(off).max() > REST_SPREAD * noise:
            break
        t = time_s[:count] - time_s[:count].mean()
        if abs(t @ off) <= REST_SLOPE * noise * np.sqrt(t @ t):
            found = count
    return max(int(REST_SHARE * found), MIN_REST_ROWS) if found else 0


def _spline(time_s: Array, angle_rad: Array, bandwidth_hz: float) -> Array:
    from scipy.interpolate import make_smoothing_spline  # late: few flights need it

    # of rows dt apart, the spline passes 1 / (1 + weight dt w^4) of an oscillation of w rad/s
    spacing = float(np.mean(np.diff(time_s)))
    weight = 1.0 / (spacing * (2.0 * np.pi * bandwidth_hz) ** 4)
    return np.asarray(make_smoothing_spline(time_s, angle_rad, lam=weight)(time_s))


def _trend(time_s: Array, angle_rad: Array, noise: float) -> Array:
    """The history whose third differences are few: of several weights the best by cross-validation."""
    best, chosen = np.inf, angle_rad.copy()
    rows = angle_rad.size
    for weight in WEIGHTS:
        smooth, kinks = _filtered(time_s, angle_rad, noise, float(weight))
        free = rows - min(kinks + DIFFERENCE, rows - 1)
        score = rows * float(np.sum((angle_rad - smooth) ** 2)) / free**2
        if score < best:
            best, chosen = score, smooth
    return chosen


def _filtered(time_s: Array, angle_rad: Array, noise: float, weight: float) -> tuple[Array, int]:
    """One trend filter: the smooth history, and its number of third differences that are not zero.

    The absolute values are squares with weights of their own, renewed a few times.
    """
    # third differences at the mean row spacing
    differences = 6.0 * float(np.mean(np.diff(time_s))) ** DIFFERENCE * divided_differences(time_s)
    count, rows = differences.shape[0], angle_rad.size
    size, inverse = np.zeros(count), np.ones(count)
    smooth = angle_rad
    for _ in range(REWEIGHTINGS):
        system = np.zeros((DIFFERENCE + 1, rows))  # upper bands
        for a in range(DIFFERENCE + 1):
            for b in range(a, DIFFERENCE + 1):
                product = weight * inverse * differences[:, a] * differences[:, b]
                system[DIFFERENCE - (b - a), b : b + count] += product
        system[DIFFERENCE] += 1.0
        smooth = solveh_banded(system, angle_rad)
        size = np.abs(sum(differences[:, a] * smooth[a : a + count] for a in range(DIFFERENCE + 1)))
        inverse = noise / np.sqrt(size**2 + (ROUND * noise) ** 2)
    return smooth, int(np.sum(size > 3.0 * ROUND * noise))
