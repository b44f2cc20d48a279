"""Composite rigid body algorithm on a floating base: the mass matrix."""

from __future__ import annotations

from morphcore.jit import entry_kernel
from tests.oracles.kernels.spatial import add_force_to_parent, add_inertia_to_parent


@entry_kernel
def composite_mass_matrix(
    parent, axis, sign, offset_P, inertia, coordinate, rotation, composite, scratch, out
):
    """Mass matrix of the base's six degrees of freedom and the free joint coordinates.

    Featherstone (2008), table 6.2, with the base's own rows as in section 9.3. Prescribed hinges carry
    composite inertia and forces through like welds (hybrid dynamics, section 9.1): they have no row.

    Parameters
    ----------
    parent, axis, sign, offset_P, inertia, coordinate : as in ``Tree``.
    rotation : (b, 3, 3), R_PC of every joint.
    composite : (b, 6, 6) workspace; afterwards the inertia of each body with all that hangs on it.
    scratch : (4, 6) workspace.
    out : (6 + n, 6 + n), unknowns ordered as [base angular, base linear, joint coordinates].
    """
    for body in range(parent.size):
        for row in range(6):
            for column in range(6):
                composite[body, row, column] = inertia[body, row, column]
    # tips -> root: gather composite inertia
    for body in range(parent.size - 1, 0, -1):
        add_inertia_to_parent(
            rotation[body], offset_P[body], composite[body], scratch, composite[parent[body]]
        )
    out[:, :] = 0.0
    for row in range(6):
        for column in range(6):
            out[row, column] = composite[0, row, column]
    # each joint's unit acceleration -> the force it takes, felt at every joint below
    force, moved = scratch[0], scratch[1]
    for body in range(1, parent.size):
        column = coordinate[body]
        if column < 0:
            continue
        for i in range(6):
            force[i] = sign[body] * composite[body, i, axis[body]]
        out[6 + column, 6 + column] = sign[body] * force[axis[body]]
        below = body
        while parent[below] >= 0:
            for i in range(6):
                moved[i] = 0.0
            add_force_to_parent(rotation[below], offset_P[below], force, moved)
            for i in range(6):
                force[i] = moved[i]
            below = parent[below]
            row = coordinate[below]
            if row >= 0:
                out[6 + row, 6 + column] = sign[below] * force[axis[below]]
                out[6 + column, 6 + row] = out[6 + row, 6 + column]
        for i in range(6):
            out[i, 6 + column] = force[i]
            out[6 + column, i] = force[i]
