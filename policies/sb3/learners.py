"""Algorithms of Stable-Baselines3 and sb3-contrib, for the registry of learners."""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from kinarm.errors import InvalidInputError, UnknownNameError
from kinarm.policies.config import MANY, NOT_NEGATIVE, POSITIVE, Schedule, TrainingConfig
from kinarm.policies.learners import Learner, TrainingState, imported
from kinarm.task import RewardWeights

ALGORITHMS = {
    "a2c": "stable_baselines3:A2C",
    "ddpg": "stable_baselines3:DDPG",
    "sac": "stable_baselines3:SAC",
    "sb3-ppo": "stable_baselines3:PPO",
    "td3": "stable_baselines3:TD3",
    "tqc": "sb3_contrib:TQC",
    "trpo": "sb3_contrib:TRPO",
}
"""Class of each algorithm, by the name of the learner."""


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
        Distance at which an episode of the training counts as a success [m]. It is the task's
        tolerance if it is not given.
    hindsight : bool
        Whether it learns from the goal-conditioned environment with hindsight replay.
    normalize : bool
        Whether observations are normalised by their running statistics.
    action_noise : float
        Standard deviation of noise that is added to the actions in training.
    learning_rate_schedule : {"constant", "linear"}
        Whether the learning rate stays or falls linearly to zero.
    hyperparameters : dict
        Arguments of the algorithm's class, as in TOML; the library's defaults stand for the
        others.
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
        if self.algorithm not in ALGORITHMS:
            raise UnknownNameError("algorithm", self.algorithm, ALGORITHMS)
        if self.learning_rate_schedule == "linear" and "learning_rate" not in self.hyperparameters:
            raise InvalidInputError(
                "learning_rate_schedule linear needs hyperparameters.learning_rate to start from"
            )

    @property
    def learner(self) -> str:
        """Name by which the learner is found."""
        return self.algorithm

    def changed(self, changes: Mapping[str, Any]) -> TrainingConfig:
        """Replace fields; of reward and hyperparameters, what the mapping names."""
        given = dict(changes)
        if isinstance(given.get("hyperparameters"), Mapping):
            given["hyperparameters"] = {**self.hyperparameters, **given["hyperparameters"]}
        return super().changed(given)


@dataclass(frozen=True, kw_only=True, eq=False)
class SB3State(TrainingState):
    """How far a training is; everything else follows from repeating it up to there.

    The training itself, where it is there already, is not in checkpoints.
    """

    training: Any = field(default=None, repr=False, metadata={"unsaved": True})


def _learner(name: str, title: str, **recipes: tuple[str, dict[str, Any]]) -> Learner[Any, Any]:
    """A learner by its name and recipes: what they are in a few words, and their settings."""
    package = ALGORITHMS[name].partition(":")[0]
    contrib = package == "sb3_contrib"
    every = {"default": ("the defaults of the library, with one arm", {}), **recipes}
    return Learner(
        name=name,
        title=f"{title} of {'sb3-contrib' if contrib else 'Stable-Baselines3'}",
        config=SB3Config,
        state=SB3State,
        recipes={
            recipe: SB3Config(recipe=recipe, algorithm=name, **settings)
            for recipe, (_, settings) in every.items()
        },
        summaries={recipe: summary for recipe, (summary, _) in every.items()},
        begin=imported("kinarm.policies.sb3.training", "SB3Training"),
        policy=imported("kinarm.policies.sb3.training", "trained_policy"),
        packages=("torch", "stable_baselines3", *([package] if contrib else [])),
        extra="zoo" if contrib else "sb3",
    )


OFF_POLICY: dict[str, Any] = {
    "learning_rate": 1e-3,
    "gamma": 0.95,
    "tau": 0.05,
    "batch_size": 128,
    "learning_starts": 1000,
    "train_freq": 1,
    "gradient_steps": 2,
    "policy_kwargs": {"net_arch": [128, 128]},
}
"""The settings of rl-zoo for FetchReach, with faster targets and 128 units."""

EIGHT_ARMS: dict[str, Any] = {
    "iterations": 15_000,
    "n_envs": 8,
    "learning_rate_schedule": "linear",
    "training_tolerance": 0.04,
    "reward": RewardWeights(success=5.0),
}
"""120,000 environment steps of eight arms, with kinarm's reward and tolerance."""

A2C = _learner("a2c", "Advantage Actor-Critic")
DDPG = _learner("ddpg", "Deep Deterministic Policy Gradient")
TRPO = _learner("trpo", "Trust Region Policy Optimization")
SAC = _learner(
    "sac",
    "Soft Actor-Critic",
    tuned=(
        "rl-zoo's FetchReach; eight arms, faster targets, 128 units; kinarm's reward and tolerance",
        {**EIGHT_ARMS, "hyperparameters": OFF_POLICY},
    ),
)
TD3 = _learner(
    "td3",
    "Twin Delayed DDPG",
    tuned=(
        "as that of SAC, with rl-zoo's usual noise",
        {**EIGHT_ARMS, "action_noise": 0.1, "hyperparameters": OFF_POLICY},
    ),
)
HINDSIGHT: dict[str, Any] = {
    **OFF_POLICY,
    "top_quantiles_to_drop_per_net": 1,
    "policy_kwargs": {"net_arch": [128, 128], "n_critics": 2, "n_quantiles": 10},
    "replay_buffer_kwargs": {"n_sampled_goal": 4, "goal_selection_strategy": "future"},
}
ON_POLICY: dict[str, Any] = {
    "learning_rate": 1e-3,
    "n_steps": 32,
    "batch_size": 512,
    "n_epochs": 5,
    "gamma": 0.99,
    "gae_lambda": 0.9,
}

TQC = _learner(
    "tqc",
    "Truncated Quantile Critics",
    hindsight=(
        "hindsight replay; rl-zoo's FetchReach; as SAC, and fewer quantiles, for speed; contact "
        "costs three steps more",
        {
            **EIGHT_ARMS,
            "reward": RewardWeights(collision=-3.0),
            "hindsight": True,
            "hyperparameters": HINDSIGHT,
        },
    ),
)
PPO = _learner(
    "sb3-ppo",
    "Proximal Policy Optimization",
    tuned=(
        "rl-zoo's ReacherBullet; more arms and fewer epochs, for speed; kinarm's reward and "
        "tolerance",
        {
            **EIGHT_ARMS,
            "iterations": 18_750,
            "n_envs": 64,
            "normalize": True,
            "hyperparameters": ON_POLICY,
        },
    ),
)
