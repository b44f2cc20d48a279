"""The group SE(3) of poses: exponential, logarithm, inverse of their tangent, for beams in large rotation.

A pose is a rotation R (3, 3), body components to reference components, with a position x (3,). A twist is
[omega; v] in body components, angular part first, and so is the logarithm ``d`` of a relative pose: H_b = H_a
exp(d). ``ad(d)`` is the Lie bracket, Featherstone's (2008, equation 2.31) motion cross product.

Tangents: (exp d)^-1 d/dt exp(d) = T(d) d', T(d) = sum (-1)^k ad(d)^k / (k + 1)!. Sources: Sonneville, Cardona
& Brüls (2014), appendix A; Bullo & Murray (1995) for the closed form of the inverse.
"""

from __future__ import annotations

import math

from morphcore.jit import kernel

# B_2k / (2 k)! with the Bernoulli numbers, k = 0..12: x / 2 coth(x / 2) = sum b_k x^(2 k). The series in the
# angle of an element converges like (angle / 2 pi)^(2 k): to 1e-12 at LARGEST_ANGLE.
BERNOULLI = (
    1.0,
    8.3333333333333329e-02,
    -1.3888888888888889e-03,
    3.3068783068783071e-05,
    -8.2671957671957675e-07,
    2.0876756987868100e-08,
    -5.2841901386874934e-10,
    1.3382536530684679e-11,
    -3.3896802963225829e-13,
    8.5860620562778445e-15,
    -2.1748686985580619e-16,
    5.5090028283602295e-18,
    -1.3954464685812522e-19,
)
LARGEST_ANGLE = 1.5  # rad, of one element's relative rotation


@kernel
def cross(a, b, out):
    """out = a x b, each (3,)."""
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]


@kernel
def ad(d, x, out):
    """out = ad(d) x = [omega x x_omega; v x x_omega + omega x x_v]; out must not be x."""
    out[0] = d[1] * x[2] - d[2] * x[1]
    out[1] = d[2] * x[0] - d[0] * x[2]
    out[2] = d[0] * x[1] - d[1] * x[0]
    out[3] = d[4] * x[2] - d[5] * x[1] + d[1] * x[5] - d[2] * x[4]
    out[4] = d[5] * x[0] - d[3] * x[2] + d[2] * x[3] - d[0] * x[5]
    out[5] = d[3] * x[1] - d[4] * x[0] + d[0] * x[4] - d[1] * x[3]


@kernel
def ad_transposed(d, f, out):
    """out = ad(d)^T f for a force [n; f] = [n x omega + f x v; f x omega]; out must not be f."""
    out[0] = f[1] * d[2] - f[2] * d[1] + f[4] * d[5] - f[5] * d[4]
    out[1] = f[2] * d[0] - f[0] * d[2] + f[5] * d[3] - f[3] * d[5]
    out[2] = f[0] * d[1] - f[1] * d[0] + f[3] * d[4] - f[4] * d[3]
    out[3] = f[4] * d[2] - f[5] * d[1]
    out[4] = f[5] * d[0] - f[3] * d[2]
    out[5] = f[3] * d[1] - f[4] * d[0]


@kernel
def rotation_exponential(w, R):
    """R = exp(w) by Rodrigues' formula, w (3,) in rad."""
    z = w[0] * w[0] + w[1] * w[1] + w[2] * w[2]
    if z < 1e-6:
        s = 1.0 - z / 6.0 * (1.0 - z / 20.0)
        c = 0.5 - z / 24.0 * (1.0 - z / 30.0)
    else:
        angle = math.sqrt(z)
        s = math.sin(angle) / angle
        half = math.sin(0.5 * angle) / angle
        c = 2.0 * half * half
    for i in range(3):
        for j in range(3):
            R[i, j] = c * w[i] * w[j]
        R[i, i] += 1.0 - c * z
    R[0, 1] -= s * w[2]
    R[0, 2] += s * w[1]
    R[1, 0] += s * w[2]
    R[1, 2] -= s * w[0]
    R[2, 0] -= s * w[1]
    R[2, 1] += s * w[0]


@kernel
def exponential(d, R, x):
    """Pose exp(d): R as above and x = (I + c w~ + e w~ w~) v, the mean of the rotation on the way."""
    w, v = d[:3], d[3:]
    rotation_exponential(w, R)
    z = w[0] * w[0] + w[1] * w[1] + w[2] * w[2]
    if z < 1e-4:
        c = 0.5 - z / 24.0 * (1.0 - z / 30.0 * (1.0 - z / 56.0))
        e = 1.0 / 6.0 - z / 120.0 * (1.0 - z / 42.0 * (1.0 - z / 72.0))
    else:
        angle = math.sqrt(z)
        half = math.sin(0.5 * angle) / angle
        c = 2.0 * half * half
        e = (1.0 - math.sin(angle) / angle) / z
    ax = w[1] * v[2] - w[2] * v[1]
    ay = w[2] * v[0] - w[0] * v[2]
    az = w[0] * v[1] - w[1] * v[0]
    x[0] = v[0] + c * ax + e * (w[1] * az - w[2] * ay)
    x[1] = v[1] + c * ay + e * (w[2] * ax - w[0] * az)
    x[2] = v[2] + c * az + e * (w[0] * ay - w[1] * ax)


@kernel
def even_series(z):
    """sum over k >= 1 of b_k z^(k - 1), z = -(angle)^2."""
    total = 0.0
    for k in range(12, 0, -1):
        total = total * z + BERNOULLI[k]
    return total


