"""Which aerodynamic corrections flights can tell: those that are sought if a request names none."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from morphcore.models.parameters import Parameter
from morphcore.simulate.trajectory import Trajectory

# 0.6 degrees: above what the noise of an attitude sensor makes of a symmetric flight, and far below what a
# flight shows that can tell a drag
ASYMMETRIC_RAD = 0.01


def asymmetric(sample: Trajectory) -> bool:
    """Whether the sweeps of both sides differ, or the flight rolls or yaws, by more than ASYMMETRIC_RAD."""
    apart = np.abs(sample.sweep_left - sample.sweep_right).max()
    turned = np.ptp(np.unwrap(np.stack([sample.phi, sample.psi]), axis=1), axis=1).max()
    return bool(max(apart, turned) > ASYMMETRIC_RAD)


def corrections_told(parameters: Sequence[Parameter], training: Sequence[Trajectory]) -> tuple[str, ...]:
    """The corrections among a model's parameters that the flights to fit can tell."""
    uneven = any(asymmetric(sample) for sample in training)
    return tuple(each.name for each in parameters if each.correction and (uneven or not each.asymmetric))
