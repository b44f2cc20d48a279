"""Which aerodynamic corrections flights can tell: those that are searched if a request names none."""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from morphcore.models.parameters import Parameter
from morphcore.simulate.trajectory import Trajectory
from morphdata.drives import SIDES

Array = NDArray[np.float64]

# 0.6 degrees: above what the noise of an attitude sensor makes of a symmetric flight, and far below what a
# flight shows that can tell a drag
ASYMMETRIC_RAD = 0.01


def asymmetric(sample: Trajectory) -> bool:
    """Whether drives of both sides differ, or the flight rolls or yaws, by more than ASYMMETRIC_RAD."""
    apart = max((_apart(sample.drives, name) for name in sample.drives), default=0.0)
    turned = np.ptp(np.unwrap(np.stack([sample.phi, sample.psi]), axis=1), axis=1).max()
    return bool(max(apart, turned) > ASYMMETRIC_RAD)


def _apart(drives: Mapping[str, Array], name: str) -> float:
    """Largest difference of a drive to that of the other side, rad; to rest where that is not moved."""
    for side, other in (SIDES, SIDES[::-1]):
        if name.endswith(f"_{side}"):
            rest = np.full_like(drives[name], drives[name][0])
            opposite = drives.get(f"{name.removesuffix(side)}{other}", rest)
            return float(np.abs(drives[name] - opposite).max())
    return 0.0  # a word moves both sides


def determined_corrections(
    parameters: Sequence[Parameter], training: Sequence[Trajectory], bounded: Container[str] = ()
) -> tuple[str, ...]:
    """The corrections among a model's parameters that the flights to fit can tell.

    Those that are searched on request are among them if the request gives their bounds.
    """
    uneven = any(asymmetric(sample) for sample in training)
    return tuple(
        each.name
        for each in parameters
        if each.correction
        and (uneven or not each.asymmetric)
        and (each.name in bounded or not each.on_request)
    )
