"""Layout of a lane's state, constants and scratch in rows."""

from __future__ import annotations

from morphcore.jit import inlined
from morphcore.multibody.kernels.articulated import LINK_ROWS
from morphcore.multibody.kernels.gimbal import JOINT_ROWS

# rows of the state: attitude quaternion of R_NB, omega_B, v_B, position in N; then joint angles, joint rates,
# and for each link the slow and the fast lag state and the motion that they follow (3 rows each, all slow
# ones first)
OMEGA, VELOCITY, POSITION, JOINTS = 4, 7, 10, 13
# rows of a lane's constants: force and moment in B, then links, stiffness, damping, overlap
FORCE_C, MOMENT_C, LINKS_C = 0, 3, 6
# rows of the scratch block before the per-link and per-joint ones
S_TWIST, S_BASE_ACCELERATION, S_BASE_INERTIA, S_BASE_FORCE = 0, 6, 12, 33
S_INERTIA, S_CARRIED, S_SUMS, S_WIND, S_GRAVITY, S_FREE = 39, 60, 66, 72, 75, 78
# indices of the shared numbers
DENSITY, GRAVITY, FUSELAGE = 0, 1, 2  # then 21 of the fuselage's spatial inertia
APPARENT = 23  # whether the links have apparent mass: not zero
LIMITS = 24  # if sections stall: then two numbers for each strip, see aero/kernels/stall.py


@inlined
def state_rows(links: int, coordinates: int) -> tuple[int, int, int, int, int, int]:
    """First rows of joint angles and rates, slow and fast lag, followed motion; and the state's end."""
    rates = JOINTS + coordinates
    slow = rates + coordinates
    return JOINTS, rates, slow, slow + 3 * links, slow + 6 * links, slow + 9 * links


@inlined
def constant_rows(links: int, coordinates: int) -> tuple[int, int, int]:
    """First rows of stiffness, damping and overlap among a lane's constants."""
    stiffness = LINKS_C + LINK_ROWS * links
    return stiffness, stiffness + coordinates, stiffness + 2 * coordinates


@inlined
def link_rows_of_scratch(links: int) -> tuple[int, int, int, int, int]:
    """First scratch rows of the links' twists, wrenches, biases, accelerations and effective motions."""
    return S_FREE, S_FREE + 6 * links, S_FREE + 12 * links, S_FREE + 18 * links, S_FREE + 24 * links


@inlined
def gravity_rows_of_scratch(links: int) -> int:
    """First scratch row of gravity in the axes of the links, three rows each."""
    return S_FREE + 27 * links


@inlined
def visible_rows_of_scratch(links: int, coordinates: int) -> tuple[int, int, int, int]:
    """First scratch rows, where surfaces telescope, of links, joint stiffness and damping, and overlap."""
    first = joint_rows_of_scratch(links, coordinates)[-1]
    stiffness = first + LINK_ROWS * links
    return first, stiffness, stiffness + coordinates, stiffness + 2 * coordinates


@inlined
def joint_rows_of_scratch(links: int, coordinates: int) -> tuple[int, int, int, int, int]:
    """First scratch rows of joint forces, added diagonal, accelerations, gimbals; and the row after them."""
    first = S_FREE + 30 * links
    gimbals = first + 3 * coordinates
    return (
        first,
        first + coordinates,
        first + 2 * coordinates,
        gimbals,
        gimbals + JOINT_ROWS * (coordinates // 3),
    )


@inlined
def axis_rows_of_scratch(links: int, coordinates: int) -> tuple[int, int]:
    """First scratch row of the axes of N in those of B, then of all links, nine rows each; and the end.

    They are used in gusts only.
    """
    _, _, _, _, first = joint_rows_of_scratch(links, coordinates)
    return first, first + 9 * (links + 1)
