"""Columns that contradict each other: frozen, saturated, repeated, with gaps; clean ones raise no alarm."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from morphcore.identify.column_checks import column_warnings
from morphcore.simulate.trajectory import Trajectory
from tests.identify.flights import chosen_rows, example

NAMES = ("rate_0.2", "rate_0.5", "rate_0.8", "asymmetric")
NOISE_RAD = 4e-4


def codes(sample: Trajectory, **changes: Any) -> list[tuple[str, str]]:
    """Codes and columns of what is said of a flight; a model would fly it as it was before the changes."""
    reference = 0.9 * sample.euler + 0.1 * sample.euler[0]
    found = column_warnings(replace(sample, **changes), "/samples/0", reference)
    return [(warning.code, warning.pointer.removeprefix("/samples/0/")) for warning in found]


def held(values: np.ndarray, first: int, last: int) -> np.ndarray:
    """A column whose record stands still from one row to another."""
    rows = np.arange(values.size)
    return np.where((rows >= first) & (rows <= last), values[first], values)


@pytest.mark.parametrize("name", NAMES)
def test_clean_flights_raise_no_alarm(name: str) -> None:
    """Neither exact nor noisy, rounded, thinned or gappy records of a healthy sensor."""
    sample = example(name)
    random = np.random.default_rng(5)
    assert codes(sample) == []
    noisy = {
        each: getattr(sample, each) + random.normal(0.0, NOISE_RAD, sample.phi.size)
        for each in ("phi", "theta", "psi")
    }
    assert codes(sample, **noisy) == []
    rounded = {each: np.round(getattr(sample, each), 3) for each in ("phi", "theta", "psi")}
    assert codes(sample, **rounded) == []
    kept = np.sort(random.choice(sample.time_s.size, size=int(0.7 * sample.time_s.size), replace=False))
    assert codes(chosen_rows(sample, kept)) == []


def test_a_saturated_angle() -> None:
    """A pitch angle that ends at the sensor's limit is clipped; with noise before the limit, too."""
    sample = example("rate_0.5")
    limit = sample.theta[0] - 0.6 * np.ptp(sample.theta)
    assert codes(sample, theta=np.maximum(sample.theta, limit)) == [("clipped_column", "theta_rad")]
    noise = np.random.default_rng(1).normal(0.0, NOISE_RAD, sample.theta.size)
    assert codes(sample, theta=np.maximum(sample.theta + noise, limit)) == [("clipped_column", "theta_rad")]


def test_a_record_that_stands_still_for_a_while() -> None:
    """An angle or a drive that pauses and then jumps to where it must be is frozen."""
    sample = example("rate_0.5")
    assert codes(sample, theta=held(sample.theta, 60, 90)) == [("frozen_column", "theta_rad")]
    drives = {**sample.drives, "sweep_left": held(sample.drives["sweep_left"], 60, 90)}
    assert codes(sample, drives=drives) == [("frozen_column", "sweep_left_rad")]


def test_a_sensor_that_was_off() -> None:
    """One value in all rows, although the aircraft rolls; in a symmetric flight roll says nothing."""
    sample = example("asymmetric")
    assert codes(sample, phi=np.zeros_like(sample.phi)) == [("frozen_column", "phi_rad")]
    assert codes(example("rate_0.5"), phi=np.zeros_like(example("rate_0.5").phi)) == []


def test_a_drive_that_pauses_is_none_that_hangs() -> None:
    """A morph in two stages stands still in between and goes on at its rate: nothing is wrong with it."""
    time_s = np.arange(0.0, 3.0, 0.01)
    stages = np.interp(time_s, [0.0, 0.2, 1.0, 2.0, 2.8, 3.0], [0.0, 0.0, 0.4, 0.4, 0.8, 0.8])
    theta = 0.06 - 0.1 * np.cumsum(stages) * 0.01
    sample = Trajectory(
        "stages", time_s, {"sweep": stages}, np.zeros_like(theta), theta, np.zeros_like(theta)
    )
    assert codes(sample) == []


def test_repeated_rows_and_gaps() -> None:
    """A logger at twice the sensors' rate repeats rows; rows that are missing across a morph leave a gap."""
    sample = example("rate_0.5")
    twice = np.arange(sample.time_s.size) // 2 * 2
    columns = {each: getattr(sample, each)[twice] for each in ("phi", "theta", "psi")}
    drives = {name: angle[twice] for name, angle in sample.drives.items()}
    assert ("repeated_rows", "") in [
        (code, pointer.removeprefix("/samples/0"))
        for code, pointer in codes(sample, **columns, drives=drives)
    ]
    rows = np.arange(sample.time_s.size)
    assert codes(chosen_rows(sample, (rows < 60) | (rows > 130))) == [("gap", "time_s/60")]
