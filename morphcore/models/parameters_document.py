"""Parameters of an equivalent model as the ``model`` object of a result document, there and back."""

from __future__ import annotations

from typing import Any

import numpy as np

from morphcore.models.equivalent import ParameterBatch
from morphdata.parameters import AXES, Parameters, WholeResult

Document = dict[str, Any]


def parameters_from_document(document: Document, pointer: str = "/model") -> ParameterBatch:
    """Read one parameter set: the ``model`` of an identification's result, or the whole result.

    Parameters
    ----------
    document : dict
        Parsed JSON.
    pointer : str
        Where the document stands, for errors.

    Returns
    -------
    ParameterBatch
        Of one particle.

    Raises
    ------
    InvalidInput
        A field is missing or out of its range, the lists do not fit the number of links, or the result is of
        a search whose best model never flew.
    """
    if "model" in document:
        return parameter_batch(WholeResult.parse(document, pointer).model)
    return parameter_batch(Parameters.parse(document, pointer))


def parameter_batch(given: Parameters) -> ParameterBatch:
    """Return the parameters of a document as a batch of one particle; the division adds up to 1 exactly."""
    wings, links = len(given.divisions), given.links_per_wing
    division = np.array(given.divisions)
    joints = (1, wings, links - 1, AXES)
    return ParameterBatch(
        division=(division / division.sum(axis=1, keepdims=True))[None],
        stiffness=np.array(given.stiffness_nm_rad, dtype=np.float64).reshape(joints),
        damping=np.array(given.damping_nms_rad, dtype=np.float64).reshape(joints),
        lift_factor=np.array([given.aero.lift_factor]),
        centre_shift=np.array([given.aero.centre_shift_m]),
        profile_drag=np.array([given.aero.profile_drag]),
        lag=np.array([given.aero.lag_s]),
    )


def parameters_document(batch: ParameterBatch, particle: int = 0) -> Document:
    """Write one parameter set of a batch as a ``model`` object; ``parameters_from_document`` reads it back.

    Shared parameters are written flat; where each wing has its own, with one more leading axis.
    """
    shared = batch.division.shape[1] == 1
    values = {
        "division": batch.division[particle],
        "stiffness_nm_rad": batch.stiffness[particle],
        "damping_nms_rad": batch.damping[particle],
    }
    return {
        "links_per_wing": batch.links,
        "separate_wings": not shared,
        **{name: (value[0] if shared else value).tolist() for name, value in values.items()},
        "aero": {
            "lift_factor": float(batch.lift_factor[particle]),
            "centre_shift_m": float(batch.centre_shift[particle]),
            "profile_drag": float(batch.profile_drag[particle]),
            "lag_s": float(batch.lag[particle]),
        },
    }
