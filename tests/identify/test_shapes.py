"""Identification of an aircraft with swept wings of some dihedral, and a fin, from flights of its beams."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from morphcore.simulate.schedule import ConstantRate
from morphdata.lattice import Lattice
from tests.aero.shaped import aircraft
from tests.identify.test_zoo import LATTICE, identified
from tests.simulate.flights import fly
from tests.simulate.test_shapes import FIN, FLIGHT, wings


def test_links_of_a_shaped_aircraft_are_identified() -> None:
    """Two links fit an even and an uneven morph, flown by beams, with a hundredth of the rigid wings' J."""
    shape = aircraft(*wings(), FIN | {"flexible": False})
    slow, fast = ConstantRate(0.0, 0.3, 0.8, start_s=0.1), ConstantRate(0.0, 0.5, 0.8, start_s=0.1)
    samples = [
        replace(
            fly(
                shape, FLIGHT, {"sweep_left": fast, "sweep_right": right}, model="flexible", duration_s=0.9,
                step_s=0.0025, elements=6, lattice=Lattice.model_validate(LATTICE),
            ).trajectory,
            name=name,
        )
        for name, right in (("even", fast), ("uneven", slow))
    ]  # fmt: skip
    assert np.ptp(samples[1].phi) > 0.05
    result = identified(samples, shape, FLIGHT)
    for fit in result.fits:
        rigid, found = fit.J("rigid"), fit.J("identified")
        assert rigid is not None
        assert found is not None
        assert found < 0.01 * rigid
