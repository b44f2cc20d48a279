"""What the next generation of a swarm must fly, in parts that any process may fly on its own."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from morphcore.lanes import TOGETHER

Array = NDArray[np.float64]


@dataclass(frozen=True)
class GenerationTask:
    """The flights of one generation.

    generation : how many generations came before. points : (p, d) search points, in the order in which their
    costs are wanted.
    """

    generation: int
    points: Array

    def parts(self, most: int) -> list[Array]:
        """The points in at most so many parts of about one size, none of them empty.

        A part is whole blocks of lanes: so each model flies in the block, with the neighbours, that it has
        when one process flies them all. What a block's lanes share (the strips that any of them touches)
        could otherwise differ.
        """
        blocks = -(-self.points.shape[0] // TOGETHER)
        count = max(1, min(most, blocks))
        bounds = np.arange(count + 1) * blocks // count * TOGETHER
        return [self.points[low:high] for low, high in itertools.pairwise(bounds)]
