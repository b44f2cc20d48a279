"""Parameters as documents: there and back, and what is refused."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from morphcore.errors import InvalidInput
from morphcore.models.equivalent import ParameterBatch, chain_model, physical_guess
from morphcore.models.parameters_document import parameters_document, parameters_from_document
from tests.models.chains import example_aircraft, example_flight

DOCUMENT: dict[str, Any] = {
    "links_per_wing": 2,
    "division": [0.4, 0.6],
    "stiffness_nm_rad": [[5e4, 6e4, 4e5]],
    "damping_nms_rad": [[200.0, 250.0, 1800.0]],
    "aero": {"lift_factor": 1.1, "ac_offset_m": -0.002, "profile_drag": 0.012, "lag_s": 0.004},
}


def _random_batch(rng: np.random.Generator, links: int, wings: int) -> ParameterBatch:
    return ParameterBatch(
        {
            "division": rng.dirichlet(np.full(links, 5.0), size=(2, wings)),
            "stiffness_nm_rad": rng.uniform(1e3, 1e6, (2, wings, links - 1, 3)),
            "damping_nms_rad": rng.uniform(0.0, 1e3, (2, wings, links - 1, 3)),
            "lift_factor": rng.uniform(0.5, 2.0, 2),
            "ac_offset_m": rng.normal(0.0, 0.01, 2),
            "profile_drag": np.tile(rng.uniform(0.0, 0.1, (2, 1)), wings),
            "lag_s": rng.uniform(0.0, 0.01, 2),
        }
    )


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 8), st.integers(1, 3), st.integers(0, 1))
def test_documents_keep_every_digit(seed: int, links: int, wings: int, particle: int) -> None:
    """Batch -> JSON text -> batch is exact but for the division, which is made to add up to one again."""
    batch = _random_batch(np.random.default_rng(seed), links, wings)
    read = parameters_from_document(json.loads(json.dumps(parameters_document(batch, particle))))
    for name, value in batch.select(slice(particle, particle + 1)).values.items():
        np.testing.assert_allclose(read[name], value, rtol=1e-15, atol=0.0)


def test_a_whole_result_is_understood() -> None:
    """The model may stand inside its result."""
    read = parameters_from_document({"model": DOCUMENT, "fit": []})
    np.testing.assert_array_equal(read["damping_nms_rad"], [[DOCUMENT["damping_nms_rad"]]])
    rigid = chain_model(example_aircraft(), example_flight(), 1)
    assert parameters_from_document(parameters_document(physical_guess(rigid))).links == 1


@pytest.mark.parametrize(
    ("change", "pointer"),
    [
        ({"links_per_wing": None}, "/model/links_per_wing"),
        ({"links_per_wing": 17}, "/model/links_per_wing"),
        ({"links_per_wing": 3}, "/model/division"),
        ({"division": [0.4, 0.7]}, "/model/division"),
        ({"division": [-0.4, 1.4]}, "/model/division/0"),
        ({"division": ["a", 1.0]}, "/model/division/0"),
        ({"stiffness_nm_rad": [[5e4, 6e4]]}, "/model/stiffness_nm_rad/0"),
        ({"stiffness_nm_rad": [[5e4, 6e4, -1.0]]}, "/model/stiffness_nm_rad/0/2"),
        ({"stiffness_nm_rad": [[5e4, 6e4, float("nan")]]}, "/model/stiffness_nm_rad/0/2"),
        ({"damping_nms_rad": 3.0}, "/model/damping_nms_rad"),
        ({"aero": None}, "/model/aero"),
        ({"aero": {"profile_drag": 0.01, "lag_s": -1.0}}, "/model/aero/lag_s"),
    ],
)
def test_refusals_name_the_field(change: dict[str, Any], pointer: str) -> None:
    """A document that is no model is refused with the field at fault."""
    with pytest.raises(InvalidInput) as caught:
        parameters_from_document({**DOCUMENT, **change})
    assert caught.value.pointer == pointer
