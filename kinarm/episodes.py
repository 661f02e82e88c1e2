"""Rules, actions and episodes as arrays for kernels, and outcomes."""

from dataclasses import dataclass, field
from functools import partial
from itertools import product
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinarm.kernels.compiling import Array

INTERVALS = 16
"""Parts of a step that is tested throughout."""

RUNNING, PAUSED, SUCCESS, COLLISION, TRUNCATED = range(5)
"""States of an episode."""

LINEAR, TANH, RELU, HARDTANH, ELU, LEAKY_RELU, SILU = range(7)
"""Activation functions of networks."""

Outcome = Literal["success", "collision", "truncated"]
"""How an episode ends: goal, contact or horizon."""


class Rules(NamedTuple):
    """Task and motion limits for the kernels.

    Attributes
    ----------
    step_limit : ndarray, shape (n_actuated,)
        Largest move of each joint in a step [rad or m].
    tested : int
        Configurations of a step that are tested for contact; 0 for all of its
        motion.
    tolerance, horizon
        Distance at which a goal is reached [m], and largest number of steps.
    reward : ndarray, shape (n_terms,)
        Weights of the reward terms.
    moves : ndarray, shape (horizon + 1, n_moving, 3)
        Offsets of the scene's moving bodies after each step [m], between which
        they move straight.
    time_step, commanded
        Duration of a step [s]; and whether a plant feeds back its command.
    shown, width : ndarray of int, shape (n_parts, 2), and int
        First entry of each part of the observation of a step, and how often
        it is there; and entries of that observation.
    newton, near : int
        Errors of a goal that a Newton step of the observation is to remove, and
        first entry of ``proximity``; -1 for none.
    boxes : ndarray, shape (n_placed, 2, 3)
        Middle and half-size of a box around each body of the scene, before its
        size.
    goal : GoalRules
        What is to be reached, and how; see ``kinarm.kernels.goals``.
    shield : ndarray, shape (n, n_actuated), or of no rows
        Shares of a step that may replace it; see ``kinarm.kernels.shield``.
    """

    step_limit: Array
    tested: int
    tolerance: float
    horizon: int
    reward: Array
    moves: Array
    time_step: float
    commanded: int
    shown: NDArray[np.uint32]
    width: int
    newton: int
    near: int
    boxes: Array
    goal: Any
    shield: Array

    @property
    def parts(self) -> int:
        """Parts of a step, at whose ends it is looked at first."""
        return self.tested or INTERVALS


SCALES = (1.0, 0.5, 0.2, -0.3)
"""Shares of a step that a shield tries."""

ALL_MASKS = 8
"""With so many joints or fewer, a shield may hold any of them."""


def shield_table(n_actuated: int) -> Array:
    """Shares of a step, joint by joint, that may replace it, shape (n, n_actuated).

    All moving joints have the same share; the others are held. Of many joints, at most two are
    held, or at most two move. Without joints there is no shield.
    """
    if n_actuated == 0:
        return np.zeros((0, 0))
    masks = [
        mask
        for mask in product((1.0, 0.0), repeat=n_actuated)
        if any(mask) and (n_actuated <= ALL_MASKS or not 2 < sum(mask) < n_actuated - 2)
    ]
    return np.array([np.multiply(scale, mask) for scale in SCALES for mask in masks][1:])


class Control(NamedTuple):
    """Source of actions: dense networks, or a table if ``layers`` is empty, as by default.

    Attributes
    ----------
    layers : ndarray of int, shape (n_layers + 1,)
        Widths, from the observation to the action.
    weights : ndarray, shape (n_policies, n_parameters)
        Weights (inputs x outputs), then bias, layer by layer.
    policy : ndarray of int, shape (n_episodes,)
        Row of ``weights`` of each episode.
    activations : ndarray of int, shape (n_layers,)
        Function after each layer; the last one's values are clipped.
    observation_signs, action_signs : ndarray, shape (n_observations,) and (n_actuated,), or (0,)
        Reflection of goals on the left for the networks, if any.
    side : int
        Entry of the observation that is positive for goals on the left.
    rates : int
        First entry of ``resolved_rate``, to which outputs of the networks are added as
        far as there is to go; -1 if outputs are the actions.
    actions : ndarray, shape (n_episodes, n_steps, n_actuated)
        The table; one step serves every step.
    """

    layers: NDArray[np.int64] = np.zeros(0, dtype=np.int64)
    weights: Array = np.zeros((0, 0))
    policy: NDArray[np.int64] = np.zeros(0, dtype=np.int64)
    activations: NDArray[np.int64] = np.zeros(0, dtype=np.int64)
    observation_signs: Array = np.zeros(0)
    action_signs: Array = np.zeros(0)
    side: int = 0
    rates: int = -1
    actions: Array = np.zeros((0, 0, 0))


