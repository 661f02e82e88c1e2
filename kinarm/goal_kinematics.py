"""What goals mean for an arm: where they lie, and which configurations reach them."""

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinarm.bodies import rotation_matrix, rotation_of_quaternion
from kinarm.chain import quaternion_of
from kinarm.collision import ContactModel
from kinarm.episode_draws import scenes_at
from kinarm.episodes import Pursuit, Rules
from kinarm.errors import LARGEST, InvalidInputError, ProblemError, finite_array
from kinarm.goals import Goals, unit
from kinarm.inverse_kinematics import SEEDS, InverseKinematics, approach_axis
from kinarm.kernels.compiling import Array
from kinarm.kernels.goals import GoalRules, errors_between, fill_reached
from kinarm.kernels.kinematics import POSE
from kinarm.kernels.records import recorded
from kinarm.problem import ReachProblem

SOLUTIONS = ((4, 64), (16, 1024), (64, 1024))
"""Configurations at a goal that are tried in turn, and the seeds that look for them, at most."""

SAMPLE = 64
"""Goals that show whether an arm reaches any."""


NO_PURSUIT = recorded(
    Pursuit(
        *(np.zeros((0, 0)), np.zeros(0), np.zeros(0, np.int64), np.zeros(0, np.int64)),
        *(np.zeros((0, 0, 3)), np.zeros((0, 0, 3))),
    )
)
"""For standing points that are reached once touched."""

UNIT_LENGTH = 1e-6
"""How far the square of a direction's or quaternion's length may be from 1."""


