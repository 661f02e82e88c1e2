"""Settings of Proximal Policy Optimization."""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, get_args

from kinarm.errors import InvalidInputError
from kinarm.policies.learners import Schedule, scheduled
from kinarm.task import RewardWeights, load_task
from kinarm.validation import whole_number

if TYPE_CHECKING:
    from kinarm.simulator import Simulator

WHOLE_NUMBERS = ("arms", "rollout_steps", "minibatch", "epochs", "iterations", "horizon")
POSITIVE_NUMBERS = ("learning_rate", "clip_range", "max_grad_norm", "tolerance")
SHARES = ("gamma", "gae_lambda", "start_spread", "initial_start_spread", "widening")


@dataclass(frozen=True, kw_only=True)
class PPOConfig:
    """Settings of a training of 1.2 million environment steps, as in the paper.

    The paper gives no other settings; the defaults are those of Stable-Baselines3, save that 16
    arms fill its rollouts of 2000 steps and that minibatches are larger, for speed.

    Parameters
    ----------
    task : str
        ``"left"``, ``"right"`` or ``"both"``.
    arm : str
        A shipped arm or the path of a URDF.
    seed : int
        Seed of all randomness.
    recipe : str
        Name of these settings, for the record.
    arms : int
        Arms that are simulated at once.
    rollout_steps : int
        Steps of each arm between two updates.
    iterations : int
        Rollouts, each followed by an update.
    minibatch : int
        Environment steps per gradient step.
    epochs : int
        How often an update uses each environment step.
    hidden : tuple of int
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
    entropy_weight : float
        Weight of the entropy in the loss.
    value_weight : float
        Weight of the critic's loss.
    max_grad_norm : float
        Gradients are shortened to this norm.
    initial_log_std : float
        Logarithm of the standard deviation of the actions at the beginning.
    horizon : int
        Steps of an episode.
    tolerance : float
        Distance at which an episode of the training counts as a success [m].
    symmetric : bool
        Whether the policy is to treat mirror images alike, where the task is its own mirror
        image (``both``); it then learns from goals on the right and from mirror images of those
        on the left; see `kinarm.policies.symmetric_layers`. Needs two hidden layers.
    progress_reward : float
        Reward weight of a metre by which the tool came closer [1/m].
    closer_reward : float
        Reward weight of a step that brings the tool closer, against one that takes it farther.
    collision_penalty : float
        Reward weight of a collision.
    success_bonus : float
        Reward weight of success.
    step_reward : float
        Reward weight of a step.
    start_spread : float
        Scales the range of the start configurations.
    initial_start_spread : float
        The same at the beginning of the training.
    widening : float
        Share of the training in which the spread grows linearly from the one to the other.
    """

    task: str = "right"
    arm: str = "paper"
    seed: int = 0
    recipe: str = "custom"
    arms: int = 16
    rollout_steps: int = 125
    iterations: int = 600
    minibatch: int = 500
    epochs: int = 10
    hidden: tuple[int, ...] = (64, 64)
    learning_rate: float = 3e-4
    learning_rate_schedule: Schedule = "constant"
    gamma: float = 0.99
    gae_lambda: float = 0.95
    clip_range: float = 0.2
    entropy_weight: float = 0.0
    value_weight: float = 0.5
    max_grad_norm: float = 0.5
    initial_log_std: float = 0.0
    horizon: int = 64
    tolerance: float = 0.05
    symmetric: bool = False
    progress_reward: float = 1.0
    closer_reward: float = 0.0
    collision_penalty: float = -1.0
    success_bonus: float = 0.0
    step_reward: float = 0.0
    start_spread: float = 1.0
    initial_start_spread: float = 1.0
    widening: float = 0.0

    def __post_init__(self) -> None:
        for name in (*WHOLE_NUMBERS, "seed"):
            number = whole_number(name, getattr(self, name), 0 if name == "seed" else 1)
            object.__setattr__(self, name, number)
        hidden = tuple(whole_number("hidden", width, 1) for width in self.hidden)
        object.__setattr__(self, "hidden", hidden)
        if len(hidden) < 1 + self.symmetric:
            raise InvalidInputError(
                f"hidden must name at least {1 + self.symmetric} layers, got {len(hidden)}"
            )
        self._check_numbers()
        if self.learning_rate_schedule not in get_args(Schedule):
            raise InvalidInputError(
                f"learning_rate_schedule must be one of {', '.join(get_args(Schedule))}, "
                f"got {self.learning_rate_schedule!r}"
            )
        if self.minibatch == 1 or self.steps_per_iteration % self.minibatch:
            raise InvalidInputError(
                f"minibatch must be above 1 and divide the {self.steps_per_iteration} steps of a "
                f"rollout, got {self.minibatch}"
            )

    def _check_numbers(self) -> None:
        """Refuse real numbers out of their range."""
        for name in POSITIVE_NUMBERS:
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise InvalidInputError(f"{name} must be greater than 0, got {value}")
        for name in SHARES:
            if not 0 <= getattr(self, name) <= 1:
                raise InvalidInputError(f"{name} must lie in [0, 1], got {getattr(self, name)}")
        for name in ("entropy_weight", "value_weight"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0):
                raise InvalidInputError(f"{name} must not be negative, got {value}")
        if not math.isfinite(self.initial_log_std):
            raise InvalidInputError(f"initial_log_std must be finite, got {self.initial_log_std}")

    @property
    def steps_per_iteration(self) -> int:
        """Environment steps of a rollout."""
        return self.arms * self.rollout_steps

    @property
    def environment_steps(self) -> int:
        """Environment steps of the whole training."""
        return self.iterations * self.steps_per_iteration

    def simulator(self) -> "Simulator":
        """Build the simulator to train in; its batches are too small for several threads."""
        from kinarm.simulator import Simulator

        reward = RewardWeights(
            progress=self.progress_reward,
            closer=self.closer_reward,
            collision=self.collision_penalty,
            success=self.success_bonus,
            step=self.step_reward,
        )
        task = load_task(
            self.task,
            horizon=self.horizon,
            tolerance=self.tolerance,
            start_spread=self.start_spread,
            reward=reward,
        )
        return Simulator(self.arm, task, threads=1)

    def learning_rate_at(self, done: float) -> float:
        """Learning rate after this share of the training."""
        return scheduled(self.learning_rate, self.learning_rate_schedule, done)

    def start_spread_at(self, done: float) -> float:
        """Spread of the start configurations after this share of the training."""
        if done >= self.widening:
            return self.start_spread
        grown = done / self.widening
        return (1 - grown) * self.initial_start_spread + grown * self.start_spread
