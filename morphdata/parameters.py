"""A known equivalent model: its parameters, or the id of an identified model."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, Protocol

from pydantic import ConfigDict, Discriminator, Field, Tag, create_model, model_serializer

from morphdata.base import Document, Identifier
from morphdata.faults import Fault
from morphdata.identifiable import IDENTIFIABLE
from morphdata.lattice import OWN_OR_CHOSEN, FlightStepS, Lattice, Start, StepS
from morphdata.links import MAX_LINKS, MAX_WINGS, LinksPerWing, SurfaceKey, links_of
from morphdata.options import MODEL, Option
from morphdata.refusals import escaped

AXES = 3  # flap, torsion, edgewise
SUM_TOLERANCE = 1e-6  # tolerance of the division: documents may be rounded for printing
RAGGED = -1  # stands for the length of rows of different lengths

EXAMPLE_PARAMETERS: dict[str, Any] = {
    "links_per_wing": 2,
    "division": [0.42, 0.58],
    "stiffness_nm_rad": [[41000.0, 68000.0, 380000.0]],
    "damping_nms_rad": [[160.0, 270.0, 1500.0]],
    "aero": {"lift_factor": 1.06, "ac_offset_m": 0.002, "profile_drag": 0.011, "lag_s": 0.004},
}

Share = Annotated[float, Field(gt=0.0, le=1.0)]
Shares = Annotated[list[Share], Field(min_length=1, max_length=MAX_LINKS)]
Stiffness = Annotated[float, Field(ge=0.0, le=1e15)]
Unread = Annotated[Any, Field(default=None, exclude=True)]
Joint = Annotated[list[Stiffness], Field(min_length=AXES, max_length=AXES)]
Joints = Annotated[list[Joint], Field(max_length=MAX_LINKS - 1)]


if TYPE_CHECKING:
    Corrections = Document
else:  # type checkers cannot use fields from a list
    Corrections = create_model(
        "Corrections",
        __base__=Document,
        __doc__="Aerodynamic corrections of an equivalent model.",
        **{
            each.name: (
                each.value | None if each.own_default else each.value,
                Field(
                    default=... if each.default is None and not each.own_default else each.default,
                    description=each.value_description,
                ),
            )
            for each in IDENTIFIABLE
            if each.value is not None
        },
        **{
            f"{each.name}s": (
                dict[SurfaceKey, each.value] | None,
                Field(default=None, max_length=MAX_WINGS, description=each.apart_description),
            )
            for each in IDENTIFIABLE
            if each.apart_description
        },
    )


class SurfaceParameters(Document):
    """Parameters of one flexible surface."""

    division: Shares
    stiffness_nm_rad: Joints
    damping_nms_rad: Joints
    profile_drag: Annotated[float, Field(ge=0.0, le=10.0)]
    zero_lift_rad: Annotated[float, Field(ge=-0.35, le=0.35)] | None = Field(
        default=None, description="Left out: the aircraft's, which is for all surfaces or none."
    )
    cm0: Annotated[float, Field(ge=-0.5, le=0.5)] | None = Field(default=None, description="The same.")


class MirroredParameters(Document):
    """A surface with the parameters of its mirror image."""

    mirror_of: str = Field(description="Name of the surface whose parameters are used.")


def _whose(value: Any) -> str:
    mirrored = "mirror_of" in value if isinstance(value, dict) else isinstance(value, MirroredParameters)
    return "mirrored" if mirrored else "own"


OwnOrMirrored = Annotated[
    Annotated[SurfaceParameters, Tag("own")] | Annotated[MirroredParameters, Tag("mirrored")],
    Discriminator(_whose),
]


class Parameters(Document):
    """The `model` of an identification's result, unchanged."""

    model_config = ConfigDict(json_schema_extra={"examples": [EXAMPLE_PARAMETERS]})

    links_per_wing: LinksPerWing = Field(description="Of all flexible surfaces, or of each by name.")
    separate_wings: bool = False
    division: Shares | Annotated[list[Shares], Field(min_length=1, max_length=MAX_WINGS)] = Field(
        description="Share of the span of each link; one list per wing if wings are separate."
    )
    stiffness_nm_rad: Joints | Annotated[list[Joints], Field(max_length=MAX_WINGS)] = Field(
        description="Per joint [flap, torsion, edgewise]; one list per wing if wings are separate."
    )
    damping_nms_rad: Joints | Annotated[list[Joints], Field(max_length=MAX_WINGS)] = Field(
        description="The same of the dampings."
    )
    aero: Corrections
    surfaces: dict[str, OwnOrMirrored] | None = Field(
        default=None,
        min_length=1,
        max_length=MAX_WINGS,
        description="For an aircraft whose flexible surfaces are not one mirror pair: by name, each one's "
        "own parameters. `division`, `stiffness_nm_rad`, `damping_nms_rad` and `aero.profile_drag` are then "
        "those of the largest. Without it these are taken for the largest, and the others are as far from "
        "their own beam theory.",
    )
    lattice: Lattice | None = Field(default=None, description="With which the model was identified.")
    step_s: StepS | None = None
    start: Start | None = None

    @property
    def divisions(self) -> list[list[float]]:
        """One list of shares per wing, or one for all."""
        return _rows(self.division)

    def faults(self) -> Iterator[Fault]:
        """Check that the lists match the number of links and the shares add up to the whole span."""
        surfaces = self.surfaces or {}
        links, faults = self._links_of_surfaces()
        yield from faults
        if faults:
            return
        flat = self.links_per_wing if isinstance(self.links_per_wing, int) else len(self.divisions[0])
        yield from _structure_faults(self, flat)
        yield from _own_default_faults(self.aero, surfaces)
        for name, own in surfaces.items():
            at = f"/surfaces/{escaped(name)}"
            if isinstance(own, SurfaceParameters):
                yield from (fault.under(at) for fault in _structure_faults(own, links[name]))
            elif isinstance(surfaces.get(own.mirror_of, own), MirroredParameters):
                yield Fault(
                    "mirrors_nothing",
                    f"{name!r} mirrors {own.mirror_of!r}, which has no parameters.",
                    f"{at}/mirror_of",
                    "Name a surface with its own parameters.",
                )

    def _links_of_surfaces(self) -> tuple[dict[str, int], list[Fault]]:
        """Return the links of each of `surfaces`, and what is wrong with `links_per_wing`."""
        surfaces = self.surfaces or {}
        if not (surfaces or isinstance(self.links_per_wing, int)):
            hint = "Give one number, or the model of an identification's result unchanged."
            said = "links_per_wing is by surface, but the model has no surfaces."
            return {}, [Fault("missing", said, "/surfaces", hint)]
        names = list(surfaces)
        groups: dict[str, list[int]] = {}
        for k, (name, own) in enumerate(surfaces.items()):
            groups.setdefault(own.mirror_of if isinstance(own, MirroredParameters) else name, []).append(k)
        bent = [True] * len(names)
        counts, faults = links_of(self.links_per_wing, names, bent, [*groups.values()], "/links_per_wing")
        return dict(zip(names, counts, strict=True)), faults


