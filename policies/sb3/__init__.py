"""Algorithms of Stable-Baselines3 and sb3-contrib as learners."""

import tomllib
from dataclasses import dataclass, field
from typing import Any

from kinarm.errors import NOT_NEGATIVE, POSITIVE, InvalidInputError, check_known
from kinarm.policies.config import MANY, Schedule, TrainingConfig
from kinarm.policies.learners import Learner, TrainingState, imported
from kinarm.policies.recipes import shipped_learner

ALGORITHMS = {
    "a2c": ("stable_baselines3", "A2C", "Advantage Actor-Critic"),
    "ddpg": ("stable_baselines3", "DDPG", "Deep Deterministic Policy Gradient"),
    "sac": ("stable_baselines3", "SAC", "Soft Actor-Critic"),
    "sb3-ppo": ("stable_baselines3", "PPO", "Proximal Policy Optimization"),
    "td3": ("stable_baselines3", "TD3", "Twin Delayed DDPG"),
    "tqc": ("sb3_contrib", "TQC", "Truncated Quantile Critics"),
    "trpo": ("sb3_contrib", "TRPO", "Trust Region Policy Optimization"),
}
"""Package, class and title of each algorithm, by learner."""


def hyperparameters_of(text: str) -> dict[str, Any]:
    """Hyperparameters of a text such as ``"gamma = 0.9, policy_kwargs.net_arch = [64, 64]"``."""
    try:
        return dict(tomllib.loads(f"given = {{ {text} }}")["given"])
    except tomllib.TOMLDecodeError as error:
        raise InvalidInputError(
            f"must be as in TOML, such as 'gamma = 0.9, tau = 0.01', got {text!r}"
        ) from error


@dataclass(frozen=True, kw_only=True)
class SB3Config(TrainingConfig):
    """Settings of a training with an algorithm of Stable-Baselines3 or sb3-contrib.

    Parameters
    ----------
    problem, reward, seed, recipe
        See `TrainingConfig`.
    algorithm : str
        The algorithm, by the name of the learner.
    iterations : int
        Steps of all arms.
    n_envs : int
        Arms that are simulated at once.
    training_tolerance : float, optional
        Distance that counts as a success in the training [m]; by default the
        task's tolerance.
    hindsight : bool
        Whether it learns in the goal-conditioned environment, with hindsight
        replay.
    normalize : bool
        Whether running statistics normalise observations, but for goals that
        hindsight replaces.
    action_noise : float
        Standard deviation of noise added to actions in training.
    learning_rate_schedule : {"constant", "linear"}
        Whether the learning rate stays or falls linearly to zero.
    hyperparameters : dict
        Arguments of the algorithm's class, as in TOML; others have the
        library's defaults.
    """

    algorithm: str
    iterations: int = 120_000
    n_envs: int = field(default=1, metadata=MANY)
    training_tolerance: float | None = field(default=None, metadata=POSITIVE)
    hindsight: bool = False
    normalize: bool = False
    action_noise: float = field(default=0.0, metadata=NOT_NEGATIVE)
    learning_rate_schedule: Schedule = "constant"
    hyperparameters: dict[str, Any] = field(
        default_factory=dict, metadata={"parse": hyperparameters_of, "metavar": "SETTINGS"}
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        check_known("algorithm", [self.algorithm], ALGORITHMS)
        if self.learning_rate_schedule == "linear" and "learning_rate" not in self.hyperparameters:
            raise InvalidInputError(
                "learning_rate_schedule linear needs hyperparameters.learning_rate to start from"
            )

    @property
    def learner(self) -> str:
        """Name by which the learner is found."""
        return self.algorithm


@dataclass(frozen=True, kw_only=True, eq=False)
class SB3State(TrainingState):
    """How far a training is; repeating it gives everything else.

    The running training, if any, is not in checkpoints.
    """

    training: Any = field(default=None, repr=False, metadata={"unsaved": True})


def _learner(name: str) -> Learner[SB3Config, SB3State]:
    """The learner of an algorithm."""
    package, _, title = ALGORITHMS[name]
    contrib = package == "sb3_contrib"
    return shipped_learner(
        name,
        SB3Config,
        title=f"{title} of {'sb3-contrib' if contrib else 'Stable-Baselines3'}",
        state=SB3State,
        begin=imported("kinarm.policies.sb3.training", "SB3Training"),
        policy=imported("kinarm.policies.sb3.training", "trained_policy"),
        packages=("torch", "stable_baselines3", *([package] if contrib else [])),
        extra="zoo" if contrib else "sb3",
    )


A2C, DDPG, SAC, PPO, TD3, TQC, TRPO = map(_learner, ALGORITHMS)
