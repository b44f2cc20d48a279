"""Geometrically exact beam elements on SE(3): forces, tangents, and the poses of sections between the nodes.

An element joins node a to node b; its strain is the logarithm ``d`` of their relative pose, H_b = H_a exp(d),
against that at rest. Poses between them are H_a exp(s d), s in 0..1: a helix, whose deformation is constant,
free of shear locking, and blind to rigid motion. Sonneville, Cardona & Brüls (2014).

The stiffness (6, 6) that belongs to ``d`` is the inverse of the element's exact flexibility under loads at
its nodes (Magnus' expansion: a linearly varying curvature appears in ``d`` as a shear of length^3 / 12 times
its slope; MacNeal 1978 found the same "residual bending flexibility" for the linear element). So one element
is exact in small bending under nodal loads, where the bare helix would be wrong by length^2.

Inertia is integrated at Gauss points with the exact velocity and acceleration of the helix.

Shapes: n nodes, e elements, g Gauss points. ``ends`` (e, 2) nodes; ``rest`` (e, 6); ``stiffness`` (e, 6, 6);
``damping`` (e,) s; ``mass`` (e, g, 6, 6) spatial inertia of a section times weight and length; ``gauss``
(g,). Poses R (n, 3, 3), x (n, 3); twists V and their rates A (n, 6) in node axes.
"""

from __future__ import annotations

from morphcore.jit import entry_kernel, kernel
from morphcore.multibody.kernels.se3 import (
    ad,
    ad_transposed,
    add_from_body,
    composed_pose,
    exponential,
    inverse_tangent,
    inverse_tangent_coefficients,
    inverse_tangent_transposed,
    logarithm,
    relative_pose,
    tangent,
    tangent_terms,
    tangent_transposed,
    tangent_with_rate,
    to_body,
)

VECTOR_SCRATCH = 24  # rows of six numbers
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
def element_strain(ends, R, x, V, element, v, poses, d, d_rate):
    """d, its rate, and in v[0], v[1] the rigid part U of V_b and the rest W; False: turned too far.

    ``v`` (4, 6) and ``poses`` (2, 4, 3) are scratch; poses[0] keeps the relative pose.
    """
    a, b = ends[element, 0], ends[element, 1]
    relative_pose(R[a], x[a], R[b], x[b], poses[0, :3], poses[0, 3])
    if not logarithm(poses[0, :3], poses[0, 3], d):
        return False
    to_body(poses[0, :3], poses[0, 3], V[a], v[0])
    for i in range(6):
        v[1, i] = V[b, i] - v[0, i]
    inverse_tangent(d, v[1], 1.0, v[2:4], d_rate)
    return True


@kernel
def internal_force(rest, stiffness, damping, d, d_rate, strain, sigma):
    """sigma = K (d - rest + damping d_rate); strain (6,) is scratch."""
    for i in range(6):
        strain[i] = d[i] - rest[i] + damping * d_rate[i]
    multiply(stiffness, strain, sigma)


