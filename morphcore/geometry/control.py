"""Trailing-edge control surfaces in the form used by the numerics."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from morphcore.geometry.moved_part import MovedPart
from morphdata import controls as documents
from morphdata.drives import Unit

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Control(MovedPart):
    """A trailing-edge control of prescribed deflection; mirror images are equal, whatever their drives.

    Attributes
    ----------
    drive : str
        Name of the drive that moves it.
    start, stop : float
        Ends along the span, shares of it from the root.
    chord_fraction : float
        Chord behind the hinge line, share of the chord.
    min_rad, max_rad : float
        Range of its drive's angle.
    angle_rad : float
        Angle held if no history is given.
    sign : float
        +1 if a positive angle moves the trailing edge down, else -1.
    """

    drive: str = field(compare=False)
    start: float
    stop: float
    chord_fraction: float
    min_rad: float
    max_rad: float
    angle_rad: float = field(compare=False)
    sign: float = field(compare=False)

    @classmethod
    def of(cls, document: documents.Control, side: str, drive: str) -> Control:
        """Return the control that a document describes, for a surface on a given side."""
        return cls(
            drive=drive,
            start=document.start,
            stop=document.stop,
            chord_fraction=document.chord_fraction,
            min_rad=document.min_rad,
            max_rad=document.max_rad,
            angle_rad=document.angle_rad,
            sign=document.sign(side),
        )

    @property
    def unit(self) -> Unit:
        """Of its history."""
        return "rad"
