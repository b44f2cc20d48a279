"""Parameters of an equivalent model as the ``model`` object of a result document, there and back."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from morphcore.errors import InvalidInput
from morphcore.geometry.fields import Fields
from morphcore.models.equivalent import MOST_LINKS, ParameterBatch
from morphcore.models.parameters import CHAIN_PARAMETERS, Parameter

Array = NDArray[np.float64]
Document = dict[str, Any]

AXES = 3  # flap, torsion, lag
SUM_TOLERANCE = 1e-6  # of the division fractions: documents may be rounded for printing


def parameters_from_document(document: Document, pointer: str = "/model") -> ParameterBatch:
    """Read one parameter set.

    Parameters
    ----------
    document : a ``model`` object of an identification's result, or the whole result that holds one.
        ``division`` (n,), ``stiffness_nm_rad`` (n - 1, 3) of flap, torsion and lag in N m/rad,
        ``damping_nms_rad`` (n - 1, 3) in N m s/rad (or one number for a joint's three axes); each with one
        more leading axis where the wings have parameters of their own. ``aero``: the corrections, by the
        names of ``CHAIN_PARAMETERS``. ``surfaces``, where flexible surfaces are not one mirror pair: by the
        name of each, its own division, stiffness, damping and profile drag, or ``mirror_of`` another. Other
        fields are not looked at.
    pointer : where the document stands, for errors.

    Returns
    -------
    ParameterBatch of one particle.

    Raises
    ------
    InvalidInput : a field is missing, has another shape than ``links_per_wing`` says, or is out of its range;
        or the result is of a search whose best model never flew.
    """
    whole = Fields(document, pointer)
    _require_flown(document, pointer)
    fields = Fields(whole.raw("model"), pointer) if whole.has("model") else whole
    fields.raw("links_per_wing")
    links = fields.whole("links_per_wing", default=1, least=1, most=MOST_LINKS)
    values = _structure(fields, links)
    wings = values["division"].shape[0]
    aero = fields.child("aero")
    for parameter in CHAIN_PARAMETERS:
        if parameter.correction:
            value = np.full(1, _correction(aero, parameter))
            values[parameter.name] = value if parameter.scope == "aircraft" else np.tile(value, wings)
    if not fields.has("surfaces"):
        return _batch(values)
    surfaces = fields.child("surfaces")
    if not fields.raw("surfaces"):
        raise _error(fields, "surfaces", "surfaces is empty")
    owners: dict[str, list[str]] = {}
    own: dict[str, list[Array]] = {}
    for name in fields.raw("surfaces"):
        entry = surfaces.child(name)
        if entry.has("mirror_of"):
            owners.setdefault(entry.text("mirror_of"), []).append(name)
            continue
        owners.setdefault(name, []).insert(0, name)
        found = _structure(entry, links)
        for parameter in CHAIN_PARAMETERS:
            if parameter.correction and parameter.scope != "aircraft":
                found[parameter.name] = np.full(1, _correction(entry, parameter))
        for key, value in found.items():
            own.setdefault(key, []).append(value[0])
    for label, names in owners.items():
        if names[0] != label:
            entry = surfaces.child(names[0])
            raise _error(entry, "mirror_of", f"{names[0]!r} mirrors {label!r}, which has no parameters")
    values |= {key: np.stack(rows) for key, rows in own.items()}
    return _batch(values, tuple(tuple(names) for names in owners.values()))


def _batch(values: dict[str, Array], surfaces: tuple[tuple[str, ...], ...] | None = None) -> ParameterBatch:
    """One particle of values without their leading axis."""
    whole = {parameter.name for parameter in CHAIN_PARAMETERS if parameter.scope == "aircraft"}
    return ParameterBatch(
        {name: value if name in whole else value[None] for name, value in values.items()}, surfaces
    )


def _structure(fields: Fields, links: int) -> dict[str, Array]:
    """Division (w, n), stiffness and damping (w, n - 1, 3) of an object with w wings."""
    division = _array(fields, "division")
    wings = 1 if division.ndim == 1 else division.shape[0]
    division = _shaped(fields, "division", division, (wings, links))
    if np.any(division <= 0.0) or np.any(np.abs(division.sum(axis=1) - 1.0) > SUM_TOLERANCE):
        raise _error(fields, "division", "the shares of the span are not positive or do not add up to 1")
    stiffness = _array(fields, "stiffness_nm_rad")
    stiffness = _shaped(fields, "stiffness_nm_rad", stiffness, (wings, links - 1, AXES))
    damping = _array(fields, "damping_nms_rad")
    if damping.ndim > 0 and damping.size == wings * (links - 1):
        damping = np.repeat(damping.reshape(wings, links - 1, 1), AXES, axis=2)
    damping = _shaped(fields, "damping_nms_rad", damping, (wings, links - 1, AXES))
    for name, values in (("stiffness_nm_rad", stiffness), ("damping_nms_rad", damping)):
        if np.any(values < 0.0):
            raise _error(fields, name, f"{name} has a negative entry")
    return {
        "division": division / division.sum(axis=1, keepdims=True),
        "stiffness_nm_rad": stiffness,
        "damping_nms_rad": damping,
    }


def _correction(fields: Fields, parameter: Parameter) -> float:
    limits = {"least": parameter.minimum, "most": parameter.maximum, "above": parameter.above}
    if parameter.default is None:
        return fields.number(parameter.name, **limits)
    return fields.number(parameter.name, default=parameter.default, **limits)


def parameters_document(batch: ParameterBatch, particle: int = 0) -> Document:
    """Write one parameter set of a batch as a ``model`` object; ``parameters_from_document`` reads it back.

    Shared parameters are written flat; where each wing has its own, with one more leading axis. Where the
    batch names the surfaces of its sets, the flat ones are those of the first and ``surfaces`` has all.
    """
    flat = batch.sets == 1 or batch.surfaces is not None
    values = {
        parameter.name: batch[parameter.name][particle]
        for parameter in CHAIN_PARAMETERS
        if parameter.name in batch.values
    }
    structure = [p.name for p in CHAIN_PARAMETERS if not p.correction]
    corrections = [p for p in CHAIN_PARAMETERS if p.correction and p.name in values]
    document: Document = {
        "links_per_wing": batch.links,
        "separate_wings": not flat,
        **{name: (values[name][0] if flat else values[name]).tolist() for name in structure},
        "aero": {
            p.name: float(values[p.name] if p.scope == "aircraft" else values[p.name][0]) for p in corrections
        },
    }
    if batch.surfaces is not None:
        own = [*structure, *(p.name for p in corrections if p.scope != "aircraft")]
        document["surfaces"] = {
            name: {"mirror_of": names[0]} if i else {key: values[key][k].tolist() for key in own}
            for k, names in enumerate(batch.surfaces)
            for i, name in enumerate(names)
        }
    return document


def _require_flown(document: Document, pointer: str) -> None:
    """Refuse a result without a model, or with one that did not fly what it was fitted to."""
    fit = document.get("fit")
    lost = [
        row.get("sample")
        for row in (fit if isinstance(fit, list) else [])
        if isinstance(row, dict) and row.get("role") == "train" and row.get("J_identified", 0.0) is None
    ]
    if lost or ("model" in document and document["model"] is None):
        raise InvalidInput(
            "the result holds no model that flies the samples it was fitted to",
            pointer=f"{pointer}/model",
            hint="its warnings say why; give the result of an identification that succeeded",
        )


def _array(fields: Fields, name: str) -> Array:
    raw = fields.raw(name)
    try:
        values = np.array(raw, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise _error(fields, name, f"{name} is not a list of numbers") from None
    if values.ndim == 0 or not np.all(np.isfinite(values)):
        raise _error(fields, name, f"{name} is not a list of finite numbers")
    return values


def _shaped(fields: Fields, name: str, values: Array, shape: tuple[int, ...]) -> Array:
    # no entries at all (one link has no joints): [] and [[]] are the same
    if values.size != np.prod(shape) or (values.size and values.shape not in {shape, shape[1:]}):
        wanted = " x ".join(str(n) for n in (shape if shape[0] > 1 else shape[1:]))
        raise _error(fields, name, f"{name} does not hold {wanted} numbers")
    return values.reshape(shape)


def _error(fields: Fields, name: str, message: str) -> InvalidInput:
    hint = "give the model of an identification's result"
    return InvalidInput(message, pointer=f"{fields.pointer}/{name}", hint=hint)