class Pursuit(NamedTuple):
    """What episodes have whose goals are not standing points, reached once touched.

    For others, all arrays have the length 0.

    Attributes
    ----------
    reached : ndarray, shape (n, goal_width)
        What the tool has reached, as goals are.
    turn : ndarray, shape (n,)
        Error of the goal's rest [rad, or rad or m].
    held, goals_reached : ndarray of int, shape (n,)
        Steps in a row within the tolerances, and goals reached.
    goals : ndarray, shape (n, n_goals, goal_width) or (0, n_goals, goal_width)
        Goals in turn, before they move; of length 0 if the goal stays.
    path : ndarray, shape (n, horizon + 1, goal_width) or (0, 0, goal_width)
        Goals after each step, if paths are kept and goals change.
    """

    reached: Array
    turn: Array
    held: NDArray[np.int64]
    goals_reached: NDArray[np.int64]
    goals: Array
    path: Array


class Episodes(NamedTuple):
    """State of n episodes, which kernels change in place.

    Attributes
    ----------
    status, steps, stop : ndarray of int, shape (n,)
        `RUNNING`, `PAUSED`, `SUCCESS`, `COLLISION` or `TRUNCATED`; steps taken;
        step at which to hand an episode back.
    q, target : ndarray, shape (n, n_joints)
        Configuration, and target of the step under way [rad or m].
    doubt : ndarray of int, shape (n,)
        Bit k - 1 set: configuration k of the step is not proven free.
    touched : ndarray of int, shape (n,)
        Number, from 1, of the pair that refused the last step; 0 if none or
        unknown.
    cleared : ndarray of bool, shape (n,)
        Coal has found the step under way free.
    planes : ndarray, shape (n, n_pairs, PLANE)
        Separating plane of each pair and height above it at ``q``; see
        ``kinarm.kernels.planes``.
    scenes : ndarray, shape (n, n_placed, 16) or (0, n_placed, 16)
        Rows in ``poses`` of each episode's bodies when it began, if they differ
        or move; see ``kinarm.contact_shapes``.
    plant, drive : ndarray, shape (n, width) and (n, n_rows, n_actuated), or of no rows
        Numbers of a plant that is not ideal, and its state; see
        ``kinarm.kernels.plant``.
    sensed : ndarray, shape (n, n_joints) or (0, n_joints)
        Joint positions as such a plant measures them [rad or m].
    goal, distance : ndarray, shape (n, goal_width) and (n,)
        Goal, its position first, and the tool's distance from that [m].
    pursuit : Pursuit
        What goals beyond standing points have besides.
    observation : ndarray, shape (n, n_observations)
        Observation of the current state.
    terms, total : ndarray, shape (n, n_terms) and (n,)
        Weighted terms of the last reward, and sum of rewards.
    moments : ndarray, shape (n, 2, n_observations) or (0, 2, n_observations)
        Sums of the observations acted upon, less ``shift``, and their squares.
    shift : ndarray, shape (n_observations,)
        Subtracted before summing, for accuracy.
    path : ndarray, shape (n, horizon + 1, n_joints) or (0, 0, n_joints)
        Configurations visited.
    shielding, blocker : ndarray of int, shape (n,)
        How a shield treats the step under way (``kinarm.kernels.shield``), 0 if
        it does not; and number, from 1, of the pair that it would have touched.
    interventions, replaced : ndarray of int, shape (n,), and (n, horizon), or of no rows
        Steps that a shield replaced, and the pairs that these would have
        touched, from 1; -1 if that is not known, and 0 for other steps.
    """

    status: NDArray[np.int64]
    steps: NDArray[np.int64]
    stop: NDArray[np.int64]
    q: Array
    target: Array
    doubt: NDArray[np.int64]
    touched: NDArray[np.int64]
    cleared: NDArray[np.bool_]
    planes: Array
    scenes: Array
    plant: Array
    drive: Array
    sensed: Array
    goal: Array
    pursuit: Any
    observation: Array
    distance: Array
    terms: Array
    total: Array
    moments: Array
    shift: Array
    path: Array
    shielding: NDArray[np.int64]
    blocker: NDArray[np.int64]
    interventions: NDArray[np.int64]
    replaced: NDArray[np.int64]

    @property
    def first_goals(self) -> Array:
        """Goals with which episodes began, shape (n, goal_width)."""
        goals: Array = self.pursuit.goals
        return goals[:, 0] if len(goals) else self.goal

    @property
    def turn(self) -> Array:
        """Errors of the goals' rests, shape (n,) [rad, or rad or m]; empty if they have none."""
        turn: Array = self.pursuit.turn
        return turn if self.goal.shape[1] > 3 else turn[:0]


