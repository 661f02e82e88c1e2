"""Reaching tasks: goals, tolerance, horizon, starts and reward; and time.

Numbers out of range are an `InvalidInputError`, what does not match is a `ProblemError`.
"""

import sys
from dataclasses import dataclass, field, fields
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from kinarm._fields import OPTIONAL, Checked
from kinarm.errors import FROM_ZERO, POSITIVE, SHARE, ProblemError
from kinarm.goals import Goals, GoalSpecification
from kinarm.scene import Scene

LONGEST_HORIZON = 1_000_000
"""Largest number of steps of an episode: memory grows with it."""

NEVER = sys.float_info.min
"""A tolerance that nothing meets, not even what is exactly there [m]."""


@dataclass(frozen=True, kw_only=True)
class RewardWeights(Checked):
    """Weights of the reward terms, whose formulas are in `kinarm.kernels.reward`.

    Parameters
    ----------
    progress : float
        Reward per metre by which the tool comes closer to the goal in a step
        [1/m].
    closer : float
        Added in a step that brings the tool closer, subtracted in one that
        takes it farther.
    step : float
        Added in every step; negative to reward haste.
    collision : float
        Added once when a move touches something and the episode ends; usually
        negative.
    success : float
        Added once when the tool comes within the tolerance.
    rotation : float
        Metres that a radian of the goal's direction or rotation, or of a joint,
        counts in a further term, rewarded as progress is [m/rad].
    allow_perverse : bool
        Accept weights that reward contact or punish success.
    """

    progress: float = 1.0
    closer: float = 0.0
    step: float = 0.0
    collision: float = -1.0
    success: float = 0.0
    rotation: float = field(default=0.0, metadata=OPTIONAL)
    allow_perverse: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, perverse, deed in (
            ("collision", self.collision > 0, "rewards contact"),
            ("success", self.success < 0, "punishes it"),
        ):
            if perverse and not self.allow_perverse:
                raise ProblemError(
                    f"reward weight {name} = {getattr(self, name):g} {deed}: give it the other "
                    "sign, or set allow_perverse"
                )

    @property
    def vector(self) -> NDArray[np.float64]:
        """The weights in the order of `terms`."""
        weights = [getattr(self, name) for name in REWARD_TERMS]
        turned = [self.progress * self.rotation] if self.rotation else []
        return np.array(weights + turned, dtype=np.float64)

    @cached_property
    def terms(self) -> tuple[str, ...]:
        """The names of `REWARD_TERMS`, and ``rotation`` if it counts."""
        return (*REWARD_TERMS, "rotation") if self.rotation else REWARD_TERMS


REWARD_TERMS = tuple(
    item.name for item in fields(RewardWeights) if item.name not in ("rotation", "allow_perverse")
)
"""Names of the reward terms of all goals, in the order of `kinarm.kernels.reward`."""


@dataclass(frozen=True, kw_only=True)
class ReachTask(Checked):
    """Bring the tool to a goal.

    Parameters
    ----------
    goal_regions : tuple of str
        Regions of the scene in which goals lie.
    goal_weights : tuple of float
        Relative frequency of each region; equal if none are given.
    tolerance : float
        The goal counts as reached at this distance or less [m].
    horizon : int
        Steps after which an episode is truncated.
    start_spread : float
        Scales the range of the start configurations about the home pose; 1 is
        the whole range of every actuated joint, 0 always starts at home.
    starts : tuple
        Start configurations, each as likely, instead of that range [rad or m].
    reachable_goals : bool
        Draw scenarios again unless inverse kinematics finds a configuration at
        the goal that touches nothing, with bodies where they are at first.
    reward : RewardWeights
        What is rewarded.
    goal : GoalSpecification
        What is to be reached: a position, direction, pose or configuration; how
        it is held; and whether goals move or follow each other.
    """

    goal_regions: tuple[str, ...] = ()
    goal_weights: tuple[float, ...] = field(default=(), metadata=POSITIVE)
    tolerance: float = field(default=0.05, metadata=POSITIVE)
    horizon: int = field(default=64, metadata={"at_most": LONGEST_HORIZON})
    start_spread: float = field(default=1.0, metadata=SHARE)
    starts: tuple[tuple[float, ...], ...] = field(default=(), metadata=OPTIONAL)
    reachable_goals: bool = field(default=False, metadata=OPTIONAL)
    reward: RewardWeights = field(default_factory=RewardWeights)
    goal: GoalSpecification = field(default_factory=GoalSpecification, metadata=OPTIONAL)

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(set(self.goal_regions)) < len(self.goal_regions):
            raise ProblemError(f"goal_regions names one twice: {', '.join(self.goal_regions)}")
        weights = self.goal_weights
        if weights and len(weights) != len(self.goal_regions):
            raise ProblemError(
                f"{len(weights)} goal_weights for {len(self.goal_regions)} goal_regions"
            )
        if self.reward.rotation and not self.goal.number:
            raise ProblemError("reward weight rotation needs a goal with one, not a position")

    def goals_in(self, scene: Scene) -> Goals:
        """Where the positions of goals lie in a scene."""
        regions = [scene.goal_region(name) for name in self.goal_regions]
        lower, upper = np.array([(r.lower, r.upper) for r in regions]).transpose(1, 0, 2)
        weights = self.goal_weights or (1.0,) * len(regions)
        moving = np.flatnonzero((upper - lower).any(axis=0))
        ends = np.cumsum(weights[:-1]) / sum(weights)
        extent, no_rests = (upper - lower)[:, moving], np.zeros((len(regions), 0))
        return Goals(lower, extent, moving, ends, no_rests)


@dataclass(frozen=True, kw_only=True)
class Stepping(Checked):
    """How time passes.

    Parameters
    ----------
    time_step : float
        Duration of a step [s].
    tested_configurations : int
        Evenly spaced configurations, from 1 to 32, at which the motion of a
        step is tested for contact, its end included; 0 for all of the motion.
    shield : bool
        Replace a step that would touch something by the nearest one that does
        not, instead of ending the episode.
    """

    time_step: float = field(default=0.02, metadata=POSITIVE)
    tested_configurations: int = field(default=0, metadata={**FROM_ZERO, "at_most": 32})
    shield: bool = field(default=False, metadata=OPTIONAL)
