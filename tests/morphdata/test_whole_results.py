"""A whole result stands for its model wherever parameters are wanted."""

from __future__ import annotations

import pytest

from morphcore.errors import InvalidInput
from morphdata.identified import IdentifyResult
from morphdata.parameters import EXAMPLE_PARAMETERS, WholeResult
from morphdata.simulate import EXAMPLE_SIMULATION, SimulateRequest


def test_every_part_of_a_result_may_stay_in_it() -> None:
    """Whatever an identification results in is accepted next to its model: no file has to be cut."""
    assert set(IdentifyResult.model_fields) <= set(WholeResult.model_fields)


@pytest.mark.parametrize("part", sorted(set(IdentifyResult.model_fields) - {"model", "fit"}))
def test_parts_are_not_read(part: str) -> None:
    """What stands there changes nothing, and an unknown part is refused."""
    model = {"kind": "equivalent", "parameters": {"model": EXAMPLE_PARAMETERS, part: {"any": ["thing"]}}}
    request = SimulateRequest.parse({**EXAMPLE_SIMULATION, "model": model})
    plain = SimulateRequest.parse(
        {**EXAMPLE_SIMULATION, "model": {**model, "parameters": EXAMPLE_PARAMETERS}}
    )
    assert request.model.known == plain.model.known  # type: ignore[union-attr]
    with pytest.raises(InvalidInput):
        WholeResult.parse({"model": EXAMPLE_PARAMETERS, "no_part": 1})
