"""The slow reference: the simulator's semantics in plain Pinocchio and Coal, step by step.

It shares no kernel with `kinarm.simulator` and asks Coal about every tested configuration. Tests
and ``kinarm-bench`` compare with it.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from kinarm.arm import Arm
from kinarm.collision import ContactModel
from kinarm.contact_pairs import make_verdicts_reliable, start_anew
from kinarm.kernels.compiling import Array
from kinarm.reference_plant import ReferencePlant
from kinarm.simulator import Simulator


class ReferenceEpisode(NamedTuple):
    """One episode of the reference.

    Attributes
    ----------
    path, observations : ndarray, shape (steps + 1, n_joints) and (steps + 1, n_observations)
        Configurations visited [rad or m], and their observations.
    rewards : ndarray, shape (steps,)
        Rewards.
    success, collision : bool
        How it ended; neither means truncation at the horizon.
    distance, contact
        The tool's final distance from the goal [m], and the first pair in
        contact, if any.
    """

    path: Array
    observations: Array
    rewards: Array
    success: bool
    collision: bool
    distance: float
    contact: tuple[str, str] | None


SAMPLES = 2000
"""Configurations of a step that is tested throughout."""


class ReferenceSimulator:
    """Steps single episodes with Pinocchio and Coal."""

    def __init__(self, simulator: Simulator) -> None:
        self.arm: Arm = simulator.arm
        self.task = simulator.task
        self.tested = simulator.world.rules.tested or SAMPLES
        self._data = self.arm.model.createData()
        self._world, self._problem = simulator.world, simulator.problem
        self._begin(simulator.world.contact_model)

    def rollout(
        self, policy: Callable[[Array], ArrayLike], start: Array, goal: Array
    ) -> ReferenceEpisode:
        """Run one episode.

        Parameters
        ----------
        policy : callable
            Maps an observation, shape (n_observations,), to an action, shape
            (n_actions,).
        start, goal : ndarray, shape (n_joints,) and (3,)
            Start configuration [rad or m] and goal position [m].
        """
        self._begin(self._world.in_scene(start, goal).contact_model)
        begun = self.contact_model.shapes.placed[list(self._problem.scene.moving), 13:]
        positions = begun + self._problem.body_offsets(np.arange(self.task.horizon + 1))
        q, reward = np.array(start), self.task.reward
        joints = ReferencePlant(self._world, q, goal)
        distance = self.observe(q, goal)[1]
        observation = self.observe(*joints.seen(q, 0))[0]
        path, observations = [q], [observation]
        rewards: list[float] = []
        success, contact = False, None
        while not success and contact is None and len(rewards) < self.task.horizon:
            action = np.clip(np.asarray(policy(observation), dtype=float), -1.0, 1.0)
            target = joints.moved(q, action)
            contact = self.first_contact(q, target, *positions[len(rewards) :][:2])
            before = distance
            if contact is None:
                q = target
                distance = self.observe(q, goal)[1]
                observation = self.observe(*joints.seen(q, len(rewards) + 1))[0]
                success = distance <= self.task.tolerance
            rewards.append(
                reward.progress * (before - distance)
                + reward.closer * np.sign(before - distance)
                + reward.step
                + reward.collision * (contact is not None)
                + reward.success * success
            )
            path.append(q)
            observations.append(observation)
        return ReferenceEpisode(
            path=np.array(path),
            observations=np.array(observations),
            rewards=np.array(rewards),
            success=success,
            collision=contact is not None,
            distance=distance,
            contact=contact,
        )

    def _begin(self, contact_model: ContactModel) -> None:
        """Take the bodies of an episode."""
        self.contact_model, self._geometry = contact_model, contact_model.geometry.clone()
        self._geometry_data = make_verdicts_reliable(self._geometry.createData())

    def observe(self, q: Array, goal: Array) -> tuple[Array, float]:
        """Observation of a configuration and the distance to the goal [m]."""
        model, data = self.arm.model, self._data
        pin.framesForwardKinematics(model, data, q)
        tool = data.oMf[model.getFrameId(self.arm.tool_frame, pin.FrameType.BODY)].translation
        offset = goal - tool
        positions = [data.oMi[i].translation for i in range(1, model.njoints)]
        parts = [goal, offset, *self._quaternions(q), *positions]
        return np.concatenate(parts), float(np.linalg.norm(offset))

    def _quaternions(self, q: Array) -> list[Array]:
        """World orientations of joint frames, composed along the chain."""
        world = pin.Quaternion.Identity()
        quaternions = []
        for k in range(self.arm.n_joints):
            world = world * pin.Quaternion(self.arm.model.jointPlacements[k + 1].rotation)
            if not self.arm.chain.prismatic[k]:
                turn = np.sin(q[k] / 2) * self.arm.chain.axis[k]
                world = world * pin.Quaternion(float(np.cos(q[k] / 2)), *turn)
            x, y, z, w = world.coeffs()
            quaternions.append(np.array([w, x, y, z]))
        return quaternions

    def first_contact(
        self, q: Array, target: Array, before: Array | None = None, after: Array | None = None
    ) -> tuple[str, str] | None:
        """First pair that touches at a step's tested configurations, or None.

        Parameters
        ----------
        q, target : ndarray, shape (n_joints,)
            Ends of the step [rad or m].
        before, after : ndarray, shape (n_moving, 3), optional
            Positions of the scene's moving bodies [m].
        """
        model, geometry, data = self.arm.model, self._geometry, self._geometry_data
        placed = list(geometry.geometryObjects)[self.arm.geometry.ngeoms :]
        moving = [placed[k] for k in self._problem.scene.moving]
        for k in range(1, self.tested + 1):
            share, last = k / self.tested, k == self.tested
            tested = target if last else q + share * (target - q)
            if before is not None and after is not None:
                positions = after if last else before + share * (after - before)
                for shape, position in zip(moving, positions, strict=True):
                    shape.placement = pin.SE3(shape.placement.rotation, position)
            start_anew(data.collisionRequests)
            if pin.computeCollisions(model, self._data, geometry, data, tested, True):
                # Pairs are tested in order up to the first in contact.
                touching = (result.isCollision() for result in data.collisionResults)
                return self.contact_model.pair_names[list(touching).index(True)]
        return None
