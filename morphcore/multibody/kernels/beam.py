"""Geometrically exact beam elements on SE(3): forces, tangents, and the poses of sections between the nodes.

An element joins node a to node b; its strain is the logarithm ``d`` of their relative pose, H_b = H_a exp(d),
minus that at rest. Poses between them are H_a exp(s d), s in 0..1: a helix of constant deformation, free of
shear locking and unaffected by rigid motion. Sonneville, Cardona & Brüls (2014).

The stiffness (6, 6) conjugate to ``d`` is the inverse of the element's exact flexibility under loads at its
nodes (Magnus' expansion: a linearly varying curvature appears in ``d`` as a shear of length^3 / 12 times its
slope; MacNeal 1978 found the same "residual bending flexibility" for the linear element). So one element is
exact in small bending under nodal loads, where the bare helix would be wrong by length^2.

Inertia is integrated at Gauss points with the exact velocity and acceleration of the helix.

Shapes: n nodes, e elements, g Gauss points. ``ends`` (e, 2) nodes; ``rest`` (e, 6); ``stiffness`` (e, 6, 6);
``damping`` (e,) s; ``mass`` (e, g, 6, 6) spatial inertia of a section times weight and length; ``gauss``
(g,). Poses R (n, 3, 3), x (n, 3); twists V and their rates A (n, 6) in node axes.
"""

from __future__ import annotations

from morphcore.jit import entry_kernel, kernel
from morphcore.multibody.kernels.helix import (
    helix_coefficients,
    helix_map,
    helix_terms,
    helix_twist,
    subtract_helix_force,
)
from morphcore.multibody.kernels.se3 import (
    ad,
    ad_transposed,
    composed_pose,
    even_series_with_slope,
    exponential,
    inverse_tangent_coefficients,
    logarithm,
    relative_pose,
)

VECTOR_SCRATCH = 18  # rows of six numbers
MATRIX_SCRATCH = 16  # matrices of 6 x 6


@kernel
def multiply(matrix, vector, out):
    """out = matrix @ vector, six rows; out must not be vector."""
    for i in range(6):
        total = 0.0
        for j in range(6):
            total += matrix[i, j] * vector[j]
        out[i] = total


@kernel
def internal_force(rest, stiffness, damping, d, d_rate, strain, sigma):
    """sigma = K (d - rest + damping d_rate); strain (6,) is scratch."""
    for i in range(6):
        strain[i] = d[i] - rest[i] + damping * d_rate[i]
    multiply(stiffness, strain, sigma)


