"""Proximal Policy Optimization: settings, state of a training, and learner."""

from dataclasses import dataclass, field
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinarm._fields import OPTIONAL
from kinarm.errors import NOT_NEGATIVE, POSITIVE, SHARE, InvalidInputError
from kinarm.failed_scenarios import LARGEST_REPLAY, FailedScenarios
from kinarm.policies.config import MANY, WIDTHS, Schedule, TrainingConfig
from kinarm.policies.learners import TrainingState, imported
from kinarm.policies.normalizer import Normalizer
from kinarm.policies.recipes import shipped_learner
from kinarm.problem import ReachProblem

SETTLED = 0.9
"""Share of a training after which the noise is final."""


@dataclass(frozen=True, kw_only=True)
class PPOConfig(TrainingConfig):
    """Settings of a training of 1.2 million environment steps, as in the paper.

    The paper gives no others. Names and defaults are those of
    Stable-Baselines3. For speed, 16 environments fill the rollouts of 2000
    steps, and minibatches are larger.

    Parameters
    ----------
    problem, reward, seed, recipe
        See `TrainingConfig`.
    iterations : int
        Rollouts, each followed by an update.
    n_envs : int
        Arms that are simulated at once.
    n_steps : int
        Steps of each arm between two updates.
    batch_size : int
        Environment steps per gradient step.
    n_epochs : int
        How often an update uses each environment step.
    net_arch : tuple of int
        Widths of the hidden layers of the actor and of the critic.
    learning_rate : float
        Step size of Adam.
    learning_rate_schedule : {"constant", "linear"}
        Whether it stays or falls linearly to zero.
    gamma : float
        Discount per step.
    gae_lambda : float
        Decay of generalised advantage estimation.
    clip_range : float
        How far the probability ratio may leave 1.
    ent_coef : float
        Weight of the entropy in the loss.
    vf_coef : float
        Weight of the critic's loss.
    max_grad_norm : float
        Largest norm of a gradient; longer ones are clipped.
    log_std_init : float
        Initial logarithm of the standard deviation of the actions.
    final_log_std : float, optional
        Final logarithm of the standard deviation, which changes linearly;
        without it, PPO learns it.
    training_tolerance : float, optional
        Distance that counts as a success in the training [m]; by default the
        task's tolerance.
    training_hold : int, optional
        Steps in a row within the tolerance that a success in the training takes;
        by default the task's.
    training_speed : float, optional
        Largest speed of the tool in those steps [m/s]; by default the task's.
    residual : bool
        Whether the network adds to resolved-rate control (Silver et al. 2018), which
        the observation then shows: action = rate + longest entry of the rate x
        output. The nearer the goal, the less it adds, so that it cannot miss it.
    symmetric : bool
        Whether the policy treats mirror images alike, if arm and obstacles are
        symmetric; it then learns from goals on the right and mirror images of
        others.
    intervention_penalty : float
        Taken from the reward of a step that a shield replaces; without it, a
        policy learns to lean on its shield.
    replay_share : float
        Probability that an episode begins where an earlier one failed; see
        `kinarm.failed_scenarios`.
    replay_size : int
        Failed scenarios that are kept.
    replay_log_std : float, optional
        Smallest logarithm of the standard deviation in replayed episodes: with
        less noise, a policy never succeeds where it always fails. By default
        there is none.
    initial_policy : str, optional
        Name or file of a policy to begin with; it must see the same and have the
        same layers, and may be for another problem or arm.
    """

    iterations: int = 600
    n_envs: int = field(default=16, metadata=MANY)
    n_steps: int = field(default=125, metadata=MANY)
    batch_size: int = 500
    n_epochs: int = 10
    net_arch: tuple[int, ...] = field(default=(64, 64), metadata=WIDTHS)
    learning_rate: float = field(default=3e-4, metadata=POSITIVE)
    learning_rate_schedule: Schedule = "constant"
    gamma: float = field(default=0.99, metadata=SHARE)
    gae_lambda: float = field(default=0.95, metadata=SHARE)
    clip_range: float = field(default=0.2, metadata=POSITIVE)
    ent_coef: float = field(default=0.0, metadata=NOT_NEGATIVE)
    vf_coef: float = field(default=0.5, metadata=NOT_NEGATIVE)
    max_grad_norm: float = field(default=0.5, metadata=POSITIVE)
    log_std_init: float = 0.0
    final_log_std: float | None = field(default=None, metadata=OPTIONAL)
    training_tolerance: float | None = field(default=None, metadata=POSITIVE)
    training_hold: int | None = field(default=None, metadata={**MANY, **OPTIONAL})
    training_speed: float | None = field(default=None, metadata={**POSITIVE, **OPTIONAL})
    residual: bool = field(default=False, metadata=OPTIONAL)
    symmetric: bool = False
    intervention_penalty: float = field(default=0.0, metadata={**NOT_NEGATIVE, **OPTIONAL})
    replay_share: float = field(default=0.0, metadata={**SHARE, **OPTIONAL})
    replay_size: int = field(default=8192, metadata={"at_most": LARGEST_REPLAY, **OPTIONAL})
    replay_log_std: float | None = field(default=None, metadata=OPTIONAL)
    initial_policy: str | None = field(default=None, metadata=OPTIONAL)

    learner = "ppo"

    DEFAULTS: ClassVar = {
        "final_log_std": "none, it is learnt",
        "training_tolerance": "the task's",
        "training_hold": "the task's",
        "training_speed": "the task's",
        "replay_log_std": "none, noise as in others",
    }
    """Meaning of leaving out an option that has no default value."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.net_arch:
            raise InvalidInputError("net_arch must name at least one layer")
        if self.residual:
            task, seen = self.problem.task, self.problem.observation
            parts = dict.fromkeys((*seen.names(task.goal.kind), "resolved_rate"))
            object.__setattr__(self, "problem", self.problem.replace(observation=[*parts]))
        if self.replay_log_std is not None and not self.replay_share:
            raise InvalidInputError("replay_log_std needs a replay_share above 0")
        if self.batch_size == 1 or self.steps_per_iteration % self.batch_size:
            raise InvalidInputError(
                f"batch_size must be above 1 and divide the {self.steps_per_iteration} steps of a "
                f"rollout, got {self.batch_size}"
            )

    @property
    def steps_per_iteration(self) -> int:
        """Environment steps of a rollout."""
        return self.n_envs * self.n_steps

    @property
    def training_problem(self) -> ReachProblem:
        """The problem with the reward, the tolerance and the stop of these settings."""
        stop = {"hold": self.training_hold, "speed": self.training_speed}
        goal = {name: value for name, value in stop.items() if value is not None}
        return self.problem.replace(
            reward=self.reward, tolerance=self.training_tolerance, goal=goal or None
        )

    def log_std_at(self, done: float) -> float | None:
        """Logarithm of the deviation after a share of the training, if set."""
        if self.final_log_std is None:
            return None
        settled = min(1.0, done / SETTLED)
        return (1 - settled) * self.log_std_init + settled * self.final_log_std


class EpisodeStates(NamedTuple):
    """The state of running episodes.

    Attributes
    ----------
    q, start : ndarray, shape (n, n_joints)
        Current and first configurations [rad or m].
    goal : ndarray, shape (n, goal_width)
        First goals [m].
    steps, total : ndarray, shape (n,)
        Steps taken, and sums of rewards so far.
    replayed : ndarray of bool, shape (n,)
        Whether they began where an earlier one had failed.
    drive : ndarray, shape (n, n_rows, n_actions), or empty
        States of their plants.
    done : ndarray of int, shape (n, 2) or (0, 2)
        Goals reached, and steps in a row that the present one is kept, of goals
        beyond standing points.
    observation : ndarray, shape (n, n_observations), or empty
        What they see, where it tells of earlier steps.
    """

    q: NDArray[np.float64]
    goal: NDArray[np.float64]
    steps: NDArray[np.int64]
    total: NDArray[np.float64]
    start: NDArray[np.float64]
    replayed: NDArray[np.bool_]
    drive: NDArray[np.float64] = np.zeros((0, 0, 0))
    done: NDArray[np.int64] = np.zeros((0, 2), dtype=np.int64)
    observation: NDArray[np.float64] = np.zeros((0, 0))

    @classmethod
    def begun(cls, starts: NDArray[np.float64], goals: NDArray[np.float64]) -> "EpisodeStates":
        """Of new episodes."""
        n = len(starts)
        counts = np.zeros(n, dtype=np.int64)
        return cls(starts, goals, counts, np.zeros(n), starts, np.zeros(n, dtype=bool))


@dataclass(frozen=True, kw_only=True, eq=False)
class PPOState(TrainingState):
    """Everything that the next iteration depends on.

    Parameters
    ----------
    parameters : ndarray of float32, shape (n_parameters,)
        Parameters of actor and critic, in the order of Stable-Baselines3.
    first_moment, second_moment : ndarray of float32, shape (n_parameters,)
        Adam's running means of the gradients and of their squares.
    normalizer : Normalizer
        Statistics that normalise observations.
    episodes : EpisodeStates
        The running episodes.
    failed : FailedScenarios
        What may be replayed.
    scenarios : int
        Scenarios drawn so far, but for replays.
    """

    parameters: NDArray[np.float32]
    first_moment: NDArray[np.float32]
    second_moment: NDArray[np.float32]
    normalizer: Normalizer
    episodes: EpisodeStates
    failed: FailedScenarios
    scenarios: int


LEARNER = shipped_learner(
    "ppo",
    PPOConfig,
    title="Proximal Policy Optimization",
    state=PPOState,
    begin=imported("kinarm.policies.ppo.learner", "PPOTraining"),
    policy=imported("kinarm.policies.ppo.networks", "actor_policy"),
)
