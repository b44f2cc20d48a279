"""What a trim that fails has found on its way: sentences about the shape where the equilibrium was lost."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

STALL_RAD = 0.35  # angle of attack at which wings stall; the lattice does not
BELOW_KNEE = 1.03  # the lift curve bends below its limit, so a little more speed than at the limit is needed
BENT_RAD = 1.0  # turn of a tip against its root, beyond which a wing carries little upward


@dataclass(frozen=True)
class Limit:
    """A clause for the message of `TrimNotFound`, and its hint."""

    found: str
    hint: str


def no_lift(needed: float, given: float, airspeed_m_s: float, load_factor: float = 1.0) -> Limit:
    """Rigid wings find no such flight; lift coefficients needed, and given at the angle of stall."""
    if given < needed:
        carried = "the weight" if load_factor == 1.0 else f"{load_factor:.3g} times the weight"
        found = (
            f"{carried} needs a mean lift coefficient of {needed:.3g}, and unbent wings give {given:.3g} at "
            f"an angle of attack of {STALL_RAD:g} rad, where wings stall"
        )
        if given <= 0.0:
            return Limit(found, "the surfaces do not lift upward: check their positions and hinge angles")
        least = airspeed_m_s * (needed / given) ** 0.5
        less = "less mass" if load_factor <= 1.0 else "less mass, or turn less"
        return Limit(found, f"at that angle they carry {carried} from about {least:.3g} m/s, or {less}")
    return Limit(
        "rigid wings could carry the weight, but the iteration for them does not arrive",
        "check whether surfaces overlap, or lie in each other's wake",
    )


def stalled(name: str, at: float, needed: float, limit: float, airspeed_m_s: float) -> Limit:
    """A section at a share of a surface's span would need a lift coefficient beyond its limit."""
    enough = BELOW_KNEE * airspeed_m_s * (needed / limit) ** 0.5
    return Limit(
        f"it needs a lift coefficient of {needed:.3g} at {100.0 * at:.0f} per cent of the span of {name!r}, "
        f"whose sections stall at {limit:.3g}",
        f"fly faster (from about {enough:.3g} m/s) or lighter, or check cl_max and cl_min of the surface",
    )


def lost(share: float, alpha: float, bent: tuple[str, float], sound: float = 0.0, bank: float = 0.0) -> Limit:
    """The equilibrium was followed from rigid wings to a ``share`` of their flexibility.

    Parameters
    ----------
    alpha : angle of attack there, rad. bent : the surface or joint that is bent most, and by how much, rad.
    sound : the largest share on the way where no wing stalls or folds, if it is known. bank : angle, rad.
    """
    if share <= 0.0:
        return Limit("even wings a thousand times as stiff bend away", "check the unit of the stiffness")
    found = (
        f"followed from rigid wings, the equilibrium ends at {100.0 * share:.3g} per cent of their "
        f"flexibility, {shape(alpha, bent, bank)}"
    )
    if sound > 0.0:
        return Limit(found, f"wings {_rounded_up(1.0 / sound)} times as stiff trim below both limits")
    return Limit(found, f"wings {_rounded_up(1.0 / share)} times as stiff have a trim")


def is_sound(alpha: float, turn: float) -> bool:
    """Whether an angle of attack and the largest turn of a tip, rad, are below both limits."""
    return abs(alpha) <= STALL_RAD and turn <= BENT_RAD


def chain_limit(share: float, alpha: float, q_joint: Array, bank: float = 0.0) -> Limit:
    """The same of a chain, from its angles (rad) at the last equilibrium found, or at the iteration's end."""
    bent = float(np.abs(q_joint).max(initial=0.0))
    if share > 0.0:
        return lost(share, alpha, ("a joint", bent), bank=bank)
    if not np.isfinite(alpha) or not np.isfinite(bent):
        return Limit("the iteration left the range of numbers", "")
    where = shape(alpha, ("a joint", bent) if q_joint.size else None, bank)
    return Limit(f"the iteration ended {where}", "")


def shape(alpha: float, bent: tuple[str, float] | None, bank: float = 0.0) -> str:
    """Angle of attack, bank angle and bending, rad, with what limits them."""
    stalled = f" (wings stall at about {STALL_RAD:g})" if abs(alpha) > STALL_RAD else ""
    angle = f"with an angle of attack of {alpha:.3g} rad{stalled}"
    if bank:
        angle += f", banked by {bank:.3g} rad"
    if bent is None:
        return angle
    name, turn = bent
    folded = " (beyond about 1 a wing carries little upward)" if turn > BENT_RAD else ""
    return f"{angle} and {name} turned by {turn:.3g} rad{folded}"


def _rounded_up(stiffer: float) -> str:
    return f"{stiffer * 1.01:.3g}"
