"""What drives move: hinges and control surfaces."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from morphdata.drives import ANGLE_TOLERANCE_RAD

Array = NDArray[np.float64]


class MovedPart:
    """The range of a hinge or a control, in rad; of a hinge that slides in m."""

    min_rad: float
    max_rad: float
    angle_rad: float

    @property
    def low(self) -> float:
        """Smallest angle or extension."""
        return self.min_rad

    @property
    def high(self) -> float:
        """Largest angle or extension."""
        return self.max_rad

    @property
    def held(self) -> float:
        """Angle or extension held if no history is given."""
        return self.angle_rad

    def beyond_range(self, angle_rad: Array) -> NDArray[np.int64]:
        """Rows of a history (k,) that are out of range."""
        low, high = self.min_rad - ANGLE_TOLERANCE_RAD, self.max_rad + ANGLE_TOLERANCE_RAD
        return np.flatnonzero((angle_rad < low) | (angle_rad > high))
