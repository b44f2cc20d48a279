"""Checks of a model that a request brings along: given once, and its numbers fit together."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from app.models.left_models import has_flown
from morphdata.faults import Fault
from morphdata.parameters import (
    AXES,
    KnownModel,
    MirroredParameters,
    Parameters,
    SurfaceParameters,
    WholeResult,
)

SUM_TOLERANCE = 1e-6  # of the division: documents may be rounded for printing
RAGGED = -1


def known_model_faults(model: KnownModel, pointer: str = "/model") -> list[Fault]:
    """Check that the model is given once, and that its parameters fit together."""
    if model.parameters is not None and model.model_id is not None:
        return [
            Fault(
                "given_twice",
                "parameters and model_id are both given.",
                f"{pointer}/model_id",
                "Leave one of them out.",
            )
        ]
    if isinstance(model.parameters, WholeResult):
        if not has_flown({"model": model.parameters.model, "fit": model.parameters.fit}):
            return [
                Fault(
                    "never_flown",
                    "The result holds no model that flies the samples it was fitted to.",
                    f"{pointer}/parameters/model",
                    "Its warnings say why; give the result of an identification that succeeded.",
                )
            ]
        return list(_parameters_faults(model.parameters.model, f"{pointer}/parameters/model"))
    if model.parameters is not None:
        return list(_parameters_faults(model.parameters, f"{pointer}/parameters"))
    if model.model_id is None:
        return [
            Fault(
                "missing",
                "An equivalent model needs parameters.",
                f"{pointer}/parameters",
                "Give the model of an identification's result, or the model_id of an identified one.",
            )
        ]
    return []


def _parameters_faults(parameters: Parameters, pointer: str) -> Iterator[Fault]:
    yield from _structure_faults(parameters, parameters.links_per_wing, pointer)
    surfaces = parameters.surfaces or {}
    for name, own in surfaces.items():
        at = f"{pointer}/surfaces/{name.replace('~', '~0').replace('/', '~1')}"
        if isinstance(own, SurfaceParameters):
            yield from _structure_faults(own, parameters.links_per_wing, at)
        elif isinstance(surfaces.get(own.mirror_of, own), MirroredParameters):
            yield Fault(
                "mirrors_nothing",
                f"{name!r} mirrors {own.mirror_of!r}, which has no parameters.",
                f"{at}/mirror_of",
                "Name a surface with parameters of its own.",
            )


def _structure_faults(
    parameters: Parameters | SurfaceParameters, links: int, pointer: str
) -> Iterator[Fault]:
    rows = _rows(parameters.division)
    shapes: dict[str, tuple[int, ...]] = {
        "division": (len(rows), links),
        "stiffness_nm_rad": (len(rows), links - 1, AXES),
        "damping_nms_rad": (len(rows), links - 1, AXES),
    }
    for name, shape in shapes.items():
        allowed = {shape, shape[1:]} if len(rows) == 1 else {shape}
        if links == 1:  # no joints: [] and a [] per wing are the same
            allowed |= {(0,), (len(rows), 0)}
        if _shape(getattr(parameters, name)) not in allowed:
            wanted = " x ".join(str(number) for number in (shape if len(rows) > 1 else shape[1:]))
            yield Fault(
                "wrong_shape",
                f"{name} does not hold {wanted} numbers, as {links} links per wing ask.",
                f"{pointer}/{name}",
                "Give the model of an identification's result as it stands there.",
            )
    for shares in rows:
        if abs(sum(shares) - 1.0) > SUM_TOLERANCE:
            yield Fault(
                "division_not_whole",
                f"The shares of the span add up to {sum(shares):g}.",
                f"{pointer}/division",
                "They must add up to 1.",
            )
            break


def _rows(division: list[float] | list[list[float]]) -> list[list[float]]:
    """One list of shares per wing, or one for all."""
    shared = [share for share in division if isinstance(share, float)]
    return [shared] if shared else [row for row in division if isinstance(row, list)]


def _shape(values: list[Any]) -> tuple[int, ...]:
    """Shape of nested lists; `RAGGED` where rows differ in length."""
    shape: tuple[int, ...] = (len(values),)
    level = values
    while level and isinstance(level[0], list):
        lengths = {len(row) for row in level}
        if len(lengths) > 1:
            return (*shape, RAGGED)
        shape = (*shape, lengths.pop())
        level = [item for row in level for item in row]
    return shape