@kernel
def even_series_with_slope(z):
    """`even_series` and its derivative by z."""
    total, slope = 0.0, 0.0
    for k in range(12, 0, -1):
        slope = slope * z + total
        total = total * z + BERNOULLI[k]
    return total, slope


@kernel
def logarithm(R, x, d):
    """Logarithm d (6,) of a pose that turns by less than LARGEST_ANGLE; returns False otherwise."""
    sx, sy, sz = 0.5 * (R[2, 1] - R[1, 2]), 0.5 * (R[0, 2] - R[2, 0]), 0.5 * (R[1, 0] - R[0, 1])
    sine2 = sx * sx + sy * sy + sz * sz
    cosine = 0.5 * (R[0, 0] + R[1, 1] + R[2, 2] - 1.0)
    if not sine2 < 1.1 or not abs(cosine) < 1.1:
        return False
    if sine2 < 1e-6 and cosine > 0.0:
        ratio = 1.0 + sine2 / 6.0 * (1.0 + 0.45 * sine2)
    else:
        sine = math.sqrt(sine2)
        ratio = math.atan2(sine, cosine) / max(sine, 1e-300)
    wx, wy, wz = ratio * sx, ratio * sy, ratio * sz
    z = -(wx * wx + wy * wy + wz * wz)
    if not z > -LARGEST_ANGLE * LARGEST_ANGLE:
        return False
    # v = (I - w~ / 2 + e w~ w~) x
    e = even_series(z)
    ax, ay, az = wy * x[2] - wz * x[1], wz * x[0] - wx * x[2], wx * x[1] - wy * x[0]
    d[0], d[1], d[2] = wx, wy, wz
    d[3] = x[0] - 0.5 * ax + e * (wy * az - wz * ay)
    d[4] = x[1] - 0.5 * ay + e * (wz * ax - wx * az)
    d[5] = x[2] - 0.5 * az + e * (wx * ay - wy * ax)
    return True


@kernel
def inverse_tangent_coefficients(z):
    """c2, c4 and their derivatives by z of T(d)^-1 = I + ad / 2 + c2 ad^2 + c4 ad^4, z = -(angle)^2.

    On se(3) ad (ad^2 - z)^2 = 0, so that x / 2 coth(x / 2) and its derivative at ad^2 = z give both:
    c4 = sum (k - 1) b_k z^(k - 2) over k >= 2, c2 = sum (2 - k) b_k z^(k - 1) over k >= 1.
    """
    c2, c4, c2_z, c4_z = 0.0, 0.0, 0.0, 0.0
    for k in range(12, 0, -1):
        c2_z = c2_z * z + c2
        c2 = c2 * z + (2 - k) * BERNOULLI[k]
        if k > 1:
            c4_z = c4_z * z + c4
            c4 = c4 * z + (k - 1) * BERNOULLI[k]
    return c2, c4, c2_z, c4_z


@kernel
def to_body(R, x, motion, out):
    """Adjoint of the inverse pose: transforms a motion vector from the reference frame to the body at (R, x).

    out = [R^T omega; R^T (v + omega x x)]; out must not be motion.
    """
    wx, wy, wz = motion[0], motion[1], motion[2]
    vx = motion[3] + wy * x[2] - wz * x[1]
    vy = motion[4] + wz * x[0] - wx * x[2]
    vz = motion[5] + wx * x[1] - wy * x[0]
    for i in range(3):
        out[i] = R[0, i] * wx + R[1, i] * wy + R[2, i] * wz
        out[3 + i] = R[0, i] * vx + R[1, i] * vy + R[2, i] * vz


@kernel
def add_from_body(R, x, force, out):
    """Transpose of ``to_body``: adds to out a force vector at the body (R, x), in the reference frame."""
    fx = R[0, 0] * force[3] + R[0, 1] * force[4] + R[0, 2] * force[5]
    fy = R[1, 0] * force[3] + R[1, 1] * force[4] + R[1, 2] * force[5]
    fz = R[2, 0] * force[3] + R[2, 1] * force[4] + R[2, 2] * force[5]
    out[0] += R[0, 0] * force[0] + R[0, 1] * force[1] + R[0, 2] * force[2] + x[1] * fz - x[2] * fy
    out[1] += R[1, 0] * force[0] + R[1, 1] * force[1] + R[1, 2] * force[2] + x[2] * fx - x[0] * fz
    out[2] += R[2, 0] * force[0] + R[2, 1] * force[1] + R[2, 2] * force[2] + x[0] * fy - x[1] * fx
    out[3] += fx
    out[4] += fy
    out[5] += fz


@kernel
def relative_pose(R_a, x_a, R_b, x_b, R, x):
    """Pose of b seen from a: R = R_a^T R_b, x = R_a^T (x_b - x_a)."""
    dx, dy, dz = x_b[0] - x_a[0], x_b[1] - x_a[1], x_b[2] - x_a[2]
    for i in range(3):
        x[i] = R_a[0, i] * dx + R_a[1, i] * dy + R_a[2, i] * dz
        for j in range(3):
            R[i, j] = R_a[0, i] * R_b[0, j] + R_a[1, i] * R_b[1, j] + R_a[2, i] * R_b[2, j]


@kernel
def composed_pose(R_a, x_a, R, x, R_out, x_out):
    """Pose H_a H: R_out = R_a R, x_out = x_a + R_a x; the outputs must not be the inputs."""
    for i in range(3):
        x_out[i] = x_a[i] + R_a[i, 0] * x[0] + R_a[i, 1] * x[1] + R_a[i, 2] * x[2]
        for j in range(3):
            R_out[i, j] = R_a[i, 0] * R[0, j] + R_a[i, 1] * R[1, j] + R_a[i, 2] * R[2, j]
