"""The arm in MuJoCo, on position servos."""

from types import ModuleType
from typing import Any

import numpy as np
import pinocchio as pin

from kinarm.chain import quaternion_of
from kinarm.errors import needed
from kinarm.kernels.compiling import Array
from kinarm.policies.running.backend import SimulatedArm
from kinarm.world import World

SUBSTEP, ARMATURE, BANDWIDTH = 0.0005, 100.0, 20.0
"""Time step of MuJoCo [s], inertia of the geared motors, beside which that of links hardly counts
[kg m2], and natural frequency of servos of which the plant says nothing [Hz]."""


def arm_spec(mujoco: ModuleType, world: World, time_step: float, armature: float) -> Any:
    """An arm for MuJoCo, as a specification that can be added to: ``link0``, the base, and on.

    Links have a mass of 1 kg and no shapes. Joints that actions do not move are left out, at home;
    the others have actuators, whose gains are to be set. There is no gravity, so that servos have
    nothing to hold against.

    Parameters
    ----------
    mujoco : module
        The library.
    world : World
        Its arm is described.
    time_step : float
        Time step [s].
    armature : float
        Inertia of the motors [kg m2].
    """
    arm, spec = world.arm, mujoco.MjSpec()
    spec.compiler.degree = False
    spec.option.timestep, spec.option.gravity = time_step, np.zeros(3)
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    data, chain = arm.model.createData(), arm.chain
    pin.forwardKinematics(arm.model, data, arm.home)
    body = spec.worldbody.add_body(name="link0")
    for k in range(arm.n_joints):
        moves = k < arm.n_actuated
        placement = arm.model.jointPlacements[k + 1] if moves else data.liMi[k + 1]
        turn = quaternion_of(placement.rotation)
        body = body.add_body(name=f"link{k + 1}", pos=placement.translation, quat=turn)
        body.explicitinertial, body.ipos = True, np.zeros(3)
        body.mass, body.inertia = 1.0, np.full(3, 0.01)
        if moves:
            slides = chain.prismatic[k]
            kind = mujoco.mjtJoint.mjJNT_SLIDE if slides else mujoco.mjtJoint.mjJNT_HINGE
            limits = [chain.lower[k], chain.upper[k]]
            joint = body.add_joint(name=f"joint{k + 1}", type=kind, axis=chain.axis[k])
            joint.range, joint.armature = limits, armature
            servo = spec.add_actuator(target=joint.name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
            servo.biastype, servo.ctrlrange = mujoco.mjtBias.mjBIAS_AFFINE, limits
    return spec


def set_servos(model: Any, stiffness: Any, damping: Any) -> None:
    """Let a model's actuators be position servos; both shape (n_actuated,) or the same for all."""
    model.actuator_gainprm[:, 0] = stiffness
    model.actuator_biasprm[:, 1] = -stiffness
    model.actuator_biasprm[:, 2] = -damping


def servo_model(mujoco: ModuleType, world: World, bandwidth: float) -> Any:
    """A model of MuJoCo whose joints have critically damped servos of a bandwidth [Hz]."""
    model = arm_spec(mujoco, world, SUBSTEP, ARMATURE).compile()
    moved, rate = model.dof_M0, 2.0 * np.pi * bandwidth  # the mass that each joint moves at zero
    set_servos(model, moved * rate**2, 2.0 * moved * rate)
    return model


class MujocoArm(SimulatedArm):
    """The arm of a world in MuJoCo, which stops if kinarm finds that a period's motion touches.

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
        self._world, self._model = world, servo_model(self._mujoco, world, bandwidth)
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
        before, until = self.read(), self.time + self.period
        while self._state.time + 0.5 * SUBSTEP < until:
            self._mujoco.mj_step(self._model, self._state)
        pair = self._world.contact_pair(before, self.read())
        if pair is not None:
            raise ConnectionError(f"the arm stopped, for {' touches '.join(pair)}")

    def stop(self) -> None:
        """Hold the joints where they are."""
        self._state.ctrl[:] = self._state.qpos
