"""Sample flights: measured sweep and attitude over time, inline or by reference to an uploaded trajectory."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Discriminator, Field, Tag

from morphdata.base import AngleSeries, Document, Identifier, SampleName, TimeSeries
from morphdata.faults import Fault
from morphdata.samplefiles.fault import as_sentence
from morphdata.samplefiles.flight import INLINE, flight_faults

Role = Literal["train", "held_out"]
Weight = Annotated[float, Field(gt=0.0, le=1e6)]

EXAMPLE_SAMPLE: dict[str, Any] = {
    "name": "rate_0.5",
    "role": "train",
    "time_s": [0.0, 0.01, 0.02, 0.03],
    "sweep_left_rad": [0.0, 0.0, 0.001, 0.003],
    "sweep_right_rad": [0.0, 0.0, 0.001, 0.003],
    "phi_rad": [0.0, 0.0, 0.0, 0.0],
    "theta_rad": [0.0623, 0.0623, 0.0622, 0.0622],
    "psi_rad": [0.0, 0.0, 0.0, 0.0],
    "weight": 1.0,
}


class TrajectoryColumns(Document):
    """Columns of one flight, equally long; time rises, steps may be uneven."""

    time_s: TimeSeries
    sweep_left_rad: AngleSeries = Field(description="Hinge angle of the left surfaces, positive aft.")
    sweep_right_rad: AngleSeries = Field(description="Hinge angle of the right surfaces, positive aft.")
    phi_rad: AngleSeries = Field(description="Roll (z-y-x Euler angles, body FRD against earth NED).")
    theta_rad: AngleSeries = Field(description="Pitch.")
    psi_rad: AngleSeries = Field(description="Yaw.")

    def faults(self) -> Iterator[Fault]:
        """The columns are those of a flight."""
        named = {name: getattr(self, field) for name, field in INLINE.items()}
        for fault in flight_faults(named, INLINE):
            row = "" if fault.row is None else f"/{fault.row}"
            yield Fault(
                fault.code,
                as_sentence(fault.detail),
                f"/{INLINE[fault.title or 't']}{row}",
                as_sentence(fault.hint),
            )


class InlineSample(TrajectoryColumns):
    """A sample with its rows."""

    model_config = ConfigDict(json_schema_extra={"examples": [EXAMPLE_SAMPLE]})

    name: SampleName
    role: Role = Field(
        default="train", description="`held_out` samples are flown and reported, never fitted."
    )
    weight: Weight = 1.0


class UploadedSample(Document):
    """A sample whose rows were uploaded with POST /trajectories."""

    trajectory_id: Identifier
    name: SampleName | None = Field(default=None, description="The trajectory's own name when left out.")
    role: Role = Field(
        default="train", description="`held_out` samples are flown and reported, never fitted."
    )
    weight: Weight = 1.0


def _form(value: Any) -> str:
    reference = "trajectory_id" in value if isinstance(value, dict) else isinstance(value, UploadedSample)
    return "uploaded" if reference else "inline"


Sample = Annotated[
    Annotated[InlineSample, Tag("inline")] | Annotated[UploadedSample, Tag("uploaded")],
    Discriminator(_form),
]
