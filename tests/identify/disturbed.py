"""Flights of a known model on the example schedules, and what measurement does to them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from morphcore import Trajectory, simulate
from morphcore.identify.identification import Identification
from morphcore.identify.parameters import SearchSpace, search_space
from morphcore.identify.result import IdentifyResult
from morphcore.identify.settings import search_settings
from morphcore.models.equivalent import ParameterBatch, chain_model
from morphdata.identify import EquivalentModel, IdentifySearch
from morphdata.measurement import ANGLES, Measurement
from tests.identify.flights import (
    chosen_rows,
    example,
    reference_aircraft,
    reference_documents,
    reference_flight,
)

Array = NDArray[np.float64]

LINKS = 2
CHANNELS = (
    "p",
    "q",
    "r",
    "alpha",
    "beta",
    "airspeed",
    "fz",
    "nz",
    "vz",
    "tip_left_z",
    "tip_right_z",
    "tip_z",
)
TRAINING = ("rate_0.5", "asymmetric")
STIFFNESS = ("stiffness_nm_rad.joint_1.flap", "stiffness_nm_rad.joint_1.torsion")


@cache
def space() -> SearchSpace:
    """The unknowns of the true model."""
    return search_space(chain_model(reference_aircraft(), reference_flight(), LINKS))


@cache
def truth() -> ParameterBatch:
    """A model of two links, all of its parameters up to 35 per cent off beam theory."""
    guess = space().guess
    return space().decode(guess + np.random.default_rng(5).uniform(-0.3, 0.3, guess.size))


@cache
def flown(name: str, *, late_s: float = 0.0) -> Trajectory:
    """The true model's flight on the schedule of an example, its body channels late against the drives.

    The flight begins ``late_s`` before the first row of the sample, so that its rows are exact; drives rest
    there.
    """
    sample = example(name)
    rows = round(late_s / 0.01)
    assert abs(rows * 0.01 - late_s) < 1e-12
    flight = simulate(*reference_documents(), sample, model=truth(), step_s=0.01, channels=list(CHANNELS))
    found = flight.trajectory

    def late(values: Array) -> Array:
        return np.concatenate([np.full(rows, values[0]), values[: values.size - rows]])

    columns: dict[str, Any] = {angle: late(getattr(found, angle)) for angle in ANGLES}
    channels = {channel: late(values) for channel, values in found.extra.items()}
    return replace(sample, **columns, extra={}, channels=channels)


def noisy(sample: Trajectory, sigma_rad: float, seed: int) -> Trajectory:
    """White noise on the three angles, the first row included."""
    noise = np.random.default_rng(seed).normal(0.0, sigma_rad, (sample.time_s.size, 3))
    columns: dict[str, Any] = {name: getattr(sample, name) + noise[:, k] for k, name in enumerate(ANGLES)}
    return replace(sample, **columns)


def biased(sample: Trajectory, **bias_rad: Any) -> Trajectory:
    """Constant biases of some angles."""
    return replace(sample, **{name: getattr(sample, name) + value for name, value in bias_rad.items()})


def thinned(sample: Trajectory, seed: int, share: float) -> Trajectory:
    """A share of the rows, drawn at random, without the others; the first row stays."""
    rng = np.random.default_rng(seed)
    count = sample.time_s.size
    rows = np.sort(np.append(0, 1 + rng.choice(count - 1, int(share * count), replace=False)))
    return replace(chosen_rows(sample, rows), channels={})


def outliers(sample: Trajectory, seed: int, rows: int = 3, off_rad: float = 0.05) -> Trajectory:
    """A few rows whose angles are off, all three of a row to one side or the other."""
    rng = np.random.default_rng(seed)
    chosen, side = rng.choice(sample.time_s.size, rows, replace=False), rng.choice([-1.0, 1.0], rows)
    error = np.zeros(sample.time_s.size)
    error[chosen] = off_rad * side
    return biased(sample, **dict.fromkeys(ANGLES, error))


@dataclass(frozen=True)
class Found:
    """An identification from disturbed flights, against the truth.

    Attributes
    ----------
    result : IdentifyResult
    relative : ndarray, shape (2,)
        Errors of flap and torsion stiffness, as shares of the truth.
    standard_error : ndarray, shape (2,)
        The reported ones, as shares of the truth.
    """

    result: IdentifyResult
    relative: Array
    standard_error: Array

    def measurement(self, sample: str) -> dict[str, Any]:
        """What the result says of the measurement of a sample, by the name of its example."""
        return dict(self.result.to_document()["measurement"][f"train_{sample}"])


def fitted(samples: list[Trajectory], measurement: Measurement | None = None) -> Found:
    """Identify a model of two links."""
    run = Identification(
        reference_aircraft(),
        reference_flight(),
        samples,
        EquivalentModel(links_per_wing=LINKS),
        search_settings(IdentifySearch()),
        measurement=measurement,
    )
    checkpoint = b""
    for step in run.steps():
        checkpoint = step.checkpoint
    result = run.result(checkpoint)
    names = list(space().parameter_names)
    at = [names.index(name) for name in STIFFNESS]
    expected = space().flatten(truth())[0][at]
    assert result.uncertainty is not None
    return Found(
        result,
        space().flatten(result.parameters)[0][at] / expected - 1.0,
        result.uncertainty.standard_error[at] / expected,
    )
