"""Positions, velocities, momentum and energy, body by body, without the equations of motion."""

from __future__ import annotations

from morphcore.jit import entry_kernel
from tests.oracles.kernels.spatial import inertia_times, motion_to_child


@entry_kernel
def poses_in_base(parent, offset_P, rotation, out_R, out_r):
    """Attitude R_BX (b, 3, 3) and origin r_B (b, 3), m, of every body in the base's frame B."""
    for body in range(parent.size):
        above = parent[body]
        for i in range(3):
            for j in range(3):
                if above < 0:
                    out_R[body, i, j] = 1.0 if i == j else 0.0
                else:
                    total = 0.0
                    for k in range(3):
                        total += out_R[above, i, k] * rotation[body, k, j]
                    out_R[body, i, j] = total
            if above < 0:
                out_r[body, i] = 0.0
            else:
                total = out_r[above, i]
                for k in range(3):
                    total += out_R[above, i, k] * offset_P[body, k]
                out_r[body, i] = total


@entry_kernel
def body_velocities(parent, axis, sign, offset_P, rotation, rate, base_velocity, out):
    """Spatial velocity (b, 6) of every body in its axes from joint rates (b,) and the base's velocity."""
    for body in range(parent.size):
        if parent[body] < 0:
            for i in range(6):
                out[body, i] = base_velocity[i]
        else:
            motion_to_child(rotation[body], offset_P[body], out[parent[body]], out[body])
            out[body, axis[body]] += sign[body] * rate[body]


@entry_kernel
def kinetic_energy(inertia, velocity, scratch):
    """Kinetic energy of all bodies, J. Featherstone (2008), equation 2.67; ``scratch`` is (1, 6)."""
    total = 0.0
    for body in range(velocity.shape[0]):
        inertia_times(inertia[body], velocity[body], scratch[0])
        for i in range(6):
            total += 0.5 * velocity[body, i] * scratch[0, i]
    return total


@entry_kernel
def momentum_about_base(inertia, velocity, R_BX, r_B, scratch, out):
    """Angular momentum about the base's origin and linear momentum, (6,), in B; ``scratch`` is (1, 6)."""
    for i in range(6):
        out[i] = 0.0
    for body in range(velocity.shape[0]):
        inertia_times(inertia[body], velocity[body], scratch[0])
        for i in range(3):
            for j in range(3):
                out[i] += R_BX[body, i, j] * scratch[0, j]
                out[3 + i] += R_BX[body, i, j] * scratch[0, 3 + j]
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            for m in range(3):
                out[i] += (r_B[body, j] * R_BX[body, k, m] - r_B[body, k] * R_BX[body, j, m]) * scratch[
                    0, 3 + m
                ]


@entry_kernel
def mass_and_moment(inertia, R_BX, r_B, out):
    """Total mass, kg, and first moment of mass about the base's origin in B, kg m, as (4,)."""
    for i in range(4):
        out[i] = 0.0
    for body in range(r_B.shape[0]):
        mass = inertia[body, 3, 3]
        # the lower left block of a spatial inertia is m skew(c)^T (Featherstone (2008), equation 2.63)
        moment_x, moment_y, moment_z = inertia[body, 4, 2], inertia[body, 5, 0], inertia[body, 3, 1]
        out[0] += mass
        for i in range(3):
            out[1 + i] += mass * r_B[body, i]
            out[1 + i] += (
                R_BX[body, i, 0] * moment_x + R_BX[body, i, 1] * moment_y + R_BX[body, i, 2] * moment_z
            )
