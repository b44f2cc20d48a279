"""Trees and motions to test with: the reference aircraft's chains, and random ones of every kind."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from morphcore.frames import quaternion_from_euler
from tests.oracles.dynamics import Motion
from tests.oracles.tree import Tree, spatial_inertia

Array = NDArray[np.float64]

FUSELAGE_M = (5.0, 0.7, 0.5)
WING_M = (0.3, 3.0, 0.1)  # chord, span, thickness
DENSITY_KG_M3 = 500.0
YOUNGS_MODULUS_PA = 2.1e9
SHEAR_MODULUS_PA = YOUNGS_MODULUS_PA / 2.6
STIFFNESS_DAMPING_S = 0.004
EI_FLAP = YOUNGS_MODULUS_PA * WING_M[0] * WING_M[2] ** 3 / 12
EI_LAG = YOUNGS_MODULUS_PA * WING_M[2] * WING_M[0] ** 3 / 12
GJ = SHEAR_MODULUS_PA * 0.263 * WING_M[0] * WING_M[2] ** 3


def box_inertia(size: Sequence[float], density: float, centre: Sequence[float]) -> Array:
    """Spatial inertia of a uniform box of edges ``size``, its middle at ``centre``."""
    x, y, z = size
    mass = density * x * y * z
    inertia = mass / 12 * np.diag([y**2 + z**2, x**2 + z**2, x**2 + y**2])
    return spatial_inertia(mass, np.asarray(centre, dtype=np.float64), inertia)


@dataclass
class Builder:
    """Collects bodies and makes a tree of them."""

    rows: list[tuple[int, int, float, Array, Array, int, int]] = field(default_factory=list)
    stiffness: list[float] = field(default_factory=list)
    damping: list[float] = field(default_factory=list)
    hinges: int = 0

    def base(self, inertia: Array) -> int:
        """Add the fuselage."""
        self.rows.append((-1, -1, 1.0, np.zeros(3), inertia, -1, -1))
        return 0

    def hinge(self, parent: int, axis: int, sign: float, offset: Array, inertia: Array) -> int:
        """Add a body on a prescribed hinge."""
        self.rows.append((parent, axis, sign, offset, inertia, -1, self.hinges))
        self.hinges += 1
        return len(self.rows) - 1

    def joint(
        self, parent: int, axis: int, sign: float, offset: Array, inertia: Array, spring: tuple[float, float]
    ) -> int:
        """Add a body on a free joint of (stiffness, damping)."""
        self.rows.append((parent, axis, sign, offset, inertia, len(self.stiffness), -1))
        self.stiffness.append(spring[0])
        self.damping.append(spring[1])
        return len(self.rows) - 1

    def tree(self) -> Tree:
        """The finished tree."""
        parent, axis, sign, offset, inertia, coordinate, hinge = zip(*self.rows, strict=True)
        return Tree(
            parent=np.array(parent, dtype=np.int64),
            axis=np.array(axis, dtype=np.int64),
            sign=np.array(sign, dtype=np.float64),
            offset_P=np.array(offset, dtype=np.float64),
            inertia=np.array(inertia, dtype=np.float64),
            coordinate=np.array(coordinate, dtype=np.int64),
            hinge=np.array(hinge, dtype=np.int64),
            stiffness=np.array(self.stiffness, dtype=np.float64),
            damping=np.array(self.damping, dtype=np.float64),
        )


def reference_tree(
    links: int = 3, fractions: Sequence[float] | None = None, damping_s: float = STIFFNESS_DAMPING_S
) -> Tree:
    """The reference aircraft: two wings of some links and one gimbal fewer, stiffnesses of the beam."""
    lengths = WING_M[1] * np.asarray(np.full(links, 1 / links) if fractions is None else fractions)
    builder = Builder()
    fuselage = builder.base(box_inertia(FUSELAGE_M, DENSITY_KG_M3, (0, 0, 0)))
    for side in (1.0, -1.0):
        inertias = [
            box_inertia((WING_M[0], length, WING_M[2]), DENSITY_KG_M3, (0, side * length / 2, 0))
            for length in lengths
        ]
        link = builder.hinge(fuselage, 2, side, np.array([0, side * FUSELAGE_M[1] / 2, 0]), inertias[0])
        for i in range(1, links):
            between = 0.5 * (lengths[i - 1] + lengths[i])
            offset = np.array([0, side * lengths[i - 1], 0])
            for axis, rigidity in enumerate((EI_FLAP, GJ, EI_LAG)):
                stiffness = rigidity / between
                inertia = inertias[i] if axis == 2 else np.zeros((6, 6))
                link = builder.joint(link, axis, 1.0, offset, inertia, (stiffness, damping_s * stiffness))
                offset = np.zeros(3)
    return builder.tree()


def random_inertia(rng: np.random.Generator) -> Array:
    """Spatial inertia of a few uneven point masses: physical, full, and centred nowhere special."""
    points, masses = rng.normal(size=(5, 3)), rng.uniform(0.2, 2.0, size=5)
    return np.asarray(
        sum(spatial_inertia(m, p, np.zeros((3, 3))) for m, p in zip(masses, points, strict=True))
    )


def random_tree(rng: np.random.Generator, *, gimbals: int = 4, surfaces: int = 3) -> Tree:
    """Several surfaces, hinged about any axis or straight on a gimbal, with up to ``gimbals`` gimbals each.

    General offsets, also between the massless frames of a gimbal, both signs, single joints among the
    gimbals, branches.
    """
    builder = Builder()
    fuselage = builder.base(10 * random_inertia(rng))
    for _ in range(surfaces):
        link = fuselage
        if rng.random() < 0.75:
            link = builder.hinge(
                link, int(rng.integers(3)), _sign(rng), rng.normal(size=3), random_inertia(rng)
            )
        roots = [link]
        for _ in range(int(rng.integers(gimbals + 1))):
            parent = roots[int(rng.integers(len(roots)))]
            axes = (0, 1, 2) if rng.random() < 0.7 else (int(rng.integers(3)),)
            for axis in axes:
                inertia = random_inertia(rng) if axis == axes[-1] else np.zeros((6, 6))
                spring = (rng.uniform(0, 50), rng.uniform(0, 5))
                parent = builder.joint(parent, axis, _sign(rng), rng.normal(size=3), inertia, spring)
            roots.append(parent)
    return builder.tree()


def random_motion(rng: np.random.Generator, tree: Tree, *, angle_rad: float = 1.0) -> Motion:
    """A state of order one in everything; joint angles within ``angle_rad``, clear of gimbal lock at pi/2."""
    n, m = tree.coordinates, tree.hinges
    return Motion(
        quaternion=quaternion_from_euler(*rng.uniform(-1.4, 1.4, size=3)),
        twist_B=rng.normal(size=6),
        q_joint=rng.uniform(-angle_rad, angle_rad, size=n),
        v_joint=rng.normal(size=n),
        hinge_angle=rng.uniform(-1.2, 1.2, size=m),
        hinge_rate=rng.normal(size=m),
        hinge_acceleration=rng.normal(size=m),
        position_N=rng.normal(size=3),
    )


def massive_bodies(tree: Tree) -> NDArray[np.bool_]:
    """Which bodies have mass, (b,): all but the inner frames of the gimbals."""
    return tree.inertia[:, 3, 3] > 0


def random_wrench(rng: np.random.Generator, tree: Tree, size: float = 10.0) -> Array:
    """External wrenches (b, 6) on all bodies that have mass."""
    return size * rng.normal(size=(tree.bodies, 6)) * massive_bodies(tree)[:, None]


def undamped(tree: Tree) -> Tree:
    """The same tree without joint dampers."""
    return replace(tree, damping=np.zeros(tree.coordinates))


def _sign(rng: np.random.Generator) -> float:
    return 1.0 if rng.random() < 0.5 else -1.0