class GoalKinematics(InverseKinematics):
    """Goals of a problem, for its arm."""

    problem: ReachProblem
    contact_model: ContactModel
    rules: Rules
    free: Callable[[Array, Array], tuple[Array, NDArray[np.bool_]]]

    def checked(self, what: str, listed: tuple[tuple[float, ...], ...]) -> Array:
        """Listed configurations, shape (n, n_joints), if all are possible [rad or m]."""
        arm, configurations = self.arm, np.empty((len(listed), self.arm.n_joints))
        for number, configuration in enumerate(listed):
            name = f"{what}[{number}]"
            given = finite_array(name, configuration, (arm.n_joints,))
            configurations[number] = arm.chain.within_limits(name, given, arm.joint_names)
            pair = self.contact_model.contact_pair(configurations[number])
            if pair is not None:
                raise ProblemError(f"{name} is in contact: {pair[0]} touches {pair[1]}")
        return configurations

    def _goal_rules(self) -> Any:
        """Record of what is to be reached, and how; see ``kinarm.kernels.goals``."""
        task, dt = self.problem.task, self.problem.stepping.time_step
        goal, times = task.goal, np.arange(task.horizon + 1, dtype=np.float64) * dt
        rules = GoalRules(
            kind=goal.number,
            hold=goal.hold,
            sequence=goal.sequence,
            tolerance=goal.rotation_tolerance,
            stride=float("inf") if goal.speed is None else goal.speed * dt,
            axis=approach_axis(self.arm),
            frame=quaternion_of(self.tool[:3, :3]),
            moves=goal.motion.offsets(times) if goal.motion else np.zeros((0, 3)),
        )
        return recorded(rules)

    @cached_property
    def goal_width(self) -> int:
        """Length of a goal."""
        return self.problem.task.goal.width(self.arm.n_joints)

    @property
    def goal_bounds(self) -> tuple[Array, Array]:
        """Lowest and highest positions of goals, shape (3,) each [m]."""
        if self.problem.task.goal.configurations:
            return self.goals.lower.min(axis=0), self.goals.lower.max(axis=0)
        scene, moves = self.problem.scene, self.rules.goal.moves
        regions = [scene.goal_region(name) for name in self.problem.task.goal_regions]
        lower = np.min([region.lower for region in regions], axis=0)
        upper = np.max([region.upper for region in regions], axis=0)
        return lower + moves.min(axis=0, initial=0.0), upper + moves.max(axis=0, initial=0.0)

    @cached_property
    def goals(self) -> Goals:
        """Where the task's goals lie."""
        goal = self.problem.task.goal
        goals = self.problem.task.goals_in(self.problem.scene)
        if goal.kind == "position":
            return goals
        unknown = np.full((1, self.goal_width - 3), np.nan)
        if goal.configurations:
            rests = self.reached(self.checked("task.goal.configurations", goal.configurations))
            n = len(rests)
            none, ends = np.zeros(0, dtype=np.int64), np.arange(1, n) / n
            return Goals(rests[:, :3], np.zeros((n, 0)), none, ends, rests[:, 3:])
        axis = (self.tool[:3, :3] * approach_axis(self.arm)[:, None]).sum(axis=0)
        turns = [rotation_matrix(rpy) for rpy in goal.rotations]
        if goal.kind == "direction":
            listed = [unit((turn * axis).sum(axis=1)) for turn in turns]
        else:
            listed = [unit(quaternion_of(turn)) for turn in turns]
        return goals.with_rests(np.array(listed) if listed else unknown)

    def configurations_at(
        self, goals: Array, most: int, seeds: int = SEEDS
    ) -> tuple[Array, NDArray[np.int64]]:
        """Configurations at goals, shape (m, n_joints) [rad or m], and the goal of each.

        Only actuated joints move. Where none is exact, errors may be as large as the tolerances.

        Parameters
        ----------
        goals : ndarray, shape (n, goal_width)
            Goals, all with a rest or none, which is NaN.
        most, seeds : int
            Largest numbers for a goal, of configurations and of seeds.
        """
        task, rests = self.problem.task, goals[:, 3:]
        positions, goal = np.ascontiguousarray(goals[:, :3]), task.goal
        if goal.kind == "position" or np.isnan(rests).any():
            solutions = self.inverse_kinematics(positions, most=most, seeds=seeds)
            return solutions.configurations, solutions.owner
        if goal.kind == "configuration":
            return np.ascontiguousarray(rests), np.arange(len(goals))
        poses = np.tile(np.eye(4), (len(goals), 1, 1))
        if goal.kind == "pose":
            poses[:, :3, 3] = positions
            for pose, (w, x, y, z) in zip(poses, rests.tolist(), strict=True):
                pose[:3, :3] = rotation_of_quaternion((w, x, y, z))
        solutions = self.inverse_kinematics(
            poses if goal.kind == "pose" else positions,
            None if goal.kind == "pose" else rests,
            joints=self.arm.n_actuated,
            most=most,
            seeds=seeds,
            position_tolerance=task.tolerance,
            rotation_tolerance=goal.rotation_tolerance,
        )
        return solutions.configurations, solutions.owner

    def solved_goals(
        self, goals: Array, choices: Array, scenes: Array
    ) -> tuple[NDArray[np.bool_], Array]:
        """Which goals have a configuration without contact; and goals with its rests.

        Parameters
        ----------
        goals : ndarray, shape (n, goal_width)
            Goals; unknown rests become those of a configuration that is found.
        choices : ndarray, shape (n,)
            Numbers in [0, 1) that choose it.
        scenes : ndarray
            As of `kinarm.World.scenes_of`.
        """
        filled, found = goals.copy(), np.zeros(len(goals), dtype=bool)
        unknown = np.isnan(goals[:, 3:]).sum(axis=1) > 0
        pending = np.arange(len(goals))
        for most, seeds in SOLUTIONS:
            if not len(pending):
                break
            q, owner = self.configurations_at(goals[pending], most, seeds)
            owner = pending[owner]
            free = self.free(q, scenes_at(scenes, owner))[1]
            pending = np.setdiff1d(owner, owner[free])
            q, owner = q[free], owner[free]
            rows, first, counts = np.unique(owner, return_index=True, return_counts=True)
            chosen = first + (choices[rows] * counts).astype(np.int64)
            found[rows] = True
            wanted = unknown[rows]
            filled[rows[wanted], 3:] = self.reached(q[chosen[wanted]])[:, 3:]
        return found, filled

    @cached_property
    def no_scenes(self) -> Array:
        """Those of `kinarm.World.scenes_of` if all have the same."""
        return np.zeros((0, *self.contact_model.shapes.placed.shape))

    @cached_property
    def reachable_of_sample(self) -> int:
        """Of how many of ``SAMPLE`` goals a configuration is found, with nothing random around."""
        goals = self.goals.draw(np.random.default_rng(0), SAMPLE)
        return int(self.solved_goals(goals, np.zeros(SAMPLE), self.no_scenes)[0].sum())

    def reached(self, configurations: ArrayLike) -> Array:
        """What the tool reaches at configurations, as goals are, shape (n, goal_width)."""
        q = finite_array("configurations", configurations, (None, self.arm.n_joints))
        rows, poses = np.empty((len(q), self.goal_width)), np.empty((q.shape[1] + 1, POSE))
        fill_reached(recorded(self.arm.chain), self.rules.goal, q, poses, rows)
        return rows

    def at_goals(self, reached: ArrayLike, goals: ArrayLike) -> Any:
        """Whether what is reached is within the tolerances of goals.

        Both have the shape (..., goal_width), or one that broadcasts to it, and the answer (...).
        """
        pairs = np.broadcast_arrays(np.asarray(reached, float), np.asarray(goals, float))
        shape, width, task = pairs[0].shape[:-1], self.goal_width, self.problem.task
        if pairs[0].shape[-1:] != (width,):
            raise InvalidInputError(
                f"goals must have the shape (..., {width}), got {pairs[0].shape}"
            )
        achieved, wanted = (np.array(each.reshape(-1, width), order="C") for each in pairs)
        distances, turns = np.empty((2, len(achieved)))
        errors_between(task.goal.number, achieved, wanted, distances, turns)
        near = (distances <= task.tolerance) & (turns <= task.goal.rotation_tolerance)
        return near.reshape(shape)[()]

    def check_scenarios(self, starts: ArrayLike, goals: ArrayLike) -> tuple[Array, Array]:
        """Copy starts and goals, or refuse them."""
        q = finite_array("starts", starts, (None, self.arm.n_joints))
        goal = finite_array("goals", goals, (len(q), self.goal_width))
        if (farthest := np.abs(goal).max(initial=0.0)) > LARGEST:
            raise InvalidInputError(f"goals must lie within {LARGEST:g} m, got {farthest:g}")
        if self.problem.task.goal.kind in ("direction", "pose") and len(goal):
            off = np.abs(np.square(goal[:, 3:]).sum(axis=1) - 1.0)
            if off.max() > UNIT_LENGTH:
                raise InvalidInputError(
                    f"directions and quaternions of goals must have length 1, but goal "
                    f"{off.argmax()} has {goal[off.argmax(), 3:].tolist()}"
                )
        return self.arm.chain.within_limits("starts", q, self.arm.joint_names), goal

    def pursuit(self, goals: Array, *, record: bool) -> Any:
        """Record of what episodes have besides, with only their first goals."""
        spec, horizon, (n, width) = self.problem.task.goal, self.problem.task.horizon, goals.shape
        if spec.plain:
            return NO_PURSUIT
        count = spec.count
        kept = (n, horizon + 1, width) if record and count else (0, 0, width)
        return recorded(
            Pursuit(
                reached=np.zeros((n, width)),
                turn=np.zeros(n),
                held=np.zeros(n, dtype=np.int64),
                goals_reached=np.zeros(n, dtype=np.int64),
                goals=np.repeat(goals[:, None], count, axis=1)[: n if count else 0],
                path=np.full(kept, np.nan),
            )
        )
