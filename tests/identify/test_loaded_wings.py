"""An aircraft with stations, pods and an engine above is identified like any other."""

from __future__ import annotations

from dataclasses import replace

from morphcore import Trajectory, identify, load_aircraft, load_flight, simulate
from morphcore.simulate.schedule import ConstantRate
from morphdata.flight import Flight
from tests.identify.flights import EXAMPLES


def flown(flight: Flight, left_rad: float, right_rad: float, name: str, role: str) -> Trajectory:
    """A flight of the flexible model from its own trim."""
    schedules = {
        side: ConstantRate(0.0, angle, 1.0, start_s=0.1)
        for side, angle in (("left", left_rad), ("right", right_rad))
    }
    aircraft = load_aircraft(EXAMPLES / "pods" / "aircraft.json")
    found = simulate(aircraft, flight, schedules, model="flexible", duration_s=1.4).trajectory
    return replace(found, name=name, role=role, extra={})  # type: ignore[arg-type]


def test_pods_and_stations_from_samples_to_a_held_out_flight() -> None:
    """Three links explain the beams' flights, and predict another: 1e-4 of the rigid model's J, 0.1 mrad.

    A search moves the joints past the pods; the links' masses follow smoothly. Measured: 1e-6, 0.015 mrad.
    """
    flight = load_flight(EXAMPLES / "flight.json").model_copy(update={"start": None})
    samples = [
        flown(flight, 0.5, 0.5, "slow", "train"),
        flown(flight, 0.8, 0.8, "fast", "train"),
        flown(flight, 0.6, 0.5, "uneven", "train"),
        flown(flight, 0.7, 0.7, "other", "held_out"),
    ]
    aircraft = load_aircraft(EXAMPLES / "pods" / "aircraft.json")
    result = identify(aircraft, flight, samples, links_per_wing=3)
    for sample in result.to_document()["fit"]:
        assert sample["J_identified"] < 1e-4 * sample["J_rigid"]
        assert max(sample["rms_rad"].values()) < 1e-4
