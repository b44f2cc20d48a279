"""Flights that a control moves are samples like others: identified from the flexible model's, end to end."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from morphcore import simulate
from morphcore.errors import InvalidInput
from morphcore.geometry.aircraft import Aircraft, Flight
from morphcore.identify import identify
from morphcore.identify.cost import costs, sample_cases, sample_schedules, shared_trims
from morphcore.models.equivalent import chain_model, physical_guess
from morphcore.simulate.schedule import ConstantRate, Hold
from morphcore.simulate.trajectory import Trajectory
from morphdata.aircraft import Aircraft as AircraftDocument
from morphdata.identify import EquivalentModel
from morphdata.lattice import Lattice
from tests.aero.controlled import MATERIAL, flight_document, tailed

COARSE = Lattice(chordwise=2, spanwise=6)


def soft() -> AircraftDocument:
    """The tailed aircraft with soft wings that sweep."""
    document = tailed(flexible=True, hinged=True)
    for surface in document["surfaces"]:
        surface["material"] = {**MATERIAL, "youngs_modulus_pa": 1.5e8}
    return AircraftDocument.parse(document)


def measured(name: str, model: object = "flexible", **schedules: object) -> Trajectory:
    """A flight as a sample: what nobody moves has no column, and an elevator a single one."""
    flown = simulate(
        soft(), flight_document(), schedules, model=model, duration_s=0.8, step_s=0.002,
        output_step_s=0.02, elements=4, lattice=COARSE,
    ).trajectory  # fmt: skip
    drives = {key: flown.drives[key if key in flown.drives else f"{key}_left"] for key in schedules}
    return replace(flown, name=name, drives=drives, extra={}, channels={})


def test_a_flight_with_an_elevator_is_identified() -> None:
    """Two links repeat the flexible aircraft's flights: J below 1 per cent of the rigid model's.

    A third flight, held out, has ailerons too.
    """
    samples = [
        measured("pull", elevator=ConstantRate(0.0, -0.03, 0.1, 0.1, 0.04)),
        measured(
            "push and sweep",
            elevator=ConstantRate(0.0, 0.02, 0.1, 0.1, 0.04),
            sweep=ConstantRate(0.0, 0.1, 0.4, 0.1, 0.05),
        ),
        replace(
            measured(
                "roll",
                elevator=ConstantRate(0.0, -0.02, 0.2, 0.1, 0.04),
                aileron=ConstantRate(0.0, 0.01, 0.1, 0.2, 0.04),
            ),
            role="held_out",
        ),
    ]
    model = EquivalentModel(links_per_wing=2, lattice=COARSE)
    result = identify(soft(), flight_document(), samples, model=model, seed=1).to_document()
    fits = {fit["sample"]: fit for fit in result["fit"]}
    shares = {name: fit["J_identified"] / fit["J_rigid"] for name, fit in fits.items()}
    assert shares["pull"] < 0.01
    assert shares["push and sweep"] < 0.01
    assert shares["roll"] < 0.05


def test_its_own_model_meets_the_flight() -> None:
    """Errors of the parameters that flew are nothing; with the elevator's column negated they are not."""
    aircraft, flight = Aircraft.of(soft()), Flight.of(flight_document())
    model = chain_model(aircraft, flight, 2, COARSE)
    guess = physical_guess(model)
    sample = measured("own", guess, elevator=ConstantRate(0.0, -0.03, 0.1, 0.1, 0.04))
    negated = replace(sample, drives={"elevator": -sample.drives["elevator"]})
    own, other = (
        costs(model, guess, sample_cases(model, [each], 0.002), "trim")[0] for each in (sample, negated)
    )
    assert own < 1e-7  # a sample's rows are interpolated
    assert other > 1e-2


def test_samples_that_begin_with_another_deflection_have_their_own_trim() -> None:
    """A trim is shared by samples of one shape only, and a deflected elevator is another."""
    model = chain_model(Aircraft.of(soft()), Flight.of(flight_document()), 2, COARSE)
    sample = measured("still", physical_guess(model), elevator=Hold(0.0))
    moved = replace(sample, drives={"elevator": np.full(sample.time_s.size, 0.05)})
    cases = sample_cases(model, [sample, moved], 0.005)
    moments = [found.moment_B[0, 1] for _, found in shared_trims(model, physical_guess(model), cases, "trim")]
    assert moments[1] - moments[0] > 1.0


def test_a_sample_beyond_the_limits_is_refused() -> None:
    """The sentence names the control and its limits."""
    aircraft = Aircraft.of(soft())
    rows = np.linspace(0.0, 0.1, 11)
    sample = Trajectory("far", rows, {"elevator": 7.0 * rows}, 0.0 * rows, 0.0 * rows, 0.0 * rows)
    with pytest.raises(InvalidInput, match="beyond the control") as caught:
        sample_schedules(aircraft, sample, "/samples/0")
    assert caught.value.hint.startswith("its range is -0.5..0.5 rad")