def _own_default_faults(aero: Document, surfaces: Mapping[str, Document]) -> Iterator[Fault]:
    """Check that what a surface may leave to the aircraft is given for all surfaces, or for none."""
    for each in IDENTIFIABLE:
        if not (each.own_default and each.name in SurfaceParameters.model_fields):
            continue
        of = {
            name: getattr(own, each.name)
            for name, own in surfaces.items()
            if isinstance(own, SurfaceParameters)
        }
        lacking = [name for name, value in of.items() if value is None]
        if lacking and (len(lacking) < len(of) or getattr(aero, each.name) is not None):
            yield Fault(
                "missing",
                f"{each.name} is given, but not for {lacking[0]!r}.",
                f"/surfaces/{escaped(lacking[0])}/{each.name}",
                f"Give {each.name} for each surface with its own parameters, or nowhere.",
            )


def _rows(division: list[float] | list[list[float]]) -> list[list[float]]:
    shared = [share for share in division if isinstance(share, float)]
    return [shared] if shared else [row for row in division if isinstance(row, list)]


def _structure_faults(own: Parameters | SurfaceParameters, links: int) -> Iterator[Fault]:
    rows = _rows(own.division)
    shapes: dict[str, tuple[int, ...]] = {
        "division": (len(rows), links),
        "stiffness_nm_rad": (len(rows), links - 1, AXES),
        "damping_nms_rad": (len(rows), links - 1, AXES),
    }
    for name, shape in shapes.items():
        allowed = {shape, shape[1:]} if len(rows) == 1 else {shape}
        if links == 1:  # no joints: [] and one [] per wing are equivalent
            allowed |= {(0,), (len(rows), 0)}
        if _shape(getattr(own, name)) not in allowed:
            wanted = " x ".join(str(number) for number in (shape if len(rows) > 1 else shape[1:]))
            yield Fault(
                "wrong_shape",
                f"{name} must have {wanted} numbers for {links} links per wing.",
                f"/{name}",
                "Give the model of an identification's result unchanged.",
            )
    for shares in rows:
        if abs(sum(shares) - 1.0) > SUM_TOLERANCE:
            yield Fault(
                "division_not_whole",
                f"The shares of the span add up to {sum(shares):g}.",
                "/division",
                "They must add up to 1.",
            )
            break


