"""The forced tree (forced_tree.py) in MuJoCo, at its full speed.

No Python and no contact, constraint, limit or sensor takes part in a step. The hinges' motion is prescribed
by armature: with one of 1e9 kg m^2 on the hinge's own coordinate and a motor of that gear, the control *is*
the hinge's acceleration, to 1e-6, at the price of one multiplication; the armature adds nothing to what the
fuselage feels. The wrench on the fuselage is one motor at a site. Controls are constant over half a flight,
so a half is one call of ``mj_step`` with its number of steps, and nothing is recorded.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import mujoco
import numpy as np

from benchmarks.forced_tree import (
    DURATION_S,
    FORCE_B,
    MOMENT_B,
    OUTPUT_S,
    START_EULER,
    START_RATES_B,
    START_VELOCITY_B,
    schedules,
)
from benchmarks.setting import Array
from morphcore.frames import quaternion_from_euler, rotation_from_quaternion
from morphcore.models.equivalent import ChainModel, ParameterBatch
from tests.oracles.chain_tree import chain_tree
from tests.oracles.mjcf import mjcf

ARMATURE = 1e9  # kg m^2; the wings' own inertia about the hinge is below 1e3
_PREFIX = "mjINT_"
INTEGRATORS = {
    name.removeprefix(_PREFIX).lower(): value
    for name, value in vars(mujoco.mjtIntegrator).items()
    if name.startswith(_PREFIX)
}
IDLE = ("constraint", "equality", "frictionloss", "limit", "contact", "clampctrl", "warmstart", "sensor")


class ForcedMujoco:
    """One parameter set's tree, ready to fly.

    Parameters
    ----------
    integrator : one of INTEGRATORS.
    """

    def __init__(self, model: ChainModel, batch: ParameterBatch, integrator: str) -> None:
        quaternion = quaternion_from_euler(*START_EULER)
        document = mjcf(chain_tree(model, batch), quaternion=quaternion, gravity_N=(0.0, 0.0, 0.0))
        self.model: Any = mujoco.MjModel.from_xml_string(_driven(document, len(schedules(model))))
        self.model.opt.integrator = int(INTEGRATORS[integrator])
        for name in IDLE:
            self.model.opt.disableflags |= int(getattr(mujoco.mjtDisableBit, f"mjDSBL_{name.upper()}"))
        self.data: Any = mujoco.MjData(self.model)
        self._accelerations = np.array([each.acceleration for each in schedules(model)])
        self._velocity = np.concatenate(
            [rotation_from_quaternion(quaternion) @ START_VELOCITY_B, START_RATES_B]
        )

    def reset(self, step_s: float) -> None:
        """Back to the start."""
        self.model.opt.timestep = step_s
        mujoco.mj_resetData(self.model, self.data)
        self.data.qvel[:6] = self._velocity

    def fly(self, step_s: float) -> None:
        """The whole flight, nothing recorded; `reset` comes before."""
        half = round(0.5 * DURATION_S / step_s)
        for sign in (1.0, -1.0):
            self.data.ctrl[:] = [1.0, *(sign * self._accelerations)]
            mujoco.mj_step(self.model, self.data, nstep=half)

    def attitudes(self, step_s: float) -> Array:
        """Quaternions (k, 4) at the output times; not finite from where it diverged."""
        self.reset(step_s)
        outputs, every = round(DURATION_S / OUTPUT_S), round(OUTPUT_S / step_s)
        kept = [self.data.qpos[3:7].copy()]
        for i in range(outputs):
            sign = 1.0 if i < outputs // 2 else -1.0
            self.data.ctrl[:] = [1.0, *(sign * self._accelerations)]
            mujoco.mj_step(self.model, self.data, nstep=every)
            kept.append(self.data.qpos[3:7].copy())
        found = np.array(kept)
        # MuJoCo resets itself when its state has become too large
        return found if not self.data.warning.number.any() else np.full_like(found, np.nan)


@contextmanager
def quiet() -> Iterator[None]:
    """Suppress MuJoCo's warnings about diverging flights inside the block: they are expected."""
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(_ignore)
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(before)


def _ignore(message: str) -> None:
    pass


def _driven(document: str, hinges: int) -> str:
    """The tree with motors on fuselage and hinges."""
    root = ET.fromstring(document)  # noqa: S314 - our own text
    base = root.find("worldbody/body")
    if base is None:
        raise ValueError("the tree has no base")
    ET.SubElement(base, "site", name="pushed")
    actuators = ET.SubElement(root, "actuator")
    wrench = " ".join(repr(float(value)) for value in (*FORCE_B, *MOMENT_B))
    ET.SubElement(actuators, "general", site="pushed", gear=wrench)
    for i in range(hinges):
        joint = root.find(f".//joint[@name='hinge_{i}']")
        if joint is None:
            raise ValueError(f"the tree has no hinge {i}")
        joint.set("armature", repr(ARMATURE))
        ET.SubElement(actuators, "general", joint=f"hinge_{i}", gear=f"{ARMATURE!r} 0 0 0 0 0")
    return ET.tostring(root, encoding="unicode")
