"""Samples of aircraft with several drives: each follows its own column, the others hold."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from morphcore.errors import InvalidInput
from morphcore.identify.cost import costs, sample_cases, sample_schedules
from morphcore.identify.free_corrections import asymmetric
from morphcore.models.equivalent import chain_model, physical_guess
from morphcore.simulate.schedule import ConstantRate
from morphcore.simulate.trajectory import Trajectory
from morphdata.lattice import Lattice
from tests.models.chains import example_flight
from tests.models.many_hinges import FOLD, SWEEP, hinged_wings
from tests.simulate.flights import fly

COARSE = Lattice(chordwise=2, spanwise=6)
AIRCRAFT = hinged_wings({**SWEEP, "angle_rad": 0.1}, FOLD)
MODEL = chain_model(AIRCRAFT, example_flight(), 2, COARSE)


def flown(**schedules: ConstantRate) -> Trajectory:
    """A flight with the first guess, as a sample."""
    return fly(
        AIRCRAFT, example_flight(), schedules, model=physical_guess(MODEL), duration_s=0.5, step_s=0.005,
        lattice=COARSE,
    ).trajectory  # fmt: skip


def test_a_flight_of_all_drives_is_met_by_its_own_model() -> None:
    """Errors of the parameters that flew along it are nothing; with the fold left out they are not."""
    drives = flown(sweep=ConstantRate(0.1, 0.4, 0.4), fold_left=ConstantRate(0.0, 0.3, 0.3))
    sample = fly(
        AIRCRAFT, example_flight(), drives, model=physical_guess(MODEL), step_s=0.005, lattice=COARSE
    ).trajectory
    sample = replace(sample, drives=drives.drives)
    assert list(sample.drives) == ["sweep_right", "fold_right", "sweep_left", "fold_left"]
    assert sample.drive_order == ("sweep_left", "sweep_right", "fold_left", "fold_right")
    unfolded = {name: values for name, values in sample.drives.items() if not name.startswith("fold")}
    found = [
        costs(MODEL, physical_guess(MODEL), sample_cases(MODEL, [each], 0.005), "trim")[0]
        for each in (sample, replace(sample, drives=unfolded))
    ]
    assert found[0] < 1e-15
    assert found[1] > 1e-4
    assert asymmetric(sample)


def test_what_is_not_measured_holds() -> None:
    """A sample of the fold alone keeps the sweep at its angle; other columns bear names by chance."""
    sample = flown(fold=ConstantRate(0.0, 0.3, 0.3))
    alone = replace(
        sample, drives={"fold": sample.drives["fold_left"]}, extra={"p": np.zeros(sample.time_s.size)}
    )
    angles = [schedule.motion([0.0, 0.5]).angle for schedule in sample_schedules(AIRCRAFT, alone, "")]
    np.testing.assert_allclose(angles, [[0.1, 0.1], [0.0, 0.3], [0.1, 0.1], [0.0, 0.3]], atol=1e-12)
    assert not asymmetric(alone)


def test_columns_of_a_file_that_are_no_drives_are_left_alone() -> None:
    """A file has columns of all kinds; those of drives are followed."""
    sample = flown(fold=ConstantRate(0.0, 0.3, 0.3))
    filed = replace(sample, drives=dict(sample.drives) | {"q": sample.phi}, of_file=True)
    plain, moved = (sample_schedules(AIRCRAFT, each, "") for each in (sample, filed))
    for one, other in zip(plain, moved, strict=True):
        np.testing.assert_array_equal(one.motion([0.2]).angle, other.motion([0.2]).angle)


@pytest.mark.parametrize(
    ("drives", "pointer"),
    [
        ({"swep": 0.0}, "/samples/0/swep_rad"),
        ({"fold": 0.0, "fold_left": 0.1}, "/samples/0/fold_left_rad"),
        ({}, "/samples/0"),
        ({"fold": 2.0}, "/samples/0/fold_rad/0"),
    ],
)
def test_samples_that_move_the_wrong_thing_are_refused(drives: dict[str, float], pointer: str) -> None:
    """No such drive, one moved twice, none moved, beyond the range: never silently held."""
    sample = flown(fold=ConstantRate(0.0, 0.3, 0.3))
    columns = {name: np.full(sample.time_s.size, angle) for name, angle in drives.items()}
    with pytest.raises(InvalidInput) as caught:
        sample_schedules(AIRCRAFT, replace(sample, drives=columns, extra={}), "/samples/0")
    assert caught.value.pointer == pointer
    assert caught.value.hint
