"""Laws of compiled kernels."""

from __future__ import annotations

import numpy as np
import pytest

from morphcore.jit import WithoutDoor, entry_kernel, kernel
from tests.kernels import door


@kernel
def _doubled(values):
    for i in range(values.size):
        values[i] *= 2.0


@entry_kernel
def _four_times(values):
    _doubled(values)
    _doubled(values)


def test_kernels_without_doors_refuse_python_and_serve_kernels() -> None:
    """Called from Python they say so, before and after they were compiled, instead of ending the process."""
    values = np.ones(3)
    if isinstance(_doubled, WithoutDoor):  # not with compilation switched off
        with pytest.raises(TypeError, match="_doubled is called by kernels only"):
            _doubled(values)
    _four_times(values)
    np.testing.assert_array_equal(values, 4.0)
    if isinstance(_doubled, WithoutDoor):
        with pytest.raises(TypeError, match="kernels only"):
            _doubled(values)
    door(_doubled)(values)
    np.testing.assert_array_equal(values, 8.0)
