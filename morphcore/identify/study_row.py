"""What a study holds of one number of links: accuracy, cost and the identified model."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from morphcore.errors import NotFlyable
from morphcore.identify.identification import Identification
from morphcore.identify.result import IdentifyResult
from morphcore.models.equivalent import ParameterBatch
from morphcore.models.parameters_document import parameters_from_document
from morphcore.search.checkpoint import stored
from morphcore.shown import Shown
from morphdata.links import LinksPerWing, mean_links, shown_per_wing
from morphdata.measurement import ANGLES

Document = dict[str, Any]
Role = Literal["train", "held_out"]


@stored
@dataclass(frozen=True, repr=False)
class StudyRow(Shown):
    """One row of a study; its fields have the names of the document.

    links_per_wing : 1 is the rigid model with its aerodynamic corrections identified. bodies : rigid bodies
    of the whole model, fuselage included. parameters : number of unknowns. J_train, J_held_out : J over the
    flights of a role, rad^2; None where there is none, or where one diverged. rms_rad : per angle over the
    flights held out, else over the fitted ones. flight_s : median wall time of one flight, s; None before it
    is measured. identify_s : wall time of the identification, s. flights : flown for it.
    aero_coefficients : names of the corrections that were searched, those included that the samples called
    for. unseen_directions : number of combinations of parameters that the samples cannot see. fit, model,
    warnings, verdict, measurement : as in the identification's result; model is None where none flew the
    samples to fit. finished : whether the search went to its end.
    """

    links_per_wing: LinksPerWing
    bodies: int
    parameters: int
    J_train: float | None
    J_held_out: float | None
    rms_rad: dict[str, float | None]
    flight_s: float | None
    identify_s: float
    flights: int
    aero_coefficients: list[str]
    unseen_directions: int
    fit: list[Document]
    model: Document | None
    finished: bool
    warnings: list[Document] = field(default_factory=list)
    verdict: Document | None = None
    measurement: Document = field(default_factory=dict)

    @property
    def mean_links(self) -> float:
        """Mean number of links, where they differ."""
        return mean_links(self.links_per_wing)

    def J(self, role: Role) -> float | None:
        """J over the flights of a role, rad^2."""
        return self.J_held_out if role == "held_out" else self.J_train

    def J_rigid(self, role: Role) -> float | None:
        """The same of the rigid model without corrections."""
        return _total(self.fit, "J_rigid", role)

    @property
    def has_held_out(self) -> bool:
        """Whether any flight was held out."""
        return any(fit["role"] == "held_out" for fit in self.fit)

    @property
    def worst_rms_rad(self) -> float | None:
        """The largest of the three angles' RMS; None where a flight diverged."""
        known = [value for value in self.rms_rad.values() if value is not None]
        return max(known) if len(known) == len(ANGLES) else None

    @property
    def flown(self) -> bool:
        """Whether the model flies all samples that it was fitted to: without that it is none."""
        return self.model is not None

    @property
    def batch(self) -> ParameterBatch:
        """The identified parameters, to fly with ``simulate(..., model=row.batch)``.

        Raises
        ------
        NotFlyable : no model of this size flew.
        """
        if self.model is None:
            raise NotFlyable(
                f"no model of {shown_per_wing(self.links_per_wing)} flew the samples",
                pointer="/model/links_per_wing",
                hint="take the row of another number of links",
            )
        return parameters_from_document(self.model)

    def timed(self, flight_s: float | None) -> StudyRow:
        """The same with the wall time of a flight."""
        return replace(self, flight_s=flight_s)

    def to_document(self) -> Document:
        """JSON form."""
        return dict(vars(self))


def study_row(run: Identification, found: IdentifyResult) -> StudyRow:
    """The row of one identification."""
    document = found.to_document()
    fit = document["fit"]
    J_train, J_held_out = (_total(fit, "J_identified", role) for role in ("train", "held_out"))
    role = "train" if all(item["role"] == "train" for item in fit) else "held_out"
    errors = np.concatenate(
        [item.errors("identified") for item in found.fits if item.case.sample.role == role]
    )
    rms = np.sqrt(np.mean(errors**2, axis=0))
    return StudyRow(
        links_per_wing=run.model.links_per_wing,
        bodies=1 + found.model.links,
        parameters=run.space.dimension,
        J_train=J_train,
        J_held_out=J_held_out,
        rms_rad={
            angle: float(value) if np.isfinite(value) else None
            for angle, value in zip(ANGLES, rms, strict=True)
        },
        flight_s=None,
        identify_s=document["search"]["wall_s"],
        flights=document["search"]["flights"],
        aero_coefficients=document["search"]["aero_coefficients"],
        unseen_directions=len(document["uncertainty"]["unidentifiable"]),
        fit=fit,
        model=document["model"],
        finished=document["search"]["finished"],
        warnings=document["warnings"],
        verdict=document["verdict"],
        measurement=document["measurement"],
    )


def _total(fit: list[Document], name: str, role: str) -> float | None:
    """Sum over the flights of a role; None where there is none, or where one diverged."""
    values = [item[name] for item in fit if item["role"] == role]
    return float(sum(values)) if values and all(value is not None for value in values) else None
