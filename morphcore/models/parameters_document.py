"""Conversion of equivalent-model parameters to and from the ``model`` object of a result document."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from morphcore.models.parameter_batch import ParameterBatch, together
from morphcore.models.parameters import CHAIN_PARAMETERS, Parameter
from morphdata.parameters import AXES, MirroredParameters, Parameters, SurfaceParameters, WholeResult
from morphdata.renamed import under_both_spellings

Array = NDArray[np.float64]
Document = dict[str, Any]


def parameters_from_document(document: Document, pointer: str = "/model") -> ParameterBatch:
    """Read one parameter set: the ``model`` of an identification's result, or the whole result.

    Parameters
    ----------
    document : dict
        Parsed JSON.
    pointer : str
        JSON pointer of the document, for errors.

    Returns
    -------
    ParameterBatch of one particle.

    Raises
    ------
    InvalidInput
        A field is missing or out of range, the lists do not match the number of links, or the result comes
        from a search in which no model could be flown.
    """
    if "model" in document:
        return parameter_batch(WholeResult.parse(document, pointer).model)
    return parameter_batch(Parameters.parse(document, pointer))


def parameter_batch(given: Parameters) -> ParameterBatch:
    """Return the parameters of a document as a batch of one particle; each division sums to exactly 1."""
    surfaces = given.surfaces or {}
    corrections = [parameter for parameter in CHAIN_PARAMETERS if parameter.correction]

    def correction(holder: Any, parameter: Parameter) -> Array:
        return np.full(1, getattr(holder, parameter.name, parameter.default), dtype=np.float64)

    def sets_of(own: Parameters | SurfaceParameters, holder: Any, wings: int) -> dict[str, Array]:
        theirs = {
            p.name: np.tile(correction(holder, p), wings)
            for p in corrections
            if p.scope != "aircraft" and not (p.own_default and getattr(holder, p.name) is None)
        }
        return {**_structure(own, wings), **theirs}

    of_aircraft = {p.name: correction(given.aero, p) for p in corrections if p.scope == "aircraft"}
    factors = getattr(given.aero, "lift_factors", None) or {}
    if factors:
        of_aircraft["lift_factor"] = np.array([[of_aircraft["lift_factor"][0], *factors.values()]])
    own = {name: each for name, each in surfaces.items() if isinstance(each, SurfaceParameters)}
    if not own:
        rows, groups = [sets_of(given, given.aero, len(given.divisions))], None
    else:
        rows = [sets_of(each, each, 1) for each in own.values()]
        images = {
            name: each.mirror_of for name, each in surfaces.items() if isinstance(each, MirroredParameters)
        }
        groups = tuple((name, *(image for image, of in images.items() if of == name)) for name in own)
    values = {name: together([one[None] for row in rows for one in row[name]]) for name in rows[0]}
    links = tuple(row["division"].shape[1] for row in rows)
    return ParameterBatch(
        values | of_aircraft, groups, links if len(set(links)) > 1 else None, tuple(factors)
    )


def _structure(given: Parameters | SurfaceParameters, wings: int) -> dict[str, Array]:
    """Division (w, n), stiffness and damping (w, n - 1, 3) of w wings."""
    division = np.array(given.division, dtype=np.float64).reshape(wings, -1)
    links = division.shape[1]
    joints = (wings, links - 1, AXES)
    return {
        "division": division / division.sum(axis=1, keepdims=True),
        "stiffness_nm_rad": np.array(given.stiffness_nm_rad, dtype=np.float64).reshape(joints),
        "damping_nms_rad": np.array(given.damping_nms_rad, dtype=np.float64).reshape(joints),
    }


def parameters_document(batch: ParameterBatch, particle: int = 0) -> Document:
    """Write one parameter set of a batch as a ``model`` object; ``parameters_from_document`` reads it back.

    Shared parameters are written flat, parameters of separate wings with one more leading axis. If the batch
    names the surfaces of its sets, the flat values are those of the first and ``surfaces`` holds all.
    """
    flat = batch.sets == 1 or batch.surfaces is not None
    values = {
        parameter.name: batch[parameter.name][particle]
        for parameter in CHAIN_PARAMETERS
        if parameter.name in batch.values
    }

    def of_set(name: str, number: int) -> Any:
        return batch.of_set(name, number)[particle].tolist()

    structure = [p.name for p in CHAIN_PARAMETERS if not p.correction]
    corrections = [p for p in CHAIN_PARAMETERS if p.correction and p.name in values]
    document: Document = {
        "links_per_wing": batch.links_per_wing,
        "separate_wings": not flat,
        **{name: of_set(name, 0) if flat else values[name].tolist() for name in structure},
        "aero": under_both_spellings({p.name: float(values[p.name].flat[0]) for p in corrections}),
    }
    if batch.apart:
        document["aero"]["lift_factors"] = dict(
            zip(batch.apart, values["lift_factor"][1:].tolist(), strict=True)
        )
    if batch.surfaces is not None:
        own = [*structure, *(p.name for p in corrections if p.scope != "aircraft")]
        document["surfaces"] = {
            name: {"mirror_of": names[0]} if i else {key: of_set(key, k) for key in own}
            for k, names in enumerate(batch.surfaces)
            for i, name in enumerate(names)
        }
    return document
