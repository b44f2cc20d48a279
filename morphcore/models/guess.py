"""Parameters of a model before any flight: by beam theory, or from a document of this aircraft."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from morphcore.errors import InvalidInput
from morphcore.models.links import beam_division
from morphcore.models.parameter_batch import ParameterBatch, together
from morphcore.models.surface_rows import CutSurface
from morphdata.faults import refuse
from morphdata.links import by_pair, shown_links, shown_per_wing

if TYPE_CHECKING:
    from morphcore.models.equivalent import ChainModel

Array = NDArray[np.float64]


def physical_guess(
    model: ChainModel,
    division: Array | None = None,
    *,
    separate_wings: bool = False,
    apart: Sequence[str] = (),
) -> ParameterBatch:
    """Parameters from beam and thin-airfoil theory, with neutral corrections and Jones' lag.

    Every flexible surface gets those of its own beam; mirror images share them unless wings are separate. For
    division and stiffness, which represent the whole beam, see `beam_division` and `joint_stiffness`; damping
    is proportional, c = beta k.

    Parameters
    ----------
    model : ChainModel
    division : ndarray, shape (p, w, n) or (p, 1, n), optional
        Shares of the span for each set of `ChainModel.sets`, or the same for all; None: one particle with
        those of `beam_division`.
    separate_wings : bool
        Whether each surface of a mirror pair has its own set.
    apart : sequence of str, optional
        Keys of `ChainModel.unlike` with a lift factor of their own.
    """
    sets = model.sets(separate_wings=separate_wings)
    links = [model.links_on(group[0]) for group in sets]
    bent = [model.aircraft.surfaces[group[0]] for group in sets]
    if division is None:
        own = [beam_division(surface, n)[None] for surface, n in zip(bent, links, strict=True)]
    else:
        division = np.broadcast_to(division, (division.shape[0], len(sets), division.shape[2]))
        own = [division[:, k, :n] for k, n in enumerate(links)]
    cuts = [CutSurface(surface, model.flight, shares) for surface, shares in zip(bent, own, strict=True)]
    reference = CutSurface(model.reference_surface, model.flight, own[0])
    values = {}
    for parameter in model.parameters:
        if parameter.scope == "aircraft":
            guess = parameter.guess(reference)
            values[parameter.name] = (
                together([guess] * (1 + len(apart))) if parameter.apart and apart else guess
            )
        else:
            values[parameter.name] = together([parameter.guess(cut) for cut in cuts])
    differ = None if len(set(links)) == 1 else tuple(links)
    return ParameterBatch(values, model.set_names(sets), differ, tuple(apart))


def fitted(model: ChainModel, batch: ParameterBatch) -> ParameterBatch:
    """Return parameters with one set for each surface group of a model.

    A single set given for an aircraft with several different flexible surfaces belongs to the largest. The
    others deviate from their own beam theory by the same factors, and keep their own profile drag.

    Raises
    ------
    InvalidInput
        The batch belongs to another aircraft.
    """
    if batch.surfaces is None and batch.sets == 1 < len(model.pairs):
        guess = physical_guess(model, batch["division"])
        values = dict(batch.values)
        for parameter in model.parameters:
            known, own = batch.values.get(parameter.name), guess[parameter.name]
            if known is None or parameter.scope == "aircraft":
                continue
            if parameter.factor:
                with np.errstate(invalid="ignore", divide="ignore"):
                    factor = np.where(own[:, 0] > 0.0, known[:, 0] / own[:, 0], 1.0)
                own = own * factor[:, None]
            values[parameter.name] = own.copy()
            values[parameter.name][:, 0] = known[:, 0]
        batch = replace(batch, values=values, surfaces=guess.surfaces)
    for k, number in enumerate(model.set_of(batch)):
        links = batch.set_links[number] if batch.set_links else batch.links
        if model.aircraft.surfaces[k].flexible and links != model.surfaces[k, 1]:
            raise InvalidInput(
                f"the model is of {shown_per_wing(model.links_per_wing)}, its parameters are for "
                f"{shown_links(batch.links_per_wing)}",
                pointer="/model/parameters/links_per_wing",
                hint=f"give parameters for as many, or set model.links_per_wing to {batch.links_per_wing}",
            )
    if batch.apart:
        factors = dict(zip(batch.apart, batch["lift_factor"][0, 1:].tolist(), strict=True))
        names = [surface.name for surface in model.aircraft.surfaces]
        pointer = "/model/parameters/aero/lift_factors"
        refuse(by_pair(factors, names, [*model.unlike.values()], pointer)[1])
    return batch
