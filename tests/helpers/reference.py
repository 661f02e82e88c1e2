"""The slow reference: the simulator's semantics in plain Pinocchio and Coal, step by step.

It shares no kernel with `kinarm.simulator` and asks Coal about every tested configuration. The
tests hold whole episodes of the two against each other.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from kinarm.arm import Arm
from kinarm.contact_pairs import make_verdicts_reliable, start_anew
from kinarm.errors import LARGEST
from kinarm.goals import GOAL_RESTS, REST_ERRORS
from kinarm.inverse_kinematics import approach_axis
from kinarm.kernels.compiling import Array
from kinarm.kernels.inverse import DAMPING, LEAST_DAMPING
from kinarm.observation_part import SLOTS
from kinarm.scenarios import draw_followers
from kinarm.simulator import Simulator
from kinarm.world import World
from tests.helpers.reference_plant import ReferencePlant


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
    turn, goals_reached : float and int
        Final error of the goal's rest [rad, or rad or m], and goals reached.
    """

    path: Array
    observations: Array
    rewards: Array
    success: bool
    collision: bool
    distance: float
    contact: tuple[str, str] | None
    turn: float
    goals_reached: int


class Moment(NamedTuple):
    """What is seen of an episode after a step, beside joints and goal.

    Attributes
    ----------
    joints, commanded, before : ndarray, shape (n_joints,)
        Joint positions as they are, as commanded, and as seen before the step
        [rad or m].
    action, step, earlier
        The step's action and number, and the observation before; None at the
        start.
    """

    joints: Array
    commanded: Array
    before: Array
    action: Array | None = None
    step: int = 0
    earlier: Array | None = None


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
        self._begin(simulator.world)

    def rollout(
        self,
        policy: Callable[[Array], ArrayLike],
        start: Array,
        goal: Array,
        *,
        observed: bool = True,
    ) -> ReferenceEpisode:
        """Run one episode.

        Parameters
        ----------
        policy : callable
            Maps an observation, shape (n_observations,), to an action, shape
            (n_actions,).
        start, goal : ndarray, shape (n_joints,) and (goal_width,)
            Start configuration [rad or m] and first goal.
        observed : bool
            Whether the policy needs observations, which take most of the time.
        """
        self._begin(self._world.in_scene(start, goal))
        begun = self.contact_model.shapes.placed[list(self._problem.scene.moving), 13:]
        positions = begun + self._problem.body_offsets(np.arange(self.task.horizon + 1))
        q, reward, spec = np.array(start), self.task.reward, self.task.goal
        goals = [goal]
        if spec.changes:
            goals = list(draw_followers(self._world, start[None], goal[None])[0])
        held, reached, limit = 0, 0, np.inf
        if spec.speed is not None:
            limit = spec.speed * self._problem.stepping.time_step
        joints, aim = ReferencePlant(self._world, q, goal), self._goal_at(goals, 0, 0)
        distance, turn, tool = self.measure(q, aim)
        seen = joints.seen(q, aim, 0)
        observation = np.zeros(0)
        if observed:
            observation = self.observe(*seen, Moment(q, joints.commanded(q), seen[0]))
        path, observations = [q], [observation]
        rewards: list[float] = []
        success, contact = False, None
        while not success and contact is None and len(rewards) < self.task.horizon:
            action = np.clip(np.asarray(policy(observation), dtype=float), -1.0, 1.0)
            target = joints.moved(q, action)
            contact = self.first_contact(q, target, *positions[len(rewards) :][:2])
            before, turned, arrived = distance, turn, False
            if contact is None:
                q, aim = target, self._goal_at(goals, len(rewards) + 1, reached)
                last, (distance, turn, tool) = tool, self.measure(q, aim)
                within = distance <= self.task.tolerance and turn <= spec.rotation_tolerance
                held = held + 1 if within and np.linalg.norm(tool - last) <= limit else 0
                arrived = held >= spec.hold
            rewards.append(
                reward.progress * (before - distance)
                + reward.progress * reward.rotation * (turned - turn)
                + reward.closer * np.sign(before - distance)
                + reward.step
                + reward.collision * (contact is not None)
                + reward.success * arrived
            )
            if arrived:
                held, reached = 0, reached + 1
                success = reached == spec.sequence
                if not success:
                    aim = self._goal_at(goals, len(rewards), reached)
                    distance, turn, tool = self.measure(q, aim)
            if contact is None and observed:
                before_it, now = seen[0], len(rewards)
                seen, commanded = joints.seen(q, aim, now), joints.commanded(q)
                moment = Moment(q, commanded, before_it, action, now, observation)
                observation = self.observe(*seen, moment)
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
            turn=turn,
            goals_reached=reached,
        )

    def _goal_at(self, goals: list[Array], step: int, reached: int) -> Array:
        """The goal after so many steps and goals reached, shape (goal_width,)."""
        spec = self.task.goal
        goal = goals[min(reached, spec.sequence - 1)].copy()
        if spec.motion is not None:
            goal[:3] += spec.motion.offsets(np.array([step * self._problem.stepping.time_step]))[0]
        return goal

    def _begin(self, there: World) -> None:
        """Take the bodies of an episode."""
        self._there, self.contact_model = there, there.contact_model
        self._geometry = self.contact_model.geometry.clone()
        self._geometry_data = make_verdicts_reliable(self._geometry.createData())

    def measure(self, q: Array, goal: Array) -> tuple[float, float, Array]:
        """Errors of position [m] and rest at a configuration, and the tool point."""
        pose = self._tool_at(q)
        tool = np.array(pose.translation)
        turn = self._turn(q, pose.rotation, goal[3:])[1]
        return float(np.linalg.norm(goal[:3] - tool)), turn, tool

    def _tool_at(self, q: Array) -> pin.SE3:
        """Pose of the tool."""
        model, data = self.arm.model, self._data
        pin.framesForwardKinematics(model, data, q)
        return data.oMf[model.getFrameId(self.arm.tool_frame, pin.FrameType.BODY)]

    def observe(self, q: Array, goal: Array, moment: Moment | None = None) -> Array:
        """Observation of a configuration.

        All parts but ``proximity``, whose planes only kernels find, are computed anew.

        Parameters
        ----------
        q, goal : ndarray, shape (n_joints,) and (goal_width,)
            Configuration [rad or m] and goal [m] as they are seen.
        moment : Moment, optional
            What else is seen; by default at the start of an episode there.
        """
        now = moment or Moment(q, q, q)
        pose, data = self._tool_at(q), self._data
        tool, rest = np.array(pose.translation), goal[3:]
        offset = goal[:3] - tool
        positions = [data.oMi[i].translation for i in range(1, self.arm.model.njoints)]
        error, _ = self._turn(q, pose.rotation, rest)
        limit, layout = self._world.rules.step_limit, self._there.layout
        formulas: dict[str, Callable[[], Any]] = {
            "goal": lambda: goal[:3],
            "goal_minus_tool": lambda: offset,
            "resolved_rate": lambda: self._resolved_rate(now.commanded, goal),
            "orientation": lambda: self._quaternions(q),
            "position": lambda: positions,
            "joint_positions": lambda: q,
            "joint_angles": lambda: np.stack([np.sin(q), np.cos(q)], axis=1),
            "joint_velocities": lambda: (q - now.before)[: len(limit)] / limit,
            "last_action": lambda: 0 * limit if now.action is None else now.action,
            "commanded": lambda: now.commanded,
            "time_left": lambda: 1 - now.step / self.task.horizon,
            "proximity": lambda: self._there.observe([now.joints], [goal], now.step)[0, near],
            "obstacles": lambda: self._nearest(tool, layout.counts[SLOTS]),
            **dict.fromkeys(GOAL_RESTS, lambda: rest),
            **dict.fromkeys(REST_ERRORS, lambda: error),
        }
        near = layout.places.get("proximity")
        seen = np.concatenate([np.ravel(formulas[part.name]()) for part in layout.parts])
        earlier = np.tile(seen, layout.history) if now.earlier is None else now.earlier
        return np.concatenate([seen, earlier[: layout.size - layout.width]])

    def _nearest(self, tool: Array, slots: int) -> Array:
        """Boxes around the bodies that are nearest to the tool point, shape (slots, 12)."""
        found: list[tuple[float, Array]] = []
        for body in list(self._geometry.geometryObjects)[self.arm.geometry.ngeoms :]:
            shape, pose = body.geometry, body.placement
            if isinstance(shape, coal.Halfspace) or np.abs(pose.translation).max() > LARGEST / 2:
                continue
            shape.computeLocalAABB()
            box = shape.aabb_local
            half, middle = (box.max_ - box.min_) / 2, pose.act((box.max_ + box.min_) / 2)
            away = np.abs(pose.rotation.T @ (tool - middle)) - half
            distance = float(np.linalg.norm(np.maximum(away, 0.0)))
            row = [middle - tool, half, pose.rotation[:, 0], pose.rotation[:, 1]]
            found.append((distance, np.concatenate(row)))
        rows = [row for _, row in sorted(found, key=lambda each: each[0])[:slots]]
        return np.array([*rows, *[np.zeros(12)] * (slots - len(rows))])

    def _resolved_rate(self, q: Array, goal: Array) -> Array:
        """Damped Newton step to the goal, by Pinocchio's Jacobian."""
        model, data = self.arm.model, self.arm.model.createData()
        pin.framesForwardKinematics(model, data, q)
        limit, kind, rest = self._world.rules.step_limit, self.task.goal.kind, goal[3:]
        frame = model.getFrameId(self.arm.tool_frame, pin.FrameType.BODY)
        pose, seen_from = data.oMf[frame], pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        jacobian = pin.computeFrameJacobian(model, data, q, frame, seen_from)
        moved, turned = jacobian[:3, : len(limit)], jacobian[3:, : len(limit)]
        error = goal[:3] - pose.translation
        if kind == "direction":
            reached = data.oMi[self.arm.n_joints].rotation @ approach_axis(self.arm)
            longer = 1 / np.sqrt(max(0.5 + 0.5 * (reached @ rest), 1e-6))
            error = np.concatenate([error, longer * np.cross(reached, rest)])
            moved = np.vstack([moved, turned - np.outer(reached, reached @ turned)])
        elif kind == "pose":
            turn = pin.Quaternion(*rest) * pin.Quaternion(pose.rotation).inverse()
            error = np.concatenate([error, 2 * np.copysign(1, turn.w) * turn.vec()])
            moved = np.vstack([moved, turned])
        if kind == "configuration":
            step = rest[: len(limit)] - q[: len(limit)]
        else:
            damping = DAMPING * (error @ error) + LEAST_DAMPING
            square = moved @ moved.T + damping * np.eye(len(error))
            step = moved.T @ np.linalg.solve(square, error)
        action = step / limit
        return np.array(action / max(1.0, np.abs(action).max()))

    def _turn(self, q: Array, rotation: Array, rest: Array) -> tuple[Array, float]:
        """Difference of a goal's rest from what is reached, and its size [rad, or rad or m]."""
        kind = self.task.goal.kind
        if kind == "configuration":
            return rest - q, float(np.abs(rest - q).max())
        if kind == "direction":
            joint = self._data.oMi[self.arm.n_joints].rotation
            reached = joint @ approach_axis(self.arm)
            sine = float(np.linalg.norm(np.cross(reached, rest)))
            return rest - reached, float(np.arctan2(sine, reached @ rest))
        if kind == "pose":
            x, y, z, w = pin.Quaternion(rotation).coeffs()
            reached = np.array([w, x, y, z])
            reached *= 1.0 if reached @ rest >= 0 else -1.0
            wanted = pin.Quaternion(*rest)
            return rest - reached, float(pin.Quaternion(rotation).angularDistance(wanted))
        return np.zeros(0), 0.0

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