@entry_kernel
def beam_forces(
    ends, rest, stiffness, damping, mass, gauss, R, x, V, A, gravity_N, v, poses, strains, rates, out
):
    """Add to out (n, 6) the forces that internal strain, inertia and weight ask of the nodes, in node axes.

    In motion without other loads they vanish. ``strains`` and ``rates`` (e, 6) return d and its rate; ``v``
    (VECTOR_SCRATCH, 6) and ``poses`` (2, 4, 3) are scratch. Returns the number of the first element that
    turned by more than `se3.LARGEST_ANGLE`, else -1.
    """
    for element in range(ends.shape[0]):
        a, b = ends[element, 0], ends[element, 1]
        d, d_rate = strains[element], rates[element]
        if not element_strain(ends, R, x, V, element, v, poses, d, d_rate):
            return element
        rigid, rest_of_twist = v[0], v[1]
        sigma, root_force = v[4], v[5]
        internal_force(rest[element], stiffness[element], damping[element], d, d_rate, v[6], sigma)
        # d'' from A_b = Ad A_a - ad(W) U + T' d' + T d''
        terms = tangent_terms(d)
        for i in range(6):
            v[7, i] = 0.0
        tangent_with_rate(d, d_rate, 1.0, d_rate, v[7], terms, v[2:4], v[8], v[9])
        to_body(poses[0, :3], poses[0, 3], A[a], v[10])
        ad(rest_of_twist, rigid, v[11])
        for i in range(6):
            v[7, i] = A[b, i] - v[10, i] + v[11, i] - v[9, i]
        inverse_tangent(d, v[7], 1.0, v[2:4], v[12])
        gravity_a = v[13]
        for i in range(3):
            gravity_a[i] = R[a, 0, i] * gravity_N[0] + R[a, 1, i] * gravity_N[1] + R[a, 2, i] * gravity_N[2]
            root_force[i], root_force[3 + i] = 0.0, 0.0
        for point in range(gauss.size):
            s = gauss[point]
            for i in range(6):
                v[14, i] = s * d[i]
            E, offset = poses[1, :3], poses[1, 3]
            exponential(v[14], E, offset)
            to_body(E, offset, V[a], v[15])
            tangent_with_rate(d, d_rate, s, d_rate, v[12], terms, v[2:4], v[8], v[9])
            for i in range(6):
                v[8, i] *= s
            ad(v[8], v[15], v[16])
            to_body(E, offset, A[a], v[17])
            twist, acceleration = v[18], v[19]
            for i in range(6):
                twist[i] = v[15, i] + v[8, i]
                acceleration[i] = v[17, i] - v[16, i] + s * v[9, i]
            for i in range(3):
                acceleration[3 + i] -= (
                    E[0, i] * gravity_a[0] + E[1, i] * gravity_a[1] + E[2, i] * gravity_a[2]
                )
            # Newton and Euler: I a + v x* I v
            section = mass[element, point]
            multiply(section, twist, v[20])
            ad_transposed(twist, v[20], v[21])
            multiply(section, acceleration, v[22])
            for i in range(6):
                v[22, i] -= v[21, i]
            tangent_transposed(d, s, v[22], terms, v[2], v[23])
            add_from_body(E, offset, v[22], root_force)
            for i in range(6):
                sigma[i] += s * v[23, i]
        even, odd = v[6], v[7]
        inverse_tangent_transposed(d, sigma, v[2:4], even, odd)
        for i in range(6):
            out[a, i] += odd[i] - even[i] + root_force[i]
            out[b, i] += odd[i] + even[i]
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
    """Add to out (n, 6) what inertia and weight of bodies (k, 6, 6) ask of the nodes (k,) they sit on."""
    for k in range(nodes.size):
        node = nodes[k]
        gravity = v[4]
        for i in range(3):
            gravity[i] = (
                R[node, 0, i] * gravity_N[0] + R[node, 1, i] * gravity_N[1] + R[node, 2, i] * gravity_N[2]
            )
        body_force(inertia[k], V[node], A[node], gravity, v, out[node])


@entry_kernel
def section_motion(ends, fractions, elements, R, x, V, strains, rates, v, poses, R_out, x_out, V_out):
    """Poses and twists of sections: section k at ``fractions[k]`` of ``elements[k]``, for strains as given.

    R_out (k, 3, 3), x_out (k, 3), V_out (k, 6) in the section's own axes. An element below zero, -1 - node,
    stands for that node itself.
    """
    for k in range(elements.size):
        element = elements[k]
        if element < 0:
            node = -1 - element
            R_out[k] = R[node]
            x_out[k] = x[node]
            V_out[k] = V[node]
            continue
        a, s = ends[element, 0], fractions[k]
        d = strains[element]
        for i in range(6):
            v[0, i] = s * d[i]
        exponential(v[0], poses[0, :3], poses[0, 3])
        composed_pose(R[a], x[a], poses[0, :3], poses[0, 3], R_out[k], x_out[k])
        to_body(poses[0, :3], poses[0, 3], V[a], v[1])
        tangent(d, s, rates[element], tangent_terms(d), v[2], v[3])
        for i in range(6):
            V_out[k, i] = v[1, i] + s * v[3, i]


@entry_kernel
def add_section_forces(ends, fractions, elements, strains, forces, v, poses, out):
    """Subtract from out (n, 6) the nodes' share of force vectors (k, 6) on sections, by virtual work."""
    for k in range(elements.size):
        element = elements[k]
        if element < 0:
            for i in range(6):
                out[-1 - element, i] -= forces[k, i]
            continue
        a, b, s = ends[element, 0], ends[element, 1], fractions[k]
        d = strains[element]
        for i in range(6):
            v[0, i] = s * d[i]
            v[1, i] = 0.0
        exponential(v[0], poses[0, :3], poses[0, 3])
        add_from_body(poses[0, :3], poses[0, 3], forces[k], v[1])
        tangent_transposed(d, s, forces[k], tangent_terms(d), v[2], v[3])
        for i in range(6):
            v[3, i] *= s
        inverse_tangent_transposed(d, v[3], v[4:6], v[6], v[7])
        for i in range(6):
            out[a, i] -= v[7, i] - v[6, i] + v[1, i]
            out[b, i] -= v[7, i] + v[6, i]


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

    ``tangents`` (e, 12, 12) of the elements; ``diagonals`` (n, 6, 6) come with what sits on the nodes beside
    the elements and go with the condensed matrices; a root's is then the whole chain's as felt there.
    ``inverses`` and ``couplings`` (e, 6, 6) belong to each element's outer node: its inverse, and the inverse
    times the coupling to the inner node.
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
    """Roots -> tips: from condensed right sides (n, 6) with the roots' solution to the solution."""
    for element in range(ends.shape[0]):
        a, b = ends[element, 0], ends[element, 1]
        for i in range(6):
            total = 0.0
            for j in range(6):
                total += couplings[element, i, j] * right[a, j]
            right[b, i] -= total
