"""Trim by a control surface: the same law as by a hinge of incidence."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from morphcore.models.equivalent import chain_model, physical_guess
from morphcore.simulate.plan import flight_plan
from morphcore.simulate.schedule import ConstantRate, Hold
from morphdata.lattice import Lattice
from tests.models.chains import aircraft_of, flight_of
from tests.simulate.flights import fly, fly_trimmed, steps
from tests.simulate.tailed_aircraft import FLIGHT, document

COARSE = Lattice(chordwise=2, spanwise=8)
ELEVATOR = {"name": "elevator", "from": 0.0, "to": 1.0, "chord_fraction": 0.4}


def with_elevator() -> dict[str, Any]:
    """The aircraft with a fixed tail that has an elevator on both sides."""
    changed = document()
    for surface in changed["surfaces"][2:]:
        surface["position_m"] = surface.pop("hinge")["position_m"]
        surface["controls"] = [ELEVATOR]
    return changed


def flown(kind: str, name: str | None, schedules: Any = None) -> Any:
    """A tenth of a second in one kind of model."""
    aircraft, flight = aircraft_of(with_elevator()), flight_of(FLIGHT | {"trim_drive": name})
    model: Any = physical_guess(chain_model(aircraft, flight, 3, COARSE)) if kind == "equivalent" else kind
    options = {"duration_s": 0.1, "lattice": COARSE, "elements": 4}
    return fly(aircraft, flight, schedules or {}, model=model, **options)


@pytest.mark.parametrize(("kind", "left"), [("rigid", 1e-8), ("flexible", 1e-8), ("equivalent", 0.03)])
def test_the_elevator_balances_the_moment(kind: str, left: float) -> None:
    """Nothing of the moment is left, trim holds, and a history moves the elevator from where it is."""
    without, found = flown(kind, None), flown(kind, "elevator")
    assert abs(found.trim.moment_B[0, 1]) < left * abs(without.trim.moment_B[0, 1])
    assert set(found.trim_drives) == {"elevator_right", "elevator_left"}
    angle = found.trim_drives["elevator_left"]
    assert 0.005 < abs(angle) < 0.2
    np.testing.assert_array_equal(found.trajectory.drives["elevator_left"], angle)
    assert np.abs(found.trajectory.euler - found.trajectory.euler[0]).max() < 1e-6
    moved = flown(kind, "elevator", {"elevator": ConstantRate(0.1, 0.05, 0.05, ramp_s=0.02)})
    history = moved.trajectory.drives["elevator_right"]
    np.testing.assert_allclose(history[[0, -1]], [angle, angle - 0.05], atol=1e-8)
    assert np.ptp(moved.trajectory.euler[:, 1]) > 1e-3


def test_half_an_aircraft_trims_like_the_whole() -> None:
    """Within 1e-9 rad, wings sweeping."""
    model = chain_model(
        aircraft_of(with_elevator()), flight_of(FLIGHT | {"trim_drive": "elevator"}), 2, COARSE
    )
    schedules = [ConstantRate(0.0, 0.3, 0.3), ConstantRate(0.0, 0.3, 0.3), Hold(), Hold()]
    answers = []
    for may_halve in (False, True):
        plan = flight_plan(model, schedules, steps(0.4, 0.005), may_halve=may_halve)
        assert plan.halved is may_halve
        answers.append(fly_trimmed(plan.flown(model), plan, physical_guess(model)).euler)
    np.testing.assert_allclose(answers[1], answers[0], rtol=0.0, atol=1e-9)


def test_a_fin_does_not_disturb_the_symmetry() -> None:
    """A symmetric aircraft with a fin is flown whole; its elevator moves neither roll nor yaw."""
    fin = {
        **with_elevator()["surfaces"][2],
        "name": "fin",
        "dihedral_rad": 0.5 * np.pi,
        "span_m": 0.3,
        "position_m": [-1.0, 0.0, -0.3],
    }
    del fin["controls"]
    document = with_elevator()
    document["surfaces"].append(fin)
    aircraft, flight = aircraft_of(document), flight_of(FLIGHT | {"trim_drive": "elevator"})
    for model in ("rigid", "flexible"):
        moved = {"elevator": ConstantRate(0.1, 0.05, 0.05, ramp_s=0.02)}
        found = fly(aircraft, flight, moved, model=model, duration_s=0.2, lattice=COARSE, elements=4)
        assert np.ptp(found.trajectory.euler[:, 1]) > 1e-3
        assert np.abs(found.trajectory.euler[:, [0, 2]]).max() < 1e-9
