"""Corrections are searched from flights that can tell them, unless a request says which."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from morphcore.identify import Identification, identify
from morphcore.identify.free_corrections import ASYMMETRIC_RAD, asymmetric
from morphcore.simulate.trajectory import Trajectory
from morphdata.identify import EquivalentModel, IdentifySearch
from tests.identify.flights import (
    example,
    reference_aircraft,
    reference_documents,
    reference_flight,
    shortened,
)

AERO_COEFFICIENTS = ("lift_factor", "ac_offset_m", "profile_drag", "lag_s")
WITHOUT_DRAG = tuple(name for name in AERO_COEFFICIENTS if name != "profile_drag")
LISTED = ("profile_drag", "lag_s")


def searched(*samples: Trajectory, corrections: tuple[str, ...] | None = None) -> tuple[str, ...]:
    """The corrections that an identification seeks."""
    model = EquivalentModel(links_per_wing=1, aero_coefficients=corrections)
    return Identification(reference_aircraft(), reference_flight(), samples, model).space.free_aero


@pytest.mark.parametrize(("role", "expected"), [("train", AERO_COEFFICIENTS), ("held_out", WITHOUT_DRAG)])
def test_drag_is_searched_where_an_asymmetric_flight_is_fitted(role: str, expected: tuple[str, ...]) -> None:
    """One such flight among those to fit is enough; one that is held out tells a fit nothing."""
    assert searched(example("rate_0.8"), example("asymmetric", role)) == expected


def test_drag_is_not_searched_from_symmetric_flights() -> None:
    """Whatever their number."""
    assert searched(*(example(f"rate_{rate}") for rate in ("0.2", "0.5", "0.8"))) == WITHOUT_DRAG


@pytest.mark.parametrize("name", ["rate_0.8", "asymmetric"])
def test_a_list_is_honoured(name: str) -> None:
    """What a request names is searched from any flight, and nothing else; none may be named at all."""
    assert searched(example(name), corrections=LISTED) == LISTED
    assert searched(example(name), corrections=()) == ()


@pytest.mark.parametrize("column", ["sweep_left", "sweep_right", "phi", "psi"])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_what_makes_a_flight_asymmetric(column: str, sign: float) -> None:
    """A difference of sweeps, or a roll or yaw, beyond the bound at a single time; its name says nothing."""
    flight = replace(example("rate_0.8"), name="asymmetric")
    assert not asymmetric(flight)
    for size, expected in ((0.9, False), (1.1, True)):
        moved = getattr(flight, column).copy()
        moved[moved.size // 2] += sign * size * ASYMMETRIC_RAD
        change = {column: moved}
        if column in flight.drives:
            change = {"drives": {**flight.drives, **change}}
        assert asymmetric(replace(flight, **change)) is expected


def test_a_heading_is_no_yaw() -> None:
    """A steady bank or heading, even one that jumps by a turn, is none of the aircraft's doing."""
    flight = example("rate_0.8")
    psi = np.where(np.arange(flight.psi.size) % 2, np.pi - 1e-3, -np.pi + 1e-3)
    assert not asymmetric(replace(flight, psi=psi, phi=flight.phi + 0.2))


def test_the_result_names_what_was_searched() -> None:
    """The corrections, and those left out have the values of the physical guess."""
    found = identify(
        *reference_documents(),
        [shortened(example("rate_0.8"), 40)],
        model=EquivalentModel(links_per_wing=1),
        search=IdentifySearch(generations=2),
    )
    document = found.to_document()
    assert document["search"]["aero_coefficients"] == [*WITHOUT_DRAG, "centre_shift_m"]  # its former name
    assert document["uncertainty"]["coordinates"] == list(WITHOUT_DRAG)
    assert document["model"]["aero"]["profile_drag"] == 0.01
