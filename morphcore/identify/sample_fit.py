"""How the rigid, the guessed and the identified model fly along one sample."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from morphcore.frames import wrap_angle
from morphcore.identify.cost import SampleCase
from morphcore.identify.statistics import ChannelStatistics, channel_statistics
from morphcore.shown import Shown
from morphdata.measurement import ANGLES

Array = NDArray[np.float64]


@dataclass(frozen=True, repr=False)
class SampleFit(Shown):
    """Attitudes (k, 3) flown against one sample by the rigid, the guessed and the identified model, rad."""

    case: SampleCase
    rigid: Array
    initial: Array
    identified: Array

    def J(self, model: str) -> float | None:
        """The sample's part of J for a model, rad^2; None where its flight diverged."""
        return _number(np.sum((self.errors(model) * self.case.weight) ** 2))

    def errors(self, model: str) -> Array:
        """(k, 3) wrapped angle differences, rad."""
        return wrap_angle(getattr(self, model) - self.case.sample.euler)

    def error_share(self, model: str = "identified") -> float:
        """Error of a model as a part of the motion, both rms, without white noise; inf if it diverged.

        White noise is what neighbouring rows do not share: the mean product of neighbours is free of it.
        """
        errors, motion = self.errors(model), self.case.motion
        if not np.all(np.isfinite(errors)):
            return float("inf")
        structured = float(np.sum(errors[1:] * errors[:-1])) / (errors.shape[0] - 1)
        size = float(np.sum(motion**2)) / motion.shape[0]
        return float(np.sqrt(max(structured, 0.0) / size)) if size > 0.0 else float("inf")

    def ending(self, model: str) -> str:
        """How a model's flight failed, as words; "" where it reached its end."""
        known = np.all(np.isfinite(getattr(self, model)), axis=1)
        if known.all():
            return ""
        time_s = self.case.sample.time_s
        return f"diverged at t = {time_s[np.argmin(known)]:.2f} s" if known[0] else "could not be trimmed"

    def statistics(self) -> dict[str, ChannelStatistics]:
        """Statistics of the identified model's errors, by angle."""
        sample = self.case.sample
        measured = np.unwrap(sample.euler, axis=0)
        modelled = measured + self.errors("identified")
        return {
            angle: channel_statistics(sample.time_s, measured[:, k], modelled[:, k], sample.drives)
            for k, angle in enumerate(ANGLES)
        }

    def to_document(self) -> dict[str, Any]:
        """JSON form with the names that the API fixes, and the rigid model's errors beside."""

        def per_angle(values: Array) -> dict[str, float | None]:
            return {angle: _number(value) for angle, value in zip(ANGLES, values, strict=True)}

        identified, rigid = self.errors("identified"), self.errors("rigid")
        return {
            "sample": self.case.sample.name,
            "role": self.case.sample.role,
            "J_rigid": self.J("rigid"),
            "J_initial": self.J("initial"),
            "J_identified": self.J("identified"),
            "rms_rad": per_angle(np.sqrt(np.mean(identified**2, axis=0))),
            "max_abs_rad": per_angle(np.abs(identified).max(axis=0)),
            "rms_rigid_rad": per_angle(np.sqrt(np.mean(rigid**2, axis=0))),
            "range_rad": per_angle(np.ptp(self.case.sample.euler, axis=0)),
            "statistics": {angle: found.to_document() for angle, found in self.statistics().items()},
        }

    def to_curves(self) -> dict[str, Any]:
        """Time histories for plots and tables."""
        sample = self.case.sample

        def angles(values: Array) -> dict[str, list[float | None]]:
            return {
                f"{name}_rad": [_number(v) for v in column]
                for name, column in zip(ANGLES, values.T, strict=True)
            }

        return {
            "name": sample.name,
            "role": sample.role,
            "time_s": sample.time_s.tolist(),
            "sweep_left_rad": sample.sweep_left.tolist(),
            "sweep_right_rad": sample.sweep_right.tolist(),
            **{sample.field_of(name): sample.drives[name].tolist() for name in sample.drive_order},
            "drives": list(sample.drive_order),
            "measured": angles(sample.euler),
            "rigid": angles(self.rigid),
            "initial": angles(self.initial),
            "identified": angles(self.identified),
        }


def _number(value: Any) -> float | None:
    number = float(value)
    return number if np.isfinite(number) else None
