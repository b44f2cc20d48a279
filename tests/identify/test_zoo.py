"""The zoo of bad data: every usual mistake, made in clean flights, is named, and no clean flight is accused.

The flights are those of the flexible aircraft in examples/, which no model here was made with.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from morphcore.errors import InvalidInput
from morphcore.geometry.aircraft import Aircraft, Flight
from morphcore.identify.diagnoses import WRONG_DATA
from morphcore.identify.identification import Identification
from morphcore.identify.result import IdentifyResult
from morphcore.identify.settings import SearchSettings
from morphcore.models.equivalent import chain_model, physical_guess
from morphcore.simulate.trajectory import Trajectory
from morphdata.aircraft import Aircraft as AircraftDocument
from morphdata.flight import Flight as FlightDocument
from morphdata.identify import EquivalentModel
from morphdata.measurement import ANGLES
from tests.identify.flights import (
    EXAMPLES,
    example,
    reference_aircraft,
    reference_flight,
    shortened,
    synthetic,
)

Damage = Callable[[Trajectory], Trajectory]

LATTICE = {"chordwise": 2, "spanwise": 6}
NOISE_RAD = 4e-4  # of attitudes, as of a good sensor
FROZEN = slice(60, 90)  # rows


def identified(
    samples: Sequence[Trajectory],
    aircraft: Aircraft | None = None,
    flight: Flight | None = None,
    **model: Any,
) -> IdentifyResult:
    """Identify two links from some flights, with a lattice and a step that are good enough here."""
    run = Identification(
        aircraft or reference_aircraft(),
        flight or reference_flight(),
        samples,
        EquivalentModel(**{"links_per_wing": 2, "lattice": LATTICE, "step_s": 0.01, **model}),
        SearchSettings(method="least_squares", iterations=12),
    )
    checkpoint = b""
    for step in run.steps():
        checkpoint = step.checkpoint
    return run.judged(checkpoint)


def flights(damage: Damage = lambda sample: sample) -> list[Trajectory]:
    """One symmetric and one asymmetric flight to fit, both damaged alike."""
    return [damage(example("rate_0.8")), damage(example("asymmetric"))]


def accused(result: IdentifyResult) -> set[str]:
    """Codes of what is said to be wrong with the data."""
    return {warning.code for warning in result.warnings} & WRONG_DATA


# the animals


def angles(**changes: Callable[[np.ndarray], np.ndarray]) -> Damage:
    """Damage measured angles."""
    return lambda s: replace(s, **{name: change(getattr(s, name)) for name, change in changes.items()})


def drives(*changes: tuple[str, Callable[[np.ndarray], np.ndarray]]) -> Damage:
    """Damage drives."""
    return lambda s: replace(
        s, drives={**s.drives, **{name: change(s.drives[name]) for name, change in changes}}
    )


def negated(values: np.ndarray) -> np.ndarray:
    """Turn the sign."""
    return -values


def frozen(values: np.ndarray) -> np.ndarray:
    """Stand still for a while."""
    held = values.copy()
    held[FROZEN] = values[FROZEN.start]
    return held


def clipped(values: np.ndarray) -> np.ndarray:
    """Saturate at six tenths of the way from the start to the end that is furthest."""
    apart = values - values[0]
    limit = 0.6 * apart[np.abs(apart).argmax()]
    return values[0] + (np.minimum(apart, limit) if limit > 0.0 else np.maximum(apart, limit))


def late(delay_s: float) -> Damage:
    """Attitudes that come after the drives."""

    def damage(sample: Trajectory) -> Trajectory:
        seen = {n: np.interp(sample.time_s - delay_s, sample.time_s, getattr(sample, n)) for n in ANGLES}
        return replace(sample, **seen)

    return damage


def swapped(sample: Trajectory) -> Trajectory:
    """Exchange left and right."""
    left, right = sample.drives["sweep_left"], sample.drives["sweep_right"]
    return replace(sample, drives={"sweep_left": right, "sweep_right": left})


BOTH = ("sweep_left", "sweep_right")
ANIMALS: dict[str, tuple[Damage, str]] = {
    "roll and yaw in degrees": (angles(phi=np.degrees, psi=np.degrees), "looks_like_degrees"),
    "drives in rad read as degrees": (drives(*((name, np.radians) for name in BOTH)), "looks_like_degrees"),
    "phi flipped": (angles(phi=negated), "flipped_sign"),
    "theta flipped": (angles(theta=negated), "flipped_sign"),
    "psi flipped": (angles(psi=negated), "flipped_sign"),
    "both drives flipped": (drives(*((name, negated) for name in BOTH)), "flipped_sign"),
    "one drive flipped": (drives(("sweep_left", negated)), "flipped_sign"),
    "sides swapped": (swapped, "swapped_sides"),
    "50 ms late": (late(0.05), "late"),
    "theta clipped": (angles(theta=clipped), "clipped_column"),
    "drives clipped": (drives(*((name, clipped) for name in BOTH)), "clipped_column"),
    "theta frozen": (angles(theta=frozen), "frozen_column"),
    "a drive frozen": (drives(("sweep_left", frozen)), "frozen_column"),
    "roll never recorded": (angles(phi=np.zeros_like), "frozen_column"),
}


@pytest.mark.parametrize("animal", ANIMALS)
def test_each_mistake_is_named(animal: str) -> None:
    """By its code alone, with a pointer to a sample, and the result is not called good."""
    damage, code = ANIMALS[animal]
    result = identified(flights(damage))
    assert accused(result) == {code}
    assert result.verdict.grade in (("usable", "poor") if code == "late" else ("poor", "failed"))
    named = [warning for warning in result.warnings if warning.code == code]
    assert all(warning.pointer.startswith("/samples/") and warning.hint for warning in named)
    assert any(named[0].message[1:] in reason for reason in result.verdict.reasons)


@pytest.mark.slow
@pytest.mark.parametrize(
    "animal", ["phi flipped", "theta flipped", "sides swapped", "50 ms late", "theta clipped"]
)
def test_mistakes_are_named_in_noisy_flights(animal: str) -> None:
    """Noise of 0.4 mrad on the attitudes hides none of them."""
    damage, code = ANIMALS[animal]
    random = np.random.default_rng(7)

    def noisy(sample: Trajectory) -> Trajectory:
        shaken = {n: getattr(sample, n) + random.normal(0.0, NOISE_RAD, sample.phi.size) for n in ANGLES}
        return damage(replace(sample, **shaken))

    assert accused(identified(flights(noisy))) == {code}


def test_milliseconds_are_refused_before_a_search() -> None:
    """Half a second of flight in milliseconds is short enough to be read; it is refused by its motion."""
    sample = shortened(example("rate_0.8"), 58)
    with pytest.raises(InvalidInput, match="milliseconds") as refused:
        identified([replace(sample, time_s=1000.0 * sample.time_s)])
    assert refused.value.pointer == "/samples/0/time_s"
    with pytest.raises(InvalidInput, match="the flight takes") as refused:
        identified([replace(example("rate_0.8"), time_s=1000.0 * example("rate_0.8").time_s)])
    assert "milliseconds" in refused.value.hint


def test_seconds_under_a_title_of_milliseconds_are_refused() -> None:
    """A flight that is a thousand times too fast."""
    sample = example("rate_0.8")
    with pytest.raises(InvalidInput, match="thousand times longer"):
        identified([replace(sample, time_s=sample.time_s / 1000.0)])


def test_degrees_beyond_the_vertical_are_refused_when_read() -> None:
    """Pitch of 3.6 rad is no pitch."""
    with pytest.raises(InvalidInput) as refused:
        identified(flights(angles(theta=np.degrees)))
    assert "degrees" in refused.value.hint
    with pytest.raises(InvalidInput) as refused:
        identified(flights(drives(*((name, np.degrees) for name in BOTH))))
    assert "degrees" in refused.value.hint


def changed_documents(**changes: float) -> tuple[Aircraft, Flight]:
    """The example with some numbers multiplied: of the fuselage, of every surface, or of the flight."""
    aircraft, flight = (
        json.loads((EXAMPLES / f"{name}.json").read_text()) for name in ("aircraft", "flight")
    )
    for name, factor in changes.items():
        for place in (aircraft["fuselage"], *aircraft["surfaces"], flight):
            if name in place:
                place[name] *= factor
    flight.pop("start", None)  # it is that of the right aircraft
    return Aircraft.of(AircraftDocument.parse(aircraft)), Flight.of(FlightDocument.parse(flight))


@pytest.mark.parametrize(
    "changes",
    [{"density_kg_m3": 1.6}, {"span_m": 1.4}, {"airspeed_m_s": 1.35}, {"airspeed_m_s": 0.5, "span_m": 0.5}],
)
def test_a_wrong_aircraft_is_named(changes: dict[str, float]) -> None:
    """Flights of another aircraft: too heavy, too wide, too fast, and a small one that is slow."""
    result = identified(flights(), *changed_documents(**changes))
    assert accused(result) == {"wrong_aircraft"} or result.lost
    assert result.verdict.grade in ("poor", "failed")


def test_clean_flights_of_the_flexible_aircraft_are_good() -> None:
    """Nothing is said against them, and a flight that was held out proves the model."""
    held_out = replace(example("rate_0.5"), role="held_out")
    result = identified([*flights(), held_out])
    assert result.warnings == ()
    assert result.verdict.grade == "good"


@pytest.mark.parametrize("seed", range(3))
def test_clean_synthetic_flights_raise_no_alarm(seed: int) -> None:
    """Of chains with random stiffness, and with noise; drives that stop abruptly are no clipped ones."""
    random = np.random.default_rng(seed)
    guess = physical_guess(chain_model(reference_aircraft(), reference_flight(), 2))
    shaken = {
        name: values * np.exp(random.normal(0.0, 0.3, values.shape)) for name, values in guess.values.items()
    }
    truth = replace(
        guess, values={**guess.values, **{n: shaken[n] for n in ("stiffness_nm_rad", "damping_nms_rad")}}
    )
    noise = NOISE_RAD * (seed % 2)
    samples = [
        synthetic(truth, name="even", noise_rad=noise, seed=seed),
        synthetic(truth, name="uneven", left_rad=0.4, right_rad=0.7, noise_rad=noise, seed=seed + 10),
        replace(synthetic(truth, name="unseen", left_rad=0.6, right_rad=0.3), role="held_out"),
    ]
    result = identified(samples)
    assert accused(result) == set()
    assert result.verdict.grade == "good"
