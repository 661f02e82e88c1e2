"""Goals as the oracle takes them: what they ask of the arm, and where each is after every step."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinarm.bodies import rotation_of_quaternion
from kinarm.kernels.compiling import Array, Vector
from kinarm.kernels.elementary import TURN
from kinarm.kernels.goals import CONFIGURATION, DIRECTION, POSE, circle_points
from kinarm.kernels.records import recorded
from kinarm.policies.oracle.kernels.rotation import Turn
from kinarm.simulator import Simulator

PARALLEL = 1e-12
"""Sine below which an axis counts as that of a joint."""


class Aims(NamedTuple):
    """Aims of n trials.

    Attributes
    ----------
    position : ndarray, shape (n, 3)
        Of the tool [m].
    wanted : ndarray, shape (n, n_axes, 3)
        Directions of the tool's axes, of which there may be none.
    lower, upper : ndarray, shape (n, n_actions)
        Limits within which joints count as at the goal [rad or m].
    turn : Turn
        The axes; its ``wanted`` are those of no trial.
    """

    position: Array
    wanted: Array
    lower: Array
    upper: Array
    turn: Turn

    @classmethod
    def of(cls, simulator: Simulator, starts: Array, goals: Array, slack: float) -> "Aims":
        """Aims at goals.

        Parameters
        ----------
        simulator : Simulator
            Arm and task.
        starts, goals : ndarray, shape (n, n_joints) and (n, goal_width)
            Where joints that are not actuated stay [rad or m], and the goals.
        slack : float
            How far beyond their tolerance joints count as at a goal [rad or m].
        """
        rules, chain, n = simulator.world.rules, simulator.arm.chain, simulator.n_actions
        goal, rest, frame = rules.goal, goals[:, 3:], rules.goal.frame
        axes, wanted = np.empty((0, 3)), np.empty((len(goals), 0, 3))
        lower, upper = (np.tile(limit[:n], (len(goals), 1)) for limit in (chain.lower, chain.upper))
        if goal.kind == DIRECTION:
            lengths = np.sqrt(np.square(rest).sum(axis=1, keepdims=True))
            axes, wanted = goal.axis[None].copy(), (rest / lengths)[:, None]
        elif goal.kind == POSE:
            w, x, y, z = np.concatenate([frame[None], rest]).T
            turned = np.ascontiguousarray(rotation_of_quaternion((w, x, y, z)).T)
            axes, wanted = turned[0], turned[1:]
        elif goal.kind == CONFIGURATION:
            within = goal.tolerance + slack
            lower = np.fmax(lower, rest[:, :n] - within)
            upper = np.fmin(upper, rest[:, :n] + within)
            # No joint limits are left where those that do not move are elsewhere.
            away = (np.abs(rest - starts)[:, n:] > within).any(axis=1)
            lower[away], upper[away] = upper[away] + 1.0, lower[away] - 1.0
        turning = ~chain.prismatic[:n]
        if len(axes) == 1 and n == chain.n_joints:
            # The last joint does not turn the tool's axis if it is its own.
            turning[-1] &= np.abs(np.cross(chain.axis[-1], axes[0])).max() > PARALLEL
        chord, _ = np.empty((2, 1))
        circle_points(np.array([min(goal.tolerance / (2 * TURN), 0.25)]), _, chord)
        weight = float(rules.tolerance / (2.0 * chord[0])) if len(axes) else 0.0
        turn = Turn(axes, axes, weight, np.where(turning, weight, 0.0))
        return cls(goals[:, :3].copy(), wanted, lower, upper, turn)

    def of_row(self, row: int) -> tuple[Vector, Turn, Array]:
        """Position, rotations and limits of joints, shape (2, n_actions), for kernels."""
        x, y, z = self.position[row].tolist()
        turn: Turn = recorded(self.turn._replace(wanted=self.wanted[row].copy()))
        return (x, y, z), turn, np.array([self.lower[row], self.upper[row]])


class Stage(NamedTuple):
    """A goal of each of n episodes.

    Attributes
    ----------
    goals : ndarray, shape (n, goal_width)
        The goals, before they move.
    walks : ndarray, shape (n, horizon + 1, goal_width), optional
        Where they are after each step of the episode, if they move.
    """

    goals: Array
    walks: Array | None = None

    @property
    def targets(self) -> Array:
        """What bounds are about: goals, or their walks."""
        return self.goals if self.walks is None else self.walks

    def of(self, rows: NDArray[np.int64], taken: NDArray[np.int64]) -> "Stage":
        """Goals of some episodes, from the steps on that they have taken."""
        if self.walks is None:
            return Stage(self.goals[rows])
        last = self.walks.shape[1] - 1
        steps = np.fmin(taken[:, None] + np.arange(last + 1), last)
        return Stage(self.goals[rows], self.walks[rows[:, None], steps])


def stages_of(simulator: Simulator, starts: Array, goals: Array) -> list[Stage]:
    """Goals of episodes in turn.

    Parameters
    ----------
    simulator, starts, goals
        The simulator, starts, shape (n, n_joints) [rad or m], and first goals,
        shape (n, goal_width).
    """
    goal, rules = simulator.task.goal, simulator.world.rules.goal
    if not goal.changes:
        return [Stage(goals)]
    stages = []
    for drawn in simulator.reset(starts, goals).pursuit.goals.swapaxes(0, 1):
        walks = None
        if goal.motion is not None:
            walks = np.repeat(drawn[:, None], len(rules.moves), axis=1)
            walks[:, :, :3] += rules.moves
        stages.append(Stage(drawn.copy(), walks))
    return stages
