"""Finds joints of an equivalent model that are too soft for their load, to explain a failed flight."""

from __future__ import annotations

from morphcore.geometry.obstacle import LARGEST_SLOPE_RAD, Obstacle, load_per_length, too_little_air
from morphcore.models.equivalent import ChainModel, ParameterBatch
from morphcore.models.links import link_edges

NO_STIFFNESS = 1e-9  # share of the moment below which a joint counts as unloaded
POINTER = "/model/parameters/stiffness_nm_rad"


def chain_obstacle(model: ChainModel, batch: ParameterBatch) -> Obstacle | None:
    """What prevents a chain (one parameter set) from flying: one of its joints, or too little air."""
    return soft_joint(model, batch) or too_little_air(model.aircraft, model.flight)


def soft_joint(model: ChainModel, batch: ParameterBatch) -> Obstacle | None:
    """The joint that its share of the weight would turn too far in flap; None if all can carry it.

    The moment at a distance y from the root is q (L - y)^2 / 2 under a load q per length.
    """
    load_n_m = load_per_length(model.aircraft, model.flight)
    worst: tuple[float, str, int, float] = (LARGEST_SLOPE_RAD, "", 0, 0.0)
    for surface, own in zip(model.aircraft.surfaces, model.set_of(batch), strict=True):
        if not surface.flexible:
            continue
        joints_m = link_edges(batch.of_set("division", own)[:1], surface.length_m)[0, 1:-1]
        moment = 0.5 * load_n_m * (surface.length_m - joints_m) ** 2
        for joint, stiffness in enumerate(batch.of_set("stiffness_nm_rad", own)[0, :, 0]):
            carries = stiffness > NO_STIFFNESS * moment[joint]
            angle = float(moment[joint] / stiffness) if carries else float("inf")
            if angle > worst[0]:
                worst = (angle, surface.name, joint + 1, float(stiffness))
    angle, name, joint, stiffness = worst
    if not joint:
        return None
    return Obstacle(
        POINTER,
        f"joint {joint} of {name!r}, {stiffness:.3g} N m/rad in flap, is too soft for its share of the "
        f"weight: it would turn by {angle:.3g} rad; check the parameters, or identify the model again",
    )
