"""One of the schedules that are compared, flown in one of the models."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from morphcore.shown import Shown

Array = NDArray[np.float64]


@dataclass(frozen=True, repr=False)
class ComparedFlight(Shown):
    """One schedule flown in one model.

    departure : (k, 3) of phi, theta, psi from the start, rad. variation : its sum of squares, rad^2; None if
    the flight diverged. torque : largest of any hinge, N m; None where it was not computed.
    """

    departure: Array
    variation: float | None
    torque: float | None
