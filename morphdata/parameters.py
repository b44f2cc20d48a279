"""An equivalent model that is known already: its parameters outright, or the id of an identified model."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import ConfigDict, Discriminator, Field, Tag

from morphdata.fields import Identifier, Strict
from morphdata.lattice import OWN_OR_CHOSEN, FlightStepS, Lattice, Start, StepS

MAX_LINKS = 8
MAX_WINGS = 16
AXES = 3  # flap, torsion, lag

EXAMPLE_PARAMETERS: dict[str, Any] = {
    "links_per_wing": 2,
    "division": [0.42, 0.58],
    "stiffness_nm_rad": [[41000.0, 68000.0, 380000.0]],
    "damping_nms_rad": [[160.0, 270.0, 1500.0]],
    "aero": {"lift_factor": 1.06, "centre_shift_m": 0.002, "profile_drag": 0.011, "lag_s": 0.004},
}

Share = Annotated[float, Field(gt=0.0, le=1.0)]
Shares = Annotated[list[Share], Field(min_length=1, max_length=MAX_LINKS)]
Stiffness = Annotated[float, Field(ge=0.0, le=1e15)]
Unread = Annotated[Any, Field(default=None, exclude=True)]
Joint = Annotated[list[Stiffness], Field(min_length=AXES, max_length=AXES)]
Joints = Annotated[list[Joint], Field(max_length=MAX_LINKS - 1)]


class Corrections(Strict):
    """Aerodynamic corrections of an equivalent model."""

    lift_factor: Annotated[float, Field(gt=0.0, le=100.0)] = 1.0
    centre_shift_m: Annotated[float, Field(ge=-100.0, le=100.0)] = Field(
        default=0.0, description="Forward positive."
    )
    profile_drag: Annotated[float, Field(ge=0.0, le=10.0)]
    lag_s: Annotated[float, Field(ge=0.0, le=100.0)]


class SurfaceParameters(Strict):
    """Parameters of one flexible surface."""

    division: Shares
    stiffness_nm_rad: Joints
    damping_nms_rad: Joints
    profile_drag: Annotated[float, Field(ge=0.0, le=10.0)]


class MirroredParameters(Strict):
    """A surface with the parameters of its mirror image."""

    mirror_of: str = Field(description="Name of the surface whose parameters they are.")


def _whose(value: Any) -> str:
    mirrored = "mirror_of" in value if isinstance(value, dict) else isinstance(value, MirroredParameters)
    return "mirrored" if mirrored else "own"


OwnOrMirrored = Annotated[
    Annotated[SurfaceParameters, Tag("own")] | Annotated[MirroredParameters, Tag("mirrored")],
    Discriminator(_whose),
]


class Parameters(Strict):
    """The `model` of an identification's result, as it stands there."""

    model_config = ConfigDict(json_schema_extra={"examples": [EXAMPLE_PARAMETERS]})

    links_per_wing: int = Field(ge=1, le=MAX_LINKS)
    separate_wings: bool = False
    division: Shares | Annotated[list[Shares], Field(min_length=1, max_length=MAX_WINGS)] = Field(
        description="Share of the span of each link; one list per wing where wings are separate."
    )
    stiffness_nm_rad: Joints | Annotated[list[Joints], Field(max_length=MAX_WINGS)] = Field(
        description="Per joint [flap, torsion, lag]; one list per wing where wings are separate."
    )
    damping_nms_rad: Joints | Annotated[list[Joints], Field(max_length=MAX_WINGS)] = Field(
        description="The same of the dampings."
    )
    aero: Corrections
    surfaces: dict[str, OwnOrMirrored] | None = Field(
        default=None,
        min_length=1,
        max_length=MAX_WINGS,
        description="Of an aircraft whose flexible surfaces are not one mirror pair: by name, each one's "
        "own parameters. `division`, `stiffness_nm_rad`, `damping_nms_rad` and `aero.profile_drag` are then "
        "those of the largest. Without it these are taken for the largest, and the others are as far from "
        "their own beam theory.",
    )
    lattice: Lattice | None = Field(default=None, description="With which the model was identified.")
    step_s: StepS | None = None
    start: Start | None = None


class WholeResult(Strict):
    """A whole result of an identification: only its `model` is looked at."""

    model: Parameters
    fit: Unread = None
    uncertainty: Unread = None
    search: Unread = None
    cost: Unread = None
    partial: Unread = None
    warnings: Unread = None


def _form(value: Any) -> str:
    whole = "model" in value if isinstance(value, dict) else isinstance(value, WholeResult)
    return "whole" if whole else "model"


GivenParameters = Annotated[
    Annotated[Parameters, Tag("model")] | Annotated[WholeResult, Tag("whole")], Discriminator(_form)
]


class KnownModel(Strict):
    """An equivalent model by its parameters, or by the id of an identified one.

    Lattice, step and start are those it was identified with where they are left out.
    """

    parameters: GivenParameters | None = Field(
        default=None, description="The `model` of an identification's result, or the whole result."
    )
    model_id: Identifier | None = Field(
        default=None,
        description="Instead of `parameters`: an identified model, see GET /models.",
        examples=["model_01k0c3v9fh8x2m4n6p8q0r2s4t"],
    )
    lattice: Lattice | None = None
    step_s: FlightStepS | None = Field(default=None, description=OWN_OR_CHOSEN)
    start: Start | None = None
