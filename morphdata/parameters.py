"""An equivalent model that is known already: its parameters outright, or the id of an identified model."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import ConfigDict, Discriminator, Field, Tag

from morphdata.base import Document, Identifier
from morphdata.lattice import OWN_OR_CHOSEN, FlightStepS, Lattice, Start, StepS
from morphdata.options import MODEL, Option

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


class Corrections(Document):
    """Aerodynamic corrections of an equivalent model."""

    lift_factor: Annotated[float, Field(gt=0.0, le=100.0)] = 1.0
    centre_shift_m: Annotated[float, Field(ge=-100.0, le=100.0)] = Field(
        default=0.0, description="Forward positive."
    )
    profile_drag: Annotated[float, Field(ge=0.0, le=10.0)]
    lag_s: Annotated[float, Field(ge=0.0, le=100.0)]


class Parameters(Document):
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
    lattice: Lattice | None = Field(default=None, description="With which the model was identified.")
    step_s: StepS | None = None
    start: Start | None = None


class WholeResult(Document):
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


def parameters_in(given: Parameters | WholeResult | None) -> Parameters | None:
    """Return the parameters themselves, also of a whole result."""
    return given.model if isinstance(given, WholeResult) else given


class KnownModel(Document):
    """An equivalent model by its parameters, or by the id of an identified one.

    Lattice, step and start are those it was identified with where they are left out.
    """

    parameters: Annotated[GivenParameters | None, Option("--parameters", MODEL)] = Field(
        default=None, description="The `model` of an identification's result, or the whole result."
    )
    model_id: Annotated[Identifier | None, Option("--model-id", MODEL)] = Field(
        default=None,
        description="Instead of `parameters`: an identified model, see GET /models.",
        examples=["model_01k0c3v9fh8x2m4n6p8q0r2s4t"],
    )
    lattice: Lattice | None = None
    step_s: FlightStepS | None = Field(default=None, description=OWN_OR_CHOSEN)
    start: Annotated[Start | None, Option("--start", MODEL)] = Field(
        default=None, description="Trim each model by itself, or start from `flight.start`."
    )

    @property
    def known(self) -> Parameters | None:
        """The parameters, also those of a whole result; None where only an id is given."""
        return parameters_in(self.parameters)

    @property
    def flown_lattice(self) -> Lattice | None:
        """The lattice to fly with: given here, else that of the identification."""
        return self.lattice or (self.known.lattice if self.known else None)

    @property
    def flown_step_s(self) -> float | None:
        """The longest time step to fly with, s: given here, else that of the identification."""
        return self.step_s or (self.known.step_s if self.known else None)

    @property
    def flown_start(self) -> Start | None:
        """Where to start: given here, else as the identification did."""
        return self.start or (self.known.start if self.known else None)