@entry_kernel
def beam_forces(
    ends, rest, stiffness, damping, mass, gauss, series, R, x, V, A, gravity_N, v, poses, strains, rates, out
):
    """Add to out (n, 6) the forces that strain, inertia and weight require at the nodes, in node axes.

    They vanish in motion without other loads. ``gauss``, ``series`` : the Gauss points and their
    `helix.helix_series`. ``strains`` and ``rates`` (e, 6) return d and its rate; ``v`` (VECTOR_SCRATCH, 6)
    and ``poses`` (2, 4, 3) are scratch. Returns the number of the first element that turned by more than
    `se3.LARGEST_ANGLE`, else -1.

    Weight is inertia relative to free fall: translation with the acceleration of gravity is a rigid motion,
    which the helix reproduces exactly.
    """
    u, w, u1, u2, u1_rate, u2_rate = v[0], v[1], v[2], v[3], v[4], v[5]
    twist, acceleration, momentum, force, sigma = v[6], v[7], v[8], v[9], v[10]
    root_force, end_force, once, twice = v[11], v[12], v[13], v[14]
    fall, b0, b1 = v[15], v[16], v[17]
    for element in range(ends.shape[0]):
        a, b = ends[element, 0], ends[element, 1]
        d, d_rate = strains[element], rates[element]
        relative_pose(R[a], x[a], R[b], x[b], poses[0, :3], poses[0, 3])
        if not logarithm(poses[0, :3], poses[0, 3], d):
            return element
        z = -(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
        m = d[0] * d[3] + d[1] * d[4] + d[2] * d[5]
        # d' = T(d)^-1 V_b - T(-d)^-1 V_a
        for i in range(6):
            u[i] = V[b, i] - V[a, i]
            b0[i] = V[b, i] + V[a, i]
        ad(d, u, u1)
        ad(d, u1, u2)
        ad(d, b0, b1)
        even, even_z = even_series_with_slope(z)
        for i in range(6):
            d_rate[i] = u[i] + 0.5 * b1[i] + even * u2[i]
        for i in range(3):
            d_rate[3 + i] -= 2.0 * m * even_z * u2[i]
        z_rate = -2.0 * (d[0] * d_rate[0] + d[1] * d_rate[1] + d[2] * d_rate[2])
        m_rate = d_rate[0] * d[3] + d_rate[1] * d[4] + d_rate[2] * d[5]
        m_rate += d[0] * d_rate[3] + d[1] * d_rate[4] + d[2] * d_rate[5]
        internal_force(rest[element], stiffness[element], damping[element], d, d_rate, b0, sigma)
        for i in range(3):
            fall[i] = A[a, i]
            w[i] = A[b, i] - A[a, i]
            fall[3 + i] = A[a, 3 + i] - (
                R[a, 0, i] * gravity_N[0] + R[a, 1, i] * gravity_N[1] + R[a, 2, i] * gravity_N[2]
            )
            w[3 + i] = (
                A[b, 3 + i]
                - (R[b, 0, i] * gravity_N[0] + R[b, 1, i] * gravity_N[1] + R[b, 2, i] * gravity_N[2])
                - fall[3 + i]
            )
        ad(d, w, b0)
        ad(d_rate, u, b1)
        for i in range(6):
            u1_rate[i] = b0[i] + b1[i]
        ad(d, u1_rate, b0)
        ad(d_rate, u1, b1)
        for i in range(6):
            u2_rate[i] = b0[i] + b1[i]
            root_force[i], end_force[i], once[i], twice[i] = 0.0, 0.0, 0.0, 0.0
        terms = helix_terms(z)
        for point in range(gauss.size):
            s = gauss[point]
            c1, c2, c1_z, c2_z, c1_zz, c2_zz = helix_coefficients(series[point], z, terms)
            p1, p2 = z_rate * c1_z, z_rate * c2_z
            e1, e2 = -2.0 * m * c1_z, -2.0 * m * c2_z
            f1 = -2.0 * (m_rate * c1_z + m * z_rate * c1_zz)
            f2 = -2.0 * (m_rate * c2_z + m * z_rate * c2_zz)
            for i in range(6):
                twist[i] = V[a, i] + s * u[i] + c1 * u1[i] + c2 * u2[i]
                acceleration[i] = (
                    fall[i] + s * w[i] + c1 * u1_rate[i] + c2 * u2_rate[i] + p1 * u1[i] + p2 * u2[i]
                )
            for i in range(3):
                twist[3 + i] += e1 * u1[i] + e2 * u2[i]
                acceleration[3 + i] += e1 * u1_rate[i] + e2 * u2_rate[i] + f1 * u1[i] + f2 * u2[i]
            # Newton and Euler: I a + v x* I v
            section = mass[element, point]
            multiply(section, twist, momentum)
            ad_transposed(twist, momentum, b0)
            multiply(section, acceleration, force)
            for i in range(6):
                force[i] -= b0[i]
                root_force[i] += force[i]
                end_force[i] += s * force[i]
                once[i] += c1 * force[i]
                twice[i] += c2 * force[i]
            for i in range(3):
                once[i] += e1 * force[3 + i]
                twice[i] += e2 * force[3 + i]
        ad_transposed(d, twice, b0)
        for i in range(6):
            once[i] += b0[i]
        ad_transposed(d, once, b0)
        # T(d)^-T sigma = even + odd, T(-d)^-T sigma = even - odd
        ad_transposed(d, sigma, b1)
        for i in range(6):
            twice[i] = even * sigma[i]
        for i in range(3):
            twice[i] -= 2.0 * m * even_z * sigma[3 + i]
        ad_transposed(d, twice, momentum)
        ad_transposed(d, momentum, force)
        for i in range(6):
            end_force[i] += b0[i]
            same, opposite = 0.5 * b1[i], sigma[i] + force[i]
            out[a, i] += same - opposite + root_force[i] - end_force[i]
            out[b, i] += same + opposite + end_force[i]
    return -1


@kernel
def body_force(inertia, V, A, gravity_B, v, out):
    """out += I (A - g) + V x* I V of a rigid body with twist V and twist rate A; v (4, 6) is scratch."""
    for i in range(3):
        v[0, i] = A[i]
        v[0, 3 + i] = A[3 + i] - gravity_B[i]
    multiply(inertia, v[0], v[1])
    multiply(inertia, V, v[2])
    ad_transposed(V, v[2], v[3])
    for i in range(6):
        out[i] += v[1, i] - v[3, i]


@entry_kernel
def body_forces(nodes, inertia, R, V, A, gravity_N, v, out):
    """Add to out (n, 6) the forces that inertia and weight of bodies (k, 6, 6) require at nodes (k,)."""
    for k in range(nodes.size):
        node = nodes[k]
        gravity = v[4]
        for i in range(3):
            gravity[i] = (
                R[node, 0, i] * gravity_N[0] + R[node, 1, i] * gravity_N[1] + R[node, 2, i] * gravity_N[2]
            )
        body_force(inertia[k], V[node], A[node], gravity, v, out[node])


@entry_kernel
def apparent_forces(apparent, R, V, A, wind_N, v, out):
    """Add to out (n, 6) the forces that apparent mass (n or 0, 6, 6) at the nodes requires.

    It follows the rate of the twist relative to the air, in node axes: A + omega x wind. v (2, 6) is scratch.
    """
    for n in range(apparent.shape[0]):
        for i in range(3):
            v[0, i] = R[n, 0, i] * wind_N[0] + R[n, 1, i] * wind_N[1] + R[n, 2, i] * wind_N[2]
        wx, wy, wz = v[0, 0], v[0, 1], v[0, 2]
        for i in range(6):
            v[0, i] = A[n, i]
        v[0, 3] += V[n, 1] * wz - V[n, 2] * wy
        v[0, 4] += V[n, 2] * wx - V[n, 0] * wz
        v[0, 5] += V[n, 0] * wy - V[n, 1] * wx
        multiply(apparent[n], v[0], v[1])
        for i in range(6):
            out[n, i] += v[1, i]


@entry_kernel
def place_sections(ends, fractions, series, elements, strains, R, x, v, poses, R_out, x_out, blocks):
    """Poses of sections for given strains, and the maps between their twists and the nodes'.

    Section k lies at ``fractions[k]`` of ``elements[k]``, with its `helix.helix_series` in series[k]. R_out
    (k, 3, 3), x_out (k, 3); blocks (k, 2, 3, 3) of `helix.helix_map`. An element below zero, -1 - node,
    stands for that node itself.
    """
    for k in range(elements.size):
        element = elements[k]
        if element < 0:
            node = -1 - element
            for i in range(3):
                x_out[k, i] = x[node, i]
                for j in range(3):
                    R_out[k, i, j] = R[node, i, j]
                    blocks[k, 0, i, j], blocks[k, 1, i, j] = 0.0, 0.0
            continue
        a, s = ends[element, 0], fractions[k]
        d = strains[element]
        for i in range(6):
            v[0, i] = s * d[i]
        exponential(v[0], poses[0, :3], poses[0, 3])
        composed_pose(R[a], x[a], poses[0, :3], poses[0, 3], R_out[k], x_out[k])
        helix_map(d, s, series[k], blocks[k])


@entry_kernel
def section_twists(ends, elements, blocks, V, out):
    """Twists (k, 6) of sections in their own axes, with the blocks of `place_sections`."""
    for k in range(elements.size):
        element = elements[k]
        a = ends[element, 0] if element >= 0 else -1 - element
        b = ends[element, 1] if element >= 0 else a
        helix_twist(V[a], V[b], blocks[k], out[k])


@entry_kernel
def subtract_forces(ends, elements, blocks, forces, out):
    """Subtract from out (n, 6) the nodes' share of force vectors (k, 6) on sections, by virtual work."""
    for k in range(elements.size):
        element = elements[k]
        a = ends[element, 0] if element >= 0 else -1 - element
        b = ends[element, 1] if element >= 0 else a
        subtract_helix_force(forces[k], blocks[k], out[a], out[b])


@kernel
def product(left, right, out):
    """out = left @ right, 6 x 6; out must be neither."""
    for i in range(6):
        for j in range(6):
            out[i, j] = 0.0
        for k in range(6):
            factor = left[i, k]
            for j in range(6):
                out[i, j] += factor * right[k, j]


@kernel
def add_force_bracket(f, factor, out):
    """out += factor C with C d = ad(d)^T f, the bracket as a matrix that acts on d."""
    for block in range(3):
        row, column = (0, 0, 3)[block], (0, 3, 0)[block]
        x, y, z = (f[0], f[1], f[2]) if block == 0 else (f[3], f[4], f[5])
        out[row, column + 1] -= factor * z
        out[row, column + 2] += factor * y
        out[row + 1, column] += factor * z
        out[row + 1, column + 2] -= factor * x
        out[row + 2, column] -= factor * y
        out[row + 2, column + 1] += factor * x


@entry_kernel
def beam_tangents(rest, stiffness, damping, mass12, strains, rates, of_mass, of_rate, of_pose, v, m, out):
    """Iteration matrices of the elements, out (e, 12, 12), rows and columns of node a before node b.

    out = of_mass M + of_rate C + of_pose K: M (e, 12, 12) of the element at rest, C and K from the material
    and, K, the internal forces' change of direction. ``v`` (VECTOR_SCRATCH, 6), ``m`` (MATRIX_SCRATCH, 6, 6)
    are scratch.
    """
    for element in range(strains.shape[0]):
        d = strains[element]
        z = -(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
        c2, c4, c2_z, c4_z = inverse_tangent_coefficients(z)
        A, A2, A4, At, At2, At3 = m[0], m[1], m[2], m[3], m[4], m[5]
        for j in range(6):
            for i in range(6):
                v[0, i] = 1.0 if i == j else 0.0
            ad(d, v[0], v[1])
            for i in range(6):
                A[i, j] = v[1, i]
                At[j, i] = v[1, i]
        product(A, A, A2)
        product(A2, A2, A4)
        product(At, At, At2)
        product(At2, At, At3)
        to_a, to_b = m[6], m[7]  # of nodal displacements to d
        for i in range(6):
            for j in range(6):
                even = c2 * A2[i, j] + c4 * A4[i, j] + (1.0 if i == j else 0.0)
                to_b[i, j] = even + 0.5 * A[i, j]
                to_a[i, j] = -even + 0.5 * A[i, j]
        factor = of_pose + damping[element] * of_rate
        internal_force(rest[element], stiffness[element], damping[element], d, rates[element], v[0], v[1])
        for k in range(1, 5):
            multiply(At, v[k], v[k + 1])
        # even part of the derivative of T^-T sigma by d; v[1 + k] = (A^T)^k sigma
        even_d, odd_d, inner = m[8], m[9], m[10]
        for i in range(6):
            for j in range(6):
                even_d[i, j], odd_d[i, j] = 0.0, 0.0
            for j in range(3):
                even_d[i, j] = -2.0 * d[j] * (c2_z * v[3, i] + c4_z * v[5, i])
        add_force_bracket(v[1], 0.5, odd_d)
        add_force_bracket(v[2], c2, even_d)
        add_force_bracket(v[4], c4, even_d)
        for k in range(3):
            source, power, weight = (1, 3, 2)[k], (0, 0, 1)[k], (c2, c4, c4)[k]
            _clear(inner)
            add_force_bracket(v[source], weight, inner)
            product(At if power == 0 else At2, inner, m[11])
            _add(m[11], even_d)
        _clear(inner)
        add_force_bracket(v[1], c4, inner)
        product(At3, inner, m[11])
        _add(m[11], even_d)
        for side in range(2):
            sign = -1.0 if side == 0 else 1.0
            P = to_a if side == 0 else to_b
            # P^T K, then the change of P^T at constant sigma
            for i in range(6):
                for j in range(6):
                    total = 0.0
                    for k in range(6):
                        total += P[k, i] * stiffness[element, k, j]
                    m[12, i, j] = factor * total + of_pose * (odd_d[i, j] + sign * even_d[i, j])
            product(m[12], to_a, m[13])
            product(m[12], to_b, m[14])
            for i in range(6):
                row = 6 * side + i
                for j in range(6):
                    out[element, row, j] = of_mass * mass12[element, row, j] + m[13, i, j]
                    out[element, row, 6 + j] = of_mass * mass12[element, row, 6 + j] + m[14, i, j]


@kernel
def _clear(matrix):
    for i in range(6):
        for j in range(6):
            matrix[i, j] = 0.0


@kernel
def _add(matrix, out):
    for i in range(6):
        for j in range(6):
            out[i, j] += matrix[i, j]


@kernel
def invert(matrix, out):
    """out = the inverse of a 6 x 6 matrix (which is destroyed), by Gauss and Jordan with row pivots."""
    for i in range(6):
        for j in range(6):
            out[i, j] = 1.0 if i == j else 0.0
    for column in range(6):
        pivot = column
        for i in range(column + 1, 6):
            if abs(matrix[i, column]) > abs(matrix[pivot, column]):
                pivot = i
        if pivot != column:
            for j in range(6):
                matrix[column, j], matrix[pivot, j] = matrix[pivot, j], matrix[column, j]
                out[column, j], out[pivot, j] = out[pivot, j], out[column, j]
        scale = 1.0 / matrix[column, column]
        for j in range(6):
            matrix[column, j] *= scale
            out[column, j] *= scale
        for i in range(6):
            if i != column:
                factor = matrix[i, column]
                for j in range(6):
                    matrix[i, j] -= factor * matrix[column, j]
                    out[i, j] -= factor * out[column, j]


@entry_kernel
def eliminate(ends, tangents, diagonals, inverses, couplings, m):
    """Block elimination of open chains, tips -> roots; elements of a chain are numbered from its root.

    ``tangents`` (e, 12, 12) of the elements. ``diagonals`` (n, 6, 6) contain on entry the matrices of
    everything else at the nodes, and on return the condensed matrices; the one of a root is then that of its
    whole chain. ``inverses`` and ``couplings`` (e, 6, 6) belong to each element's outer node: its inverse,
    and the inverse times the coupling to the inner node.
    """
    for element in range(ends.shape[0]):
        for side in range(2):
            for i in range(6):
                for j in range(6):
                    diagonals[ends[element, side], i, j] += tangents[element, 6 * side + i, 6 * side + j]
    for element in range(ends.shape[0] - 1, -1, -1):
        a, b = ends[element, 0], ends[element, 1]
        for i in range(6):
            for j in range(6):
                m[0, i, j] = diagonals[b, i, j]
        invert(m[0], inverses[element])
        product(inverses[element], tangents[element, 6:, :6], couplings[element])
        product(tangents[element, :6, 6:], couplings[element], m[1])
        for i in range(6):
            for j in range(6):
                diagonals[a, i, j] -= m[1, i, j]


@entry_kernel
def condense(ends, tangents, inverses, v, right):
    """Right sides (n, 6), tips -> roots: outer nodes get inverse times right side, roots the chain's sum."""
    for element in range(ends.shape[0] - 1, -1, -1):
        a, b = ends[element, 0], ends[element, 1]
        multiply(inverses[element], right[b], v[0])
        for i in range(6):
            right[b, i] = v[0, i]
        multiply(tangents[element, :6, 6:], v[0], v[1])
        for i in range(6):
            right[a, i] -= v[1, i]


@entry_kernel
def substitute(ends, couplings, right):
    """Roots -> tips: from condensed right-hand sides (n, 6) with the roots' solution to the full solution."""
    for element in range(ends.shape[0]):
        a, b = ends[element, 0], ends[element, 1]
        for i in range(6):
            total = 0.0
            for j in range(6):
                total += couplings[element, i, j] * right[a, j]
            right[b, i] -= total