@dataclass(frozen=True, eq=False)
class Rollouts:
    """Finished episodes.

    Attributes
    ----------
    starts, goals : ndarray, shape (n, n_joints) and (n, goal_width)
        Start configurations [rad or m] and first goals [m].
    success, collision : ndarray of bool, shape (n,)
        How episodes ended; neither means truncation at the horizon.
    steps, distance, returns : ndarray, shape (n,)
        Steps taken, final distances to the goal [m], and sums of rewards.
    configurations, targets : ndarray, shape (n, n_joints)
        Final configurations, and where the last step led, which differs if it
        was refused.
    moments : ndarray, shape (n, 2, n_observations), or empty
        Sums of the observations acted upon, less the shift, and their squares.
    paths : ndarray, shape (n, horizon + 1, n_joints), or empty
        Configurations visited, NaN after the end.
    turn, goals_reached : ndarray, shape (n,), or empty
        Final error of the goal's rest [rad, or rad or m], and goals reached.
    goal_paths : ndarray, shape (n, horizon + 1, goal_width), or empty
        Goals after each step, for those that move or follow each other.
    interventions, replaced : ndarray of int, shape (n,), and (n, horizon), or empty
        Steps that a shield replaced, and what they would have touched.
    """

    starts: Array
    goals: Array
    success: NDArray[np.bool_]
    collision: NDArray[np.bool_]
    steps: NDArray[np.int64]
    distance: Array
    returns: Array
    configurations: Array
    targets: Array
    moments: Array
    paths: Array
    turn: Array = field(default_factory=lambda: np.zeros(0))
    goals_reached: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    goal_paths: Array = field(default_factory=lambda: np.zeros((0, 0, 3)))
    interventions: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    replaced: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))

    @classmethod
    def from_episodes(cls, starts: Array, episodes: Episodes, *, copy: bool = False) -> "Rollouts":
        """Collect the outcomes of finished episodes in read-only arrays.

        Parameters
        ----------
        starts, episodes
            Where they started, shape (n, n_joints) [rad or m], and the
            episodes.
        copy : bool
            Copy their arrays, which may then serve others.
        """
        kept = partial(np.array, copy=copy or None)
        rollouts = cls(
            starts=starts,
            goals=kept(episodes.first_goals),
            success=episodes.status == SUCCESS,
            collision=episodes.status == COLLISION,
            steps=kept(episodes.steps),
            distance=kept(episodes.distance),
            returns=kept(episodes.total),
            configurations=kept(episodes.q),
            targets=kept(episodes.target),
            moments=kept(episodes.moments),
            paths=kept(episodes.path),
            turn=kept(episodes.turn),
            goals_reached=kept(episodes.pursuit.goals_reached),
            goal_paths=kept(episodes.pursuit.path),
            interventions=kept(episodes.interventions),
            replaced=kept(episodes.replaced),
        )
        for array in vars(rollouts).values():
            array.flags.writeable = False
        return rollouts

    @property
    def outcomes(self) -> tuple[Outcome, ...]:
        """How each episode ended."""
        ends = np.select([self.success, self.collision], ["success", "collision"], "truncated")
        return tuple(ends.tolist())

    def __len__(self) -> int:
        return len(self.steps)

    def __repr__(self) -> str:
        reached, touched = int(self.success.sum()), int(self.collision.sum())
        return f"Rollouts({len(self)} episodes, {reached} successes, {touched} collisions)"
