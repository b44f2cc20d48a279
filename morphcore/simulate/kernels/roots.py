"""Root nodes of surfaces: they follow the fuselage and the prescribed motion of their hinges."""

from __future__ import annotations

from morphcore.jit import entry_kernel
from morphcore.multibody.kernels.se3 import ad, add_from_body, composed_pose, to_body


@entry_kernel
def follow_fuselage(roots, R_BW, origin_B, axis, rate, acceleration, R, x, V, A, v):
    """Poses, twists and twist rates of the roots (s,) from node 0, the fuselage.

    R_BW (s, 3, 3), origin_B (s, 3) m: pose of the root relative to the fuselage; its relative twist is axis
    rate in W, axis (s, 6) and rate (s,); acceleration (s, 6) is the twist's time derivative. R, x, V, A of
    all nodes; v (3, 6) is scratch.
    """
    for s in range(roots.size):
        node = roots[s]
        composed_pose(R[0], x[0], R_BW[s], origin_B[s], R[node], x[node])
        to_body(R_BW[s], origin_B[s], V[0], v[0])
        to_body(R_BW[s], origin_B[s], A[0], v[1])
        # H_root = H_B H_hinges: A_root = Ad A_B - ad(axis rate) Ad V_B + acceleration
        ad(axis[s], v[0], v[2])
        for i in range(6):
            V[node, i] = v[0, i] + axis[s, i] * rate[s]
            A[node, i] = v[1, i] - rate[s] * v[2, i] + acceleration[s, i]


@entry_kernel
def gather_roots(roots, R_BW, origin_B, forces, out):
    """Add the force vectors (n, 6) of the roots (s,) to out (6,), in B about its origin."""
    for s in range(roots.size):
        add_from_body(R_BW[s], origin_B[s], forces[roots[s]], out)


@entry_kernel
def spread_to_roots(roots, R_BW, origin_B, motion, out):
    """Write a motion vector (6,) of the fuselage, carried to each root (s,), into out (n, 6)."""
    for s in range(roots.size):
        to_body(R_BW[s], origin_B[s], motion, out[roots[s]])


@entry_kernel
def gather_root_matrices(roots, R_BW, origin_B, matrices, v, m, out):
    """Add to out (6, 6) the matrices (n, 6, 6) at the roots (s,), transformed to the fuselage.

    out += Ad^T matrix Ad with Ad of `se3.to_body`. v (3, 6) and m (2, 6, 6) are scratch.
    """
    for s in range(roots.size):
        node = roots[s]
        # columns: matrix Ad
        for j in range(6):
            for i in range(6):
                v[0, i] = 1.0 if i == j else 0.0
            to_body(R_BW[s], origin_B[s], v[0], v[1])
            for i in range(6):
                total = 0.0
                for k in range(6):
                    total += matrices[node, i, k] * v[1, k]
                m[0, i, j] = total
        for j in range(6):
            for i in range(6):
                v[0, i] = m[0, i, j]
                v[1, i] = 0.0
            add_from_body(R_BW[s], origin_B[s], v[0], v[1])
            for i in range(6):
                out[i, j] += v[1, i]
