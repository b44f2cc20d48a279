"""Cramer-Rao bounds in per cent: the inverse of the information matrix, carried over to the parameters."""

from __future__ import annotations

import numpy as np
import pytest

from morphcore.identify.cramer_rao import cramer_rao_percent
from morphcore.identify.parameters import search_space
from morphcore.identify.uncertainty import uncertainty
from morphcore.models.equivalent import chain_model
from tests.identify.flights import reference_aircraft, reference_flight

ROWS = 400


def test_bounds_are_those_of_the_information_matrix() -> None:
    """Of factors exp(x) the bound is that of x in per cent; of linear ones their unit over the value.

    The information is inverted here as a whole, there by its singular values.
    """
    space = search_space(chain_model(reference_aircraft(), reference_flight(), 2))
    random = np.random.default_rng(3)
    jacobian = random.normal(0.0, 1.0, (ROWS, space.dimension))
    residual = random.normal(0.0, 1e-3, ROWS)
    found = cramer_rao_percent(space, space.guess, uncertainty(space, space.guess, residual, jacobian))
    variance = float(residual @ residual) / (ROWS - space.dimension)
    spread = np.sqrt(variance * np.diag(np.linalg.inv(jacobian.T @ jacobian)))
    by_name = dict(zip(space.names, spread, strict=True))
    for name in ("stiffness_nm_rad.joint_1.flap", "damping_nms_rad.joint_1.torsion", "lag_s"):
        assert found[name] == pytest.approx(100.0 * by_name[name], rel=1e-4)
    unit = (
        float(
            space.flatten(space.decode(space.guess + np.eye(space.dimension)))[
                :, space.parameter_names.index("lift_factor")
            ].max()
        )
        - 1.0
    )
    assert found["lift_factor"] == pytest.approx(100.0 * unit * by_name["lift_factor"], rel=1e-4)


def test_what_the_samples_do_not_see_has_no_bound() -> None:
    """A column of zeros is a parameter without effect; a value of 0 has no per cent."""
    space = search_space(chain_model(reference_aircraft(), reference_flight(), 2))
    random = np.random.default_rng(4)
    jacobian = random.normal(0.0, 1.0, (ROWS, space.dimension))
    jacobian[:, space.names.index("lag_s")] = 0.0
    residual = random.normal(0.0, 1e-3, ROWS)
    found = cramer_rao_percent(space, space.guess, uncertainty(space, space.guess, residual, jacobian))
    assert found["lag_s"] is None
    assert found["ac_offset_m"] is None  # neutral: 0 m
    assert found["lift_factor"] is not None
