"""The arm in MuJoCo, on position servos."""

from types import ModuleType
from typing import Any

import numpy as np

from kinarm.errors import needed
from kinarm.kernels.compiling import Array
from kinarm.mjcf import mjcf
from kinarm.policies.running.backend import SimulatedArm
from kinarm.world import World

SUBSTEP, ARMATURE, BANDWIDTH = 0.0005, 100.0, 20.0
"""Time step of MuJoCo [s], inertia of the geared motors, beside which that of links hardly counts
[kg m2], and natural frequency of servos of which the plant says nothing [Hz]."""


def servo_model(mujoco: ModuleType, world: World, bandwidth: float) -> Any:
    """A model of MuJoCo whose joints have critically damped servos of a bandwidth [Hz]."""
    model = mujoco.MjModel.from_xml_string(mjcf(world, SUBSTEP))
    model.dof_armature[:] = ARMATURE
    data, inertia = mujoco.MjData(model), np.zeros((model.nv, model.nv))
    mujoco.mj_forward(model, data)
    mujoco.mj_fullM(model, data, inertia)
    moved, rate = np.diag(inertia), 2.0 * np.pi * bandwidth
    model.actuator_gainprm[:, 0] = moved * rate**2
    model.actuator_biasprm[:, 1] = -moved * rate**2
    model.actuator_biasprm[:, 2] = -2.0 * moved * rate
    return model


class MujocoArm(SimulatedArm):
    """The arm of a world in MuJoCo, which stops if it touches something.

    Joints that actions do not move are at home.

    Parameters
    ----------
    world : World
        Arm and scene.
    start : ndarray, shape (n_joints,)
        Where it rests [rad or m].
    bandwidth : float
        Natural frequency of its servos [Hz].
    """

    def __init__(self, world: World, start: Array, bandwidth: float = BANDWIDTH) -> None:
        self._mujoco = needed("mujoco", "mujoco", "mujoco")
        self.joint_names, self._home = world.arm.joint_names, world.arm.home
        self._model = servo_model(self._mujoco, world, bandwidth)
        shapes = world.contact_model.geometry.geometryObjects
        self._names = {f"shape{number}": shape.name for number, shape in enumerate(shapes)}
        self.start, self._state = np.array(start, dtype=float), self._mujoco.MjData(self._model)

    def connect(self, period: float) -> None:
        """Rest at the start."""
        self.time, self.period, state = 0.0, period, self._state
        self._mujoco.mj_resetData(self._model, state)
        state.qpos[:] = state.ctrl[:] = self.start[: self._model.nq]
        self._mujoco.mj_forward(self._model, state)

    def read(self) -> Array:
        """Where the joints are."""
        return np.concatenate([self._state.qpos, self._home[self._model.nq :]])

    def command(self, positions: Array) -> None:
        """Set what the servos hold."""
        self._state.ctrl[:] = positions[: self._model.nq]

    def advance(self) -> None:
        """Move on by a period."""
        until = self.time + self.period
        while self._state.time + 0.5 * SUBSTEP < until:
            self._mujoco.mj_step(self._model, self._state)
        for contact in self._state.contact[: self._state.ncon]:
            names = (self._names[self._model.geom(geom).name] for geom in contact.geom)
            raise ConnectionError(f"the arm stopped, for {' touches '.join(names)}")

    def stop(self) -> None:
        """Hold the joints where they are."""
        self._state.ctrl[:] = self._state.qpos