def _shape(values: list[Any]) -> tuple[int, ...]:
    """Shape of nested lists; `RAGGED` if rows differ in length."""
    shape: tuple[int, ...] = (len(values),)
    level = values
    while level and isinstance(level[0], list):
        lengths = {len(row) for row in level}
        if len(lengths) > 1:
            return (*shape, RAGGED)
        shape = (*shape, lengths.pop())
        level = [item for row in level for item in row]
    return shape


def has_flown(fit: Any) -> bool:
    """Whether a model flies all fitted samples, judged by the fits of a result: otherwise J is null."""
    rows = [row for row in fit if isinstance(row, dict)] if isinstance(fit, list) else []
    return not any(row.get("role") == "train" and row.get("J_identified", 0.0) is None for row in rows)


class WholeResult(Document):
    """A whole result of an identification, or an exported model; only its `model` is used."""

    model: Parameters
    fit: Unread = None
    uncertainty: Unread = None
    verdict: Unread = None
    measurement: Unread = None
    search: Unread = None
    cost: Unread = None
    partial: Unread = None
    warnings: Unread = None
    # of the export format `json`, `morphdata.export.ModelFile`
    aircraft: Unread = None
    flight: Unread = None
    origin: Unread = None
    notice: Unread = None
    morphid_version: Unread = None

    @model_serializer
    def _only_the_model(self) -> Parameters:
        return self.model

    def faults(self) -> Iterator[Fault]:
        """Check that the model flies the samples that it was fitted to."""
        if not has_flown(self.fit):
            yield Fault(
                "never_flown",
                "The result contains no model that flies the samples it was fitted to.",
                "/model",
                "Its warnings say why; give the result of an identification that succeeded.",
            )


def _form(value: Any) -> str:
    whole = "model" in value if isinstance(value, dict) else isinstance(value, WholeResult)
    return "whole" if whole else "model"


GivenParameters = Annotated[
    Annotated[Parameters, Tag("model")] | Annotated[WholeResult, Tag("whole")], Discriminator(_form)
]


def parameters_in(given: Parameters | WholeResult | None) -> Parameters | None:
    """Return the parameters themselves, also from a whole result."""
    return given.model if isinstance(given, WholeResult) else given


class KnownModel(Document):
    """An equivalent model, given by its parameters or by the id of an identified one.

    Lattice, step and start default to those of its identification.
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
        """The parameters, if the document contains them."""
        return parameters_in(self.parameters)

    def faults(self) -> Iterator[Fault]:
        """Check that the model is given exactly once."""
        if self.parameters is not None and self.model_id is not None:
            yield Fault(
                "given_twice",
                "parameters and model_id are both given.",
                "/model_id",
                "Leave one of them out.",
            )
        elif self.parameters is None and self.model_id is None:
            yield Fault(
                "missing",
                "An equivalent model needs parameters.",
                "/parameters",
                "Give the model of an identification's result, or the model_id of an identified one.",
            )


class FliesWith(Protocol):
    """A model that may contain flight settings."""

    @property
    def lattice(self) -> Lattice | None:
        """Of every surface."""

    @property
    def step_s(self) -> float | None:
        """Longest time step, s."""

    @property
    def start(self) -> Start | None:
        """Of the flight."""


@dataclass(frozen=True, slots=True)
class FlownWith:
    """Flight settings of a model.

    Attributes
    ----------
    lattice : Lattice
    step_s : float or None
        Longest time step, s; None for the flight's own choice.
    start : Start
    """

    lattice: Lattice
    step_s: float | None
    start: Start


def flown_with(model: FliesWith) -> FlownWith:
    """Return how a model is flown: as it says, else as it was identified, else as all are."""
    identified = model.known if isinstance(model, KnownModel) else None
    said = [each for each in (model, identified) if each is not None]

    def first(name: str) -> Any:
        return next((value for each in said if (value := getattr(each, name)) is not None), None)

    return FlownWith(first("lattice") or Lattice(), first("step_s"), first("start") or "trim")
