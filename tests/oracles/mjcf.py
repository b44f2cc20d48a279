"""The tree as a MuJoCo model (MJCF): free joint, hinge joints with springs and dampers, exact inertias.

MuJoCo refuses moving bodies without mass, so a chain of massless frames becomes several hinge joints in the
body at its end: MuJoCo applies the joints of one body in sequence, each about its axis as turned by those
before it, at its own anchor. The world's axes stay those of N, with z down; gravity is an option of the
model.

Names: body ``body_<b>`` (only bodies with mass), joint ``base``, ``joint_<coordinate>``, ``hinge_<hinge>``.
The prescribed hinges are plain joints: the caller sets their motion.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from morphcore.errors import InvalidInput
from tests.oracles.tree import Tree

Array = NDArray[np.float64]

STANDARD_GRAVITY_N = (0.0, 0.0, 9.80665)  # m/s^2, down


def mjcf(
    tree: Tree,
    *,
    quaternion: ArrayLike = (1.0, 0.0, 0.0, 0.0),
    position_N: ArrayLike = (0.0, 0.0, 0.0),
    gravity_N: ArrayLike = STANDARD_GRAVITY_N,
    step_s: float = 1e-3,
    name: str = "aircraft",
) -> str:
    """The tree as an MJCF document, at zero joint angles.

    Parameters
    ----------
    quaternion : (4,) of R_NB, (w, x, y, z), the initial attitude.
    position_N : (3,) initial position of the fuselage reference point, m.
    gravity_N : (3,) m/s^2.
    step_s : MuJoCo's time step, s; its own integrators need it well below the joints' periods.

    Raises
    ------
    InvalidInput : MuJoCo cannot hold the tree: a massless body carries no body or several, or an inertia
        violates the triangle inequality.
    """
    root = ET.Element("mujoco", model=name)
    ET.SubElement(
        root, "compiler", angle="radian", autolimits="true", inertiafromgeom="false", balanceinertia="false",
        boundmass="0", boundinertia="0",
    )  # fmt: skip
    ET.SubElement(
        root, "option", timestep=repr(float(step_s)), gravity=_numbers(gravity_N), integrator="implicitfast"
    )
    world = ET.SubElement(root, "worldbody")
    base = ET.SubElement(
        world, "body", name="body_0", pos=_numbers(position_N), quat=_numbers(_unit(quaternion))
    )
    # align="false": the free joint stays at the reference point, in body axes
    ET.SubElement(base, "freejoint", name="base", align="false")
    base.append(_inertial(tree, 0))
    elements = {0: base}
    for chain in _chains(tree):
        body = chain[-1]
        parent = elements[int(tree.parent[chain[0]])]
        element = ET.SubElement(
            parent, "body", name=f"body_{body}", pos=_numbers(np.sum(tree.offset_P[chain], axis=0))
        )
        for i, joint in enumerate(chain):
            # the anchor as seen from the last body's origin: back along the offsets still to come
            element.append(_joint(tree, joint, -np.sum(tree.offset_P[chain[i + 1 :]], axis=0)))
        element.append(_inertial(tree, body))
        elements[body] = element
    ET.indent(root)
    return ET.tostring(root, encoding="unicode") + "\n"


def _chains(tree: Tree) -> list[list[int]]:
    """Runs of massless bodies, each with the massive body that ends it, parents before children."""
    massless = tree.inertia[:, 3, 3] == 0
    if massless[0]:
        raise InvalidInput("the base has no mass", hint="give the fuselage mass and inertia")
    chains = []
    for body in range(1, tree.bodies):
        if massless[body]:
            carried = np.count_nonzero(tree.parent == body)
            if carried != 1 or np.any(tree.inertia[body]):
                raise InvalidInput(
                    f"massless body {body} carries {carried} bodies",
                    hint="MuJoCo takes massless frames only as parts of one compound joint",
                )
            continue
        chain = [body]
        while massless[tree.parent[chain[0]]]:
            chain.insert(0, int(tree.parent[chain[0]]))
        chains.append(chain)
    return chains


def _joint(tree: Tree, body: int, anchor: Array) -> ET.Element:
    axis = np.zeros(3)
    axis[tree.axis[body]] = tree.sign[body]
    attributes = {"type": "hinge", "axis": _numbers(axis), "pos": _numbers(anchor)}
    coordinate = int(tree.coordinate[body])
    if coordinate < 0:
        return ET.Element("joint", {"name": f"hinge_{int(tree.hinge[body])}", **attributes})
    attributes["stiffness"] = _number(tree.stiffness[coordinate])
    attributes["damping"] = _number(tree.damping[coordinate])
    return ET.Element("joint", {"name": f"joint_{coordinate}", **attributes})


def _inertial(tree: Tree, body: int) -> ET.Element:
    """Mass, centre of mass and inertia about it: Featherstone (2008), equation 2.63 undone."""
    spatial = tree.inertia[body]
    mass = spatial[3, 3]
    moment = 0.5 * (spatial[:3, 3:] - spatial[:3, 3:].T)
    centre = np.array([moment[2, 1], moment[0, 2], moment[1, 0]]) / mass
    about_centre = spatial[:3, :3] - mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    principal = np.linalg.eigvalsh(about_centre)
    if principal[0] <= 0 or principal[2] > (principal[0] + principal[1]) * (1 + 1e-9):
        raise InvalidInput(
            f"no rigid body has the inertia of body {body}: principal moments {principal} kg m^2",
            hint="every principal moment must be positive and at most the sum of the other two",
        )
    attributes = {"mass": _number(mass), "pos": _numbers(centre)}
    diagonal = np.diag(about_centre)
    if np.count_nonzero(about_centre - np.diag(diagonal)):
        xy, xz, yz = about_centre[0, 1], about_centre[0, 2], about_centre[1, 2]
        attributes["fullinertia"] = _numbers([*diagonal, xy, xz, yz])
    else:
        attributes["diaginertia"] = _numbers(diagonal)
    return ET.Element("inertial", attributes)


def _unit(quaternion: ArrayLike) -> Array:
    array = np.asarray(quaternion, dtype=np.float64)
    return array / np.linalg.norm(array)


def _number(value: float) -> str:
    return repr(float(value))


def _numbers(values: ArrayLike | Iterable[float]) -> str:
    return " ".join(_number(v) for v in np.asarray(values, dtype=np.float64))
