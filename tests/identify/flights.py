"""Flights to identify from: the examples, and synthetic ones flown with known parameters."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from morphcore import Trajectory, load_aircraft, load_flight, load_trajectory
from morphcore.geometry.aircraft import Aircraft, Flight
from morphcore.identify.cost import fly_attitudes, sample_cases, shared_trims
from morphcore.models.equivalent import ParameterBatch, chain_model
from morphcore.simulate.schedule import ConstantRate
from morphdata.aircraft import Aircraft as AircraftDocument
from morphdata.flight import Flight as FlightDocument

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


@cache
def reference_documents() -> tuple[AircraftDocument, FlightDocument]:
    """The example aircraft and flight condition as documents."""
    return load_aircraft(EXAMPLES / "aircraft.json"), load_flight(EXAMPLES / "flight.json")


@cache
def reference_aircraft() -> Aircraft:
    """The example aircraft."""
    return Aircraft.of(reference_documents()[0])


@cache
def reference_flight() -> Flight:
    """The example flight condition."""
    return Flight.of(reference_documents()[1])


@cache
def example(name: str, role: str = "train") -> Trajectory:
    """An example flight."""
    return load_trajectory(EXAMPLES / f"train_{name}.csv", role=role)  # type: ignore[arg-type]


def shortened(sample: Trajectory, rows: int) -> Trajectory:
    """The first rows of a flight."""
    return chosen_rows(sample, slice(rows))


def chosen_rows(sample: Trajectory, rows: Any) -> Trajectory:
    """Some rows of a flight, without its other columns."""
    columns = {name: getattr(sample, name)[rows] for name in ("time_s", "phi", "theta", "psi")}
    drives = {name: values[rows] for name, values in sample.drives.items()}
    return replace(sample, **columns, drives=drives, extra={})


def synthetic(
    batch: ParameterBatch,
    *,
    name: str = "synthetic",
    left_rad: float = 0.6,
    right_rad: float = 0.6,
    duration_s: float = 0.8,
    noise_rad: float = 0.0,
    seed: int = 0,
) -> Trajectory:
    """A flight flown with known parameters, with white noise on the angles."""
    time_s = np.arange(0.0, duration_s + 0.3, 0.01)
    rest: NDArray[np.float64] = np.zeros_like(time_s)
    left, right = (
        ConstantRate(0.0, final, duration_s, start_s=0.1).motion(time_s).angle
        for final in (left_rad, right_rad)
    )
    blank = Trajectory(name, time_s, {"sweep_left": left, "sweep_right": right}, rest, rest, rest)
    model = chain_model(reference_aircraft(), reference_flight(), batch.links)
    ((case, found),) = shared_trims(model, batch, sample_cases(model, [blank]), "trim")
    euler = fly_attitudes(model, batch, case, found)[0]
    euler = euler + np.random.default_rng(seed).normal(0.0, noise_rad, euler.shape)
    return replace(blank, phi=euler[:, 0], theta=euler[:, 1], psi=euler[:, 2])
