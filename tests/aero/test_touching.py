"""Right and left wings that touch at their roots and stand or deflect differently."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from morphcore.geometry.aircraft import Aircraft
from morphcore.models.equivalent import chain_model
from morphdata.lattice import Lattice, VortexCore
from tests.aero.controlled import AILERON, beam_loads, chain_loads, tailed
from tests.aero.link_loads import edge_loads
from tests.aero.shaped import aircraft, pair
from tests.aero.test_shapes import FLIGHT, of_links, on_fuselage, velocity

ROLL = 0  # row of moment and force in B


def turned(angles: tuple[float, float], **more: Any) -> Aircraft:
    """A wing of two touching halves at their own incidences, rad."""
    wings = pair("wing", 1.5, (0.3, 0.3), **more)
    for wing, angle in zip(wings, angles, strict=True):
        wing["incidence_rad"] = angle
    return aircraft(*wings)


@pytest.mark.parametrize("angles", [(0.03, -0.03), (0.05, 0.0), (0.1, -0.05)])
@pytest.mark.parametrize("alpha", [0.05, 0.15])
@pytest.mark.parametrize(
    "more", [{}, {"sweep_rad": 0.4}, {"dihedral_rad": 0.1}], ids=["straight", "swept", "v"]
)
def test_roll_of_unlike_incidences(angles: tuple[float, float], alpha: float, more: dict[str, Any]) -> None:
    """The rolling moment is that of all edges of the lattice, within 0.05 per cent (required: 0.5).

    The root edges attract each other by some per cent of the lift. They do so with equal and opposite forces
    at the root: at the centres of the first strips these would roll the aircraft, by up to 12 per cent.
    """
    shape = turned(angles, **more)
    twist = np.concatenate([np.zeros(3), velocity(alpha, 0.0)])
    _, found = on_fuselage(shape, of_links(shape, twist))
    _, expected = on_fuselage(shape, edge_loads(chain_model(shape, FLIGHT, 1), np.zeros(0), twist))
    assert found[ROLL] == pytest.approx(expected[ROLL], rel=5e-4)


def ailerons_to_the_root() -> dict[str, Any]:
    """The tailed aircraft, with ailerons over the whole span."""
    document = tailed()
    for wing in document["surfaces"][::2]:
        wing["controls"] = [{**AILERON, "from": 0.0, "to": 1.0}]
    return document


@pytest.mark.parametrize("alpha", [0.05, 0.15])
@pytest.mark.parametrize("core", ["line", "smoothed"])
def test_roll_of_ailerons_to_the_root(alpha: float, core: str) -> None:
    """Rigid model and moving lattice of the flexible one agree on the roll of ailerons within 0.05 per cent.

    Required: 0.5. The wake leaves along the stream in both.
    """
    lattice, angles = Lattice(core=VortexCore(law=core)), {"aileron": 0.1}  # type: ignore[arg-type]
    document = ailerons_to_the_root()
    found = chain_loads(document, alpha, angles, lattice, wake_alpha=alpha)
    expected = beam_loads(document, alpha, angles, lattice)
    assert found[ROLL] == pytest.approx(expected[ROLL], rel=5e-4)
